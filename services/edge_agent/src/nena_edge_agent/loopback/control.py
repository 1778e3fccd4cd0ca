"""Simulation control of loopback robots: MQTT commands that simulate people and the environment.

From top to bottom: the commands, their effects on one robot, and the MQTT API.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator
from pydantic.alias_generators import to_camel

from nena_edge_agent.driver.port import Circle
from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_edge_agent.protocol.events import (
    ErrorSwitched,
    Event,
    LocalTrigger,
    OperatingModeSwitched,
    PauseButton,
    SafetyReport,
)
from nena_shared.findings import FINDINGS_SHOWN, in_words
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference
from nena_shared.vda5050.state import EmergencyStop, OperatingMode
from nena_shared.vda5050.topics import RobotKey

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Text = Annotated[str, Field(max_length=1000)]
Name = Annotated[str, Field(min_length=1, max_length=200)]


class CommandRefusedError(Exception):
    """A command is invalid or cannot be executed now; ``problems`` are its reasons, one sentence each."""

    def __init__(self, *problems: str) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems


class _Command(BaseModel):
    # 0012: a command with an unknown field or a wrong type is refused and changes nothing.
    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, alias_generator=to_camel, validate_by_name=False
    )

    id: Text | None = Field(None, description="Repeated in the answer.")


class SwitchOperatingMode(_Command):
    """A person switches the operating mode."""

    command: Literal["operatingMode"]
    mode: OperatingMode


class SwitchLocalization(_Command):
    """The robot loses its position, or finds it again."""

    command: Literal["localization"]
    localized: bool


class SwitchNavigation(_Command):
    """Navigation becomes unavailable, or available again."""

    command: Literal["navigation"]
    available: bool
    reason: Text = "switched off by simulation control"


class _Area(_Command):
    """A circle, m; without a centre, it covers everything."""

    x: Finite | None = None
    y: Finite | None = None
    radius: Positive = 0.5
    active: bool = True

    @model_validator(mode="after")
    def _both_coordinates(self) -> Self:
        if (self.x is None) is not (self.y is None):
            raise ValueError("specify both x and y, or neither")
        return self

    @property
    def circle(self) -> Circle:
        """Return the area as a circle, infinite without a centre."""
        if self.x is None or self.y is None:
            return Circle(0.0, 0.0, inf)
        return Circle(self.x, self.y, self.radius)


# 0012: a position, because the driver knows poses, not node IDs.
class MakeUnreachable(_Area):
    """Nodes in the area are unreachable; the robot notices this while it drives."""

    command: Literal["unreachable"]


class RemoveRoute(_Area):
    """No route leads to nodes in the area: the robot refuses such orders."""

    command: Literal["noRoute"]


class SwitchError(_Command):
    """An error is reported or withdrawn, identified by its type and references."""

    command: Literal["error"]
    error_type: Name
    error_level: ErrorLevel = ErrorLevel.WARNING
    error_description: Text | None = None
    error_hint: Text | None = None
    error_references: Annotated[dict[Name, Text], Field(max_length=20)] = Field(default_factory=dict)
    active: bool = True

    @property
    def entry(self) -> ErrorEntry:
        """Return the error as reported in the state."""
        references = tuple(
            ErrorReference(reference_key=key, reference_value=value)
            for key, value in self.error_references.items()
        )
        return ErrorEntry(
            error_type=self.error_type,
            error_level=self.error_level,
            error_description=self.error_description,
            error_hint=self.error_hint,
            error_references=references,
        )


class SwitchFieldViolation(_Command):
    """The protective field is violated, or clear again."""

    command: Literal["fieldViolation"]
    active: bool


class PressEmergencyStop(_Command):
    """An emergency stop is pressed; it is acknowledged at the robot (MANUAL) or remotely (REMOTE)."""

    command: Literal["emergencyStop"]
    # Not AUTOACK, which only 2.x has (state, safetyState).
    stop: Literal[EmergencyStop.MANUAL, EmergencyStop.REMOTE] = EmergencyStop.MANUAL


class AcknowledgeEmergencyStop(_Command):
    """The emergency stop is released and acknowledged."""

    command: Literal["acknowledgeEmergencyStop"]


class SwitchPauseButton(_Command):
    """The pause button is pressed, or released."""

    command: Literal["pauseButton"]
    pressed: bool


class SwitchCharging(_Command):
    """The charger is connected or disconnected."""

    command: Literal["charging"]
    charging: bool


class SetBattery(_Command):
    """The battery is set to a state of charge, in percent."""

    command: Literal["battery"]
    state_of_charge: Annotated[float, Field(ge=0, le=100)]


class MoveByHand(_Command):
    """The robot is moved to another pose (m, rad) by hand, by default on the same map; it stays localised."""

    command: Literal["pose"]
    x: Finite
    y: Finite
    theta: Finite = 0.0
    map_id: Name | None = None


class SetSpeed(_Command):
    """The robot drives at ``speed`` m/s, unless the order limits it further."""

    command: Literal["speed"]
    speed: Positive


class ReleaseTrigger(_Command):
    """A person at the robot releases the actions that wait for a trigger of this type."""

    command: Literal["trigger"]
    trigger_type: Name = "LOCAL"


class CutLink(_Command):
    """The connection to the broker breaks without a disconnect, for ``seconds``."""

    command: Literal["linkSilence"]
    seconds: Annotated[float, Field(gt=0, le=3600)]


AnyCommand = (
    SwitchOperatingMode
    | SwitchLocalization
    | SwitchNavigation
    | MakeUnreachable
    | RemoveRoute
    | SwitchError
    | SwitchFieldViolation
    | PressEmergencyStop
    | AcknowledgeEmergencyStop
    | SwitchPauseButton
    | SwitchCharging
    | SetBattery
    | MoveByHand
    | SetSpeed
    | ReleaseTrigger
    | CutLink
)

_parser: TypeAdapter[AnyCommand] = TypeAdapter(Annotated[AnyCommand, Field(discriminator="command")])


def parse_command(payload: bytes) -> AnyCommand:
    """Read a command from JSON; raises CommandRefusedError if the payload is not JSON, or not a command."""
    try:
        return _parser.validate_json(payload)
    except ValidationError as error:
        raise CommandRefusedError(*in_words(error.errors(), whole="command", most=FINDINGS_SHOWN)) from error


@dataclass(slots=True)
class _Robot:
    """A running robot; ``put`` sends events to its core."""

    driver: LoopbackDriver
    put: Callable[[Event], None]
    safety: SafetyReport


class SimulationControl:
    """Applies commands to one robot; a restart of the robot resets their effects.

    ``cut_link`` cuts the robot's connection to the broker for a number of seconds.
    """

    def __init__(self, cut_link: Callable[[float], None]) -> None:
        self._robot: _Robot | None = None
        self._cut_link = cut_link

    def use_driver(self, driver: LoopbackDriver, put: Callable[[Event], None]) -> None:
        """Control the robot of ``driver``; ``put`` sends events to its core."""
        self._robot = _Robot(driver, put, SafetyReport())

    def set_charging(self, charging: bool) -> None:  # noqa: FBT001 - called back with the one value
        """Start or stop charging, for an action of the robot."""
        if self._robot:
            self._robot.driver.set_charging(charging=charging)

    def apply_command(self, command: AnyCommand) -> None:  # noqa: C901, PLR0912 - a case for each command
        """Apply ``command``; raises CommandRefusedError if the command is not possible now."""
        robot = self._robot
        if robot is None or robot.driver.ended:
            raise CommandRefusedError("the robot is not running; send the command again later")
        match command:
            case CutLink(seconds=seconds):
                self._cut_link(seconds)
            case SwitchFieldViolation() | PressEmergencyStop() | AcknowledgeEmergencyStop():
                _change_safety(robot, command)
            case SwitchOperatingMode(mode=mode):
                robot.put(OperatingModeSwitched(mode))
            case SwitchError(active=active):
                robot.put(ErrorSwitched(command.entry, active))
            case SwitchPauseButton(pressed=pressed):
                robot.put(PauseButton(pressed))
            case ReleaseTrigger(trigger_type=trigger_type):
                robot.put(LocalTrigger(trigger_type))
            case SwitchLocalization(localized=localized):
                robot.driver.set_localized(localized=localized)
            case SwitchNavigation(available=available, reason=reason):
                robot.driver.set_navigation(available=available, reason="" if available else reason)
            case MakeUnreachable(active=active):
                robot.driver.set_unreachable(command.circle, active=active)
            case RemoveRoute(active=active):
                robot.driver.set_no_route(command.circle, active=active)
            case SwitchCharging(charging=charging):
                robot.driver.set_charging(charging=charging)
            case SetBattery(state_of_charge=charge):
                robot.driver.set_charge(charge)
            case MoveByHand():
                robot.driver.carry_to(command.x, command.y, command.theta, command.map_id)
            case SetSpeed(speed=speed):
                robot.driver.set_speed(speed)


def _change_safety(
    robot: _Robot, command: SwitchFieldViolation | PressEmergencyStop | AcknowledgeEmergencyStop
) -> None:
    """Change the safety state."""
    match command:
        case SwitchFieldViolation(active=active):
            robot.safety = replace(robot.safety, field_violation=active)
        case PressEmergencyStop(stop=stop):
            robot.safety = replace(robot.safety, emergency_stop=stop)
        case AcknowledgeEmergencyStop():
            robot.safety = replace(robot.safety, emergency_stop=EmergencyStop.NONE)
    # Before the core knows, as a safety circuit does.
    if not isinstance(command, AcknowledgeEmergencyStop):
        robot.driver.stop_at_once()
    robot.put(robot.safety)


log = get_logger(__name__)

MAXIMUM_PAYLOAD = 10_000
"""Maximum size of a command's payload, bytes."""


class ControlApi:
    """The MQTT API of simulation control for all robots of the program, on its own connection.

    Commands arrive under ``<interface name>/loopback/<manufacturer>/<serial number>/control``; answers are
    published under ``.../answer``. Commands for robots of other programs are ignored.
    """

    def __init__(
        self, settings: MqttSettings, interface_name: str, controls: Mapping[RobotKey, SimulationControl]
    ) -> None:
        self._controls = {
            f"{interface_name}/loopback/{robot}": control for robot, control in controls.items()
        }
        first = next(iter(controls))
        # 0012: a robot whose link is cut still gets commands, and has the session and will of a real one.
        self._link = MqttLink(
            settings.model_copy(update={"client_id": None}),  # the configured ID is the robot's
            client_id=f"nena-loopback-control-{first.manufacturer}-{first.serial_number}",
        )
        topic_filter = f"{interface_name}/loopback/{first.manufacturer}/+/control"
        self._link.subscribe(topic_filter, self._on_command)
        log.info("simulation control ready", topic=topic_filter)

    async def run(self) -> None:
        """Serve commands until cancelled."""
        await self._link.run()

    def _on_command(self, message: Inbound) -> None:
        place = message.topic.removesuffix("/control")
        control = self._controls.get(place)
        if control is None or not message.payload:
            return
        problems = _execute_message(control, message)
        log.info("control command", topic=message.topic, accepted=not problems, problems=problems)
        self._link.publish(Outbound(f"{place}/answer", _answer_of(message.payload, problems), keep=False))


def _execute_message(control: SimulationControl, message: Inbound) -> tuple[str, ...]:
    """Apply a command; return its problems if it is refused."""
    # It would apply again after each connect (0012).
    if message.retained:
        return ("retained commands are ignored because they may be old; send it without the retain flag",)
    if len(message.payload) > MAXIMUM_PAYLOAD:
        return (f"the command is longer than {MAXIMUM_PAYLOAD} bytes",)
    try:
        control.apply_command(parse_command(message.payload))
    except CommandRefusedError as refused:
        return refused.problems
    return ()


def _answer_of(payload: bytes, problems: tuple[str, ...]) -> bytes:
    """Return the answer, with the ID and name of the command if they are readable."""
    try:
        command = json.loads(payload[:MAXIMUM_PAYLOAD])
    except (ValueError, RecursionError):
        command = None
    answer: dict[str, Any] = {}
    if isinstance(command, dict):
        answer = {key: value for key in ("id", "command") if isinstance(value := command.get(key), str)}
    answer["accepted"] = not problems
    if problems:
        answer["problems"] = problems
    return json.dumps(answer).encode()
