"""The interface of action plug-ins: what they implement, and the ports of the robot that they may use."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol, Self

from pydantic import JsonValue

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.log import get_logger
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.state import Load
from nena_shared.vda5050.topics import RobotKey


@dataclass(frozen=True, slots=True)
class ActionTimeouts:
    """Timeouts of plug-ins, s: to report the start of an action, and to pause or cancel it."""

    begin: float = 10.0
    obey: float = 10.0


Fields = Mapping[str, Any]
"""A message as plain data: numbers, strings, lists, and a mapping for each nested message."""


class RosError(Exception):
    """A ROS request failed; the message contains the reason."""


class ActionFailedError(RosError):
    """A goal of a ROS action did not succeed; ``result`` has the fields of its result, empty if it was lost.

    Another client has ``cancelled`` the goal, or else the server has aborted it. The fields do not tell: a
    cancelled goal may carry an error code of an earlier failure, and an aborted one none.
    """

    def __init__(self, message: str, result: Fields, *, cancelled: bool = False) -> None:
        super().__init__(message)
        self.result = result
        self.cancelled = cancelled


class DriveError(Exception):
    """A drive of an action did not arrive; the message contains the reason."""


class TopicQos(StrEnum):
    """Quality of service of a subscription."""

    RELIABLE = "reliable"
    """Receive every message of reliable publishers, and nothing from best-effort ones."""
    BEST_EFFORT = "best_effort"
    """Match every publisher, such as batteries and other sensors; messages may be lost."""
    LATCHED = "latched"
    """Also receive the last earlier message, if the publisher keeps it (transient local)."""


class Publisher(Protocol):
    """Sends messages of one type on one topic."""

    @property
    def listeners(self) -> int:
        """Return the number of subscribers."""
        ...

    def publish(self, fields: Mapping[str, JsonValue]) -> None:
        """Publish a message; missing fields have the type's defaults.

        Raises:
            RosError: there is no ROS session now, or the fields do not fit the type.
        """
        ...


class ServiceClient(Protocol):
    """Calls one service."""

    async def call(self, fields: Mapping[str, JsonValue], *, seconds: float) -> Fields:
        """Call the service and return the response.

        Raises:
            RosError: there is no ROS session, no node offers the service, there is no response within
                ``seconds``, or the fields do not fit the type.
        """
        ...


class RosActionClient(Protocol):
    """Sends goals to one ROS action."""

    async def run(self, fields: Mapping[str, JsonValue]) -> Fields:
        """Send a goal, wait for its end, and return its result; when cancelled, cancel the goal first.

        The result is empty if the goal succeeded, as its status shows, and the result was lost.

        Raises:
            ActionFailedError: the goal was aborted, or cancelled by another client.
            RosError: there is no ROS session now, no node offers the action, the server refuses the goal or
                ends during it, or the fields do not fit the type.
        """
        ...


# 0020: names and plain data, so that plug-ins need no ROS classes, and the port outlives a session.
class RosPort(Protocol):
    """ROS in the robot's namespace and domain; endpoints are recreated in each new ROS session."""

    def publisher(self, topic: str, type_name: str) -> Publisher:
        """Return a reliable publisher on ``topic``.

        Raises:
            RosError: the type is not installed here.
        """
        ...

    def subscribe(
        self,
        topic: str,
        type_name: str,
        handle: Callable[[Fields], None],
        *,
        qos: TopicQos = TopicQos.RELIABLE,
    ) -> None:
        """Call ``handle`` with each message, in the event loop.

        Raises:
            RosError: the type is not installed here.
        """
        ...

    def client(self, service: str, type_name: str) -> ServiceClient:
        """Return a client of ``service``.

        Raises:
            RosError: the type is not installed here.
        """
        ...

    def action(self, name: str, type_name: str) -> RosActionClient:
        """Return a client of the action ``name``, of a type such as nav2_msgs/action/Spin.

        Raises:
            RosError: the type is not installed here.
        """
        ...


class DrivePort(Protocol):
    """Short drives of an action while the order waits at a node."""

    @property
    def pose(self) -> Pose | None:
        """Return the robot's pose in the plant's frame, None if it is not localised."""
        ...

    async def drive(
        self,
        pose: Pose,
        *,
        deviation_xy: float,
        deviation_theta: float | None = None,
        maximum_speed: float | None = None,
    ) -> None:
        """Drive to ``pose`` (m, rad, m/s); if cancelled, stop the robot first.

        Use it only in HARD or SOFT node actions: during others, the order drives too.

        Raises:
            DriveError: the robot did not reach ``pose``.
        """
        ...

    async def initialize_position(self, pose: Pose) -> None:
        """Set the robot's pose in the localisation.

        Raises:
            DriveError: the localisation does not accept it.
        """
        ...


Report = Callable[[ActionReport], None]
"""Reports a new status to the core, or progress (RUNNING with a result); may be called from any thread."""


class PluginUnavailableError(Exception):
    """A plug-in cannot work on this robot, for the reason in the message; only its actions are missing."""


# 0020: methods, because a coroutine can be cancelled but not paused, and machines are paused.
class RunningAction(Protocol):
    """One running action (VDA 5050 3.0 section 6.6.9).

    Every method returns at once; the outcome is reported later.
    """

    def pause(self) -> None:
        """Pause the action; report PAUSED. Called only if the declaration allows it."""
        ...

    def resume(self) -> None:
        """Resume the action; report RUNNING."""
        ...

    def cancel(self) -> None:
        """Cancel and report FAILED. Called only if the declaration allows it, and when the agent exits."""
        ...


class ActionPlugin(Protocol):
    """Runs one type of action."""

    @property
    def declaration(self) -> ActionDeclaration:
        """Return the declaration, for order acceptance and the factsheet (VDA 5050 3.0 section 7.10)."""
        ...

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:
        """Start ``action``, with ``loads`` on the robot, and return at once (VDA 5050 3.0 section 6.6.9).

        Report RUNNING, and finally FINISHED or FAILED. If this raises an exception, the action is FAILED.
        """
        ...


@dataclass(frozen=True, slots=True)
class PluginContext:
    """The context passed to a plug-in's factory, one per robot of the program.

    ``options`` are this plug-in's options in the settings. ``ros`` is None on a robot without ROS; a plug-in
    that needs ROS then raises :class:`PluginUnavailableError`.
    """

    robot: RobotKey
    drive: DrivePort
    ros: RosPort | None = None
    options: Mapping[str, JsonValue] = field(default_factory=dict)


PluginFactory = Callable[[PluginContext], ActionPlugin | Iterable[ActionPlugin]]
"""Target of an entry point in the group ``nena.actions``: creates one or more plug-ins."""


log = get_logger(__name__)


Work = Callable[[], Coroutine[None, None, ActionReport]]


class WorkFailedError(Exception):
    """The action failed, for the reason in the message. ``report``, if any, is its final report."""

    def __init__(self, message: str, report: ActionReport | None = None) -> None:
        super().__init__(message)
        self.report = report


class BackgroundAction:
    """An action that runs a coroutine, which returns the final report or raises :class:`WorkFailedError`."""

    def __init__(self, action_id: str, work: Work, report: Report) -> None:
        self._action_id = action_id
        self._report = report
        report(ActionReport(action_id, ActionStatus.RUNNING))
        self._task = asyncio.create_task(self._run_work(work), name=f"action {action_id}")
        self._task.add_done_callback(self._work_ended)

    @property
    def ended(self) -> bool:
        """Return whether the action has ended."""
        return self._task.done()

    def pause(self) -> None:
        """Do nothing: these actions declare that they cannot be paused."""

    def resume(self) -> None:
        """Do nothing."""

    def cancel(self) -> None:
        """Cancel the work, which may clean up before it ends."""
        self._task.cancel()

    async def _run_work(self, work: Work) -> None:
        try:
            self._report(await work())
        except WorkFailedError as error:
            if error.report:
                self._report(error.report)
            else:
                self._report_failure(str(error))
        except Exception as error:
            log.exception("an action failed", action=self._action_id)
            self._report_failure(f"the plug-in failed: {error}")

    def _work_ended(self, task: asyncio.Task[None]) -> None:
        if task.cancelled():
            self._report_failure("cancelled")

    def _report_failure(self, reason: str) -> None:
        self._report(ActionReport(self._action_id, ActionStatus.FAILED, reason))


class Countdown:
    """An action that takes ``seconds`` and then calls ``done``, which reports the end."""

    def __init__(self, action_id: str, seconds: float, report: Report, done: Callable[[], None]) -> None:
        self._action_id = action_id
        self._left = seconds
        self._report = report
        self._done = done
        self._timer: asyncio.TimerHandle | None = None
        self._ended = False

    def start(self) -> Self:
        """Start the countdown, and return it."""
        self._timer = asyncio.get_running_loop().call_later(self._left, self._work_ended)
        self._report(ActionReport(self._action_id, ActionStatus.RUNNING))
        return self

    def pause(self) -> None:
        """Stop the countdown; report PAUSED."""
        if self._timer is not None:
            self._left = max(0.0, self._timer.when() - asyncio.get_running_loop().time())
            self._stop_timer()
            self._report(ActionReport(self._action_id, ActionStatus.PAUSED))

    def resume(self) -> None:
        """Continue the countdown; report RUNNING."""
        if self._timer is None and not self._ended:
            self.start()

    def cancel(self) -> None:
        """End the countdown early; report FAILED."""
        if not self._ended:
            self._ended = True
            self._stop_timer()
            self._report(ActionReport(self._action_id, ActionStatus.FAILED, "cancelled"))

    def _work_ended(self) -> None:
        self._ended, self._timer = True, None
        self._done()

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


class Ended:
    """An action that has already ended: every method does nothing."""

    def pause(self) -> None:
        """Do nothing."""

    def resume(self) -> None:
        """Do nothing."""

    def cancel(self) -> None:
        """Do nothing."""


ENDED = Ended()
