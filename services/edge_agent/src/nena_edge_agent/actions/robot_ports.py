"""The ports of a robot for action plug-ins: drives, the load sensor and ROS."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from math import inf

from nena_edge_agent.actions.messages import UnknownTypeError, matches, message_type
from nena_edge_agent.actions.plugin import DriveError, Fields, RosPort
from nena_edge_agent.actions.ros_operations import ActionValues, MessageTemplate
from nena_edge_agent.actions.settings import ActionSettings, LoadSensorSettings, OperationBase
from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveGoal,
    Driver,
    Halted,
    Pose,
    PoseReport,
    PositionInitialized,
)
from nena_edge_agent.protocol.events import Event, LoadSensed
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import set_within

HALT_TIMEOUT = 10.0
"""Timeout for the robot to stop, seconds; afterwards a cancelled drive ends anyway."""


class ActionDrive:
    """The drives of one robot's actions.

    Their goals have negative generations, which the protocol core ignores.
    """

    def __init__(self) -> None:
        self._driver: Driver | None = None
        self._pose: PoseReport | None = None
        self._generation = 0
        self._result: asyncio.Future[str] | None = None
        self._position_set: asyncio.Future[str] | None = None
        self._standstill: asyncio.Event = asyncio.Event()

    def use_driver(self, driver: Driver) -> None:
        """Use ``driver`` for drives."""
        self._driver = driver

    def observe_event(self, event: Event) -> None:
        """Handle an event of the driver."""
        match event:
            case PoseReport():
                self._pose = event
            case Halted():
                self._standstill.set()
            case PositionInitialized(succeeded, description) if (
                self._position_set and not self._position_set.done()
            ):
                self._position_set.set_result(
                    "" if succeeded else description or "the localisation rejected it"
                )
            case Arrived(generation) if generation == self._generation:
                self._end_drive("")
            case DriveFailed(generation, failure, description) if generation == self._generation:
                self._end_drive(f"{description} ({failure})")

    @property
    def pose(self) -> Pose | None:
        """Return the robot's pose in the plant's frame, None if it is not localised."""
        return self._pose.pose if self._pose and self._pose.localized else None

    async def drive(
        self,
        pose: Pose,
        *,
        deviation_xy: float,
        deviation_theta: float | None = None,
        maximum_speed: float | None = None,
    ) -> None:
        """Drive to ``pose``; if that is cancelled or fails, stop the robot first.

        Raises:
            DriveError: the robot did not reach ``pose``, or another action drives.
        """
        # The driver has one goal at a time: a second one would silently end the first.
        if self._driver is None or self._result is not None:
            raise DriveError("another action is driving" if self._driver else "the driver is not ready")
        self._generation -= 1
        goal = DriveGoal(self._generation, pose, deviation_xy, deviation_theta, maximum_speed)
        self._result = asyncio.get_running_loop().create_future()
        try:
            self._driver.go_to(goal)
            problem = await self._result
        except asyncio.CancelledError:
            await self._begin_halt(self._driver.halt)
            raise
        finally:
            self._result = None
        if problem:
            await self._begin_halt(self._driver.halt)
            raise DriveError(problem)

    async def initialize_position(self, pose: Pose) -> None:
        """Set the robot's pose in the localisation.

        Raises:
            DriveError: the localisation does not accept it.
        """
        if self._driver is None or self._position_set is not None:
            message = "another action is setting the position" if self._driver else "the driver is not ready"
            raise DriveError(message)
        self._position_set = asyncio.get_running_loop().create_future()
        try:
            self._driver.initialize_position(pose)
            problem = await self._position_set
        finally:
            self._position_set = None
        if problem:
            raise DriveError(problem)

    async def _begin_halt(self, halt: Callable[[], None]) -> None:
        self._standstill.clear()
        halt()
        await set_within(self._standstill, HALT_TIMEOUT)

    def _end_drive(self, problem: str) -> None:
        if self._result is not None and not self._result.done():
            self._result.set_result(problem)


PATH = "actions.load_sensor"
REPEAT_INTERVAL = 1.0
"""Interval at which an unchanged value is reported again, seconds: an action may have changed the load."""


class LoadSensor:
    """Reports the sensor's value to ``put``: at once if it has changed, otherwise at intervals.

    Raises:
        ConfigurationError: the load sensor's message does not match its type.
    """

    def __init__(
        self, settings: LoadSensorSettings, port: RosPort, put: Callable[[LoadSensed], None]
    ) -> None:
        nothing = ActionValues(OperationBase(action_type=PATH))
        try:
            shape = message_type(settings.type)
        except UnknownTypeError as error:
            raise ConfigurationError([f"{PATH}.type: {error}"]) from error
        template = MessageTemplate(settings.loaded, shape, nothing, f"{PATH}.loaded", any_of=True)
        self._loaded = template.fill({})
        self._reported: bool | None = None
        self._reported_at = -inf
        self._put = put
        port.subscribe(settings.topic, settings.type, self._on_message, qos=settings.qos)

    def _on_message(self, message: Fields) -> None:
        loaded, now = matches(message, self._loaded), asyncio.get_running_loop().time()
        if loaded is not self._reported or now - self._reported_at >= REPEAT_INTERVAL:
            self._reported, self._reported_at = loaded, now
            self._put(LoadSensed(loaded=loaded))


Put = Callable[[Event], None]
DriverMaker = Callable[[Put, Pose | None], Driver]


class RobotPorts:
    """The ports of one robot for plug-ins; ``ros`` is None without ROS."""

    def __init__(self, ros: RosPort | None, settings: ActionSettings) -> None:
        self.ros = ros
        self.drive = ActionDrive()
        self._sensor = settings.load_sensor

    def observe_driver(self, make_driver: DriverMaker) -> DriverMaker:
        """Return a factory of drivers whose events these ports observe.

        It raises ConfigurationError if the load sensor's message does not match its type.
        """

        def make(put: Put, last_place: Pose | None) -> Driver:
            def on_event(event: Event) -> None:
                self.drive.observe_event(event)
                put(event)

            # 0020: a sensor takes precedence over the loads that actions declare.
            if self._sensor and self.ros:
                LoadSensor(self._sensor, self.ros, put)
            driver = make_driver(on_event, last_place)
            self.drive.use_driver(driver)
            return driver

        return make
