"""The test bench of one loopback robot: does to it what people and the world would do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from nena_edge_agent.loopback.commands import (
    AcknowledgeEmergencyStop,
    AnyCommand,
    CarryAway,
    CommandRefusedError,
    LoseLink,
    MakeUnreachable,
    PressEmergencyStop,
    PullTrigger,
    SetBattery,
    SetSpeed,
    SwitchCharging,
    SwitchError,
    SwitchFieldViolation,
    SwitchLocalization,
    SwitchNavigation,
    SwitchOperatingMode,
    SwitchPauseButton,
    TakeRoute,
)
from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_edge_agent.protocol.events import (
    ErrorSwitched,
    Event,
    LocalTrigger,
    OperatingModeSwitched,
    PauseButton,
    SafetyReport,
)
from nena_shared.vda5050.state import EmergencyStop


@dataclass(slots=True)
class _Robot:
    """What the bench has of a robot that runs."""

    driver: LoopbackDriver
    put: Callable[[Event], None]
    safety: SafetyReport


class Bench:
    """One robot's; what was done to the world around it is forgotten when the robot is started anew.

    ``cut_link`` breaks the robot's link to the broker for a number of seconds.
    """

    def __init__(self) -> None:
        self._robot: _Robot | None = None
        self.cut_link: Callable[[float], None] | None = None

    def attach(self, driver: LoopbackDriver, put: Callable[[Event], None]) -> None:
        """Work on the robot that ``driver`` drives; its core is told by ``put``."""
        self._robot = _Robot(driver, put, SafetyReport())

    def set_charging(self, charging: bool) -> None:  # noqa: FBT001 - called back with the one value
        """Begin or end charging, as an action of the robot does."""
        if self._robot:
            self._robot.driver.set_charging(charging=charging)

    def apply(self, command: AnyCommand) -> None:
        """Obey ``command``.

        Raises:
            CommandRefusedError: it makes no sense now.

        """
        robot = self._robot
        if robot is None or robot.driver.ended:
            message = "the robot does not run now; send the command again"
            raise CommandRefusedError(message)
        match command:
            case LoseLink(seconds=seconds) if self.cut_link:
                self.cut_link(seconds)
            case SwitchFieldViolation() | PressEmergencyStop() | AcknowledgeEmergencyStop():
                _make_safe(robot, command)
            case SwitchOperatingMode() | SwitchError() | SwitchPauseButton() | PullTrigger():
                robot.put(_event(command))
            case _:
                _drive(robot.driver, command)


def _make_safe(
    robot: _Robot, command: SwitchFieldViolation | PressEmergencyStop | AcknowledgeEmergencyStop
) -> None:
    """Stop the robot before its core hears of it, as safety circuits do."""
    match command:
        case SwitchFieldViolation(active=active):
            robot.safety = replace(robot.safety, field_violation=active)
        case PressEmergencyStop(stop=stop):
            robot.safety = replace(robot.safety, emergency_stop=stop)
        case AcknowledgeEmergencyStop():
            robot.safety = replace(robot.safety, emergency_stop=EmergencyStop.NONE)
    if not isinstance(command, AcknowledgeEmergencyStop):
        robot.driver.stop_at_once()
    robot.put(robot.safety)


def _event(command: SwitchOperatingMode | SwitchError | SwitchPauseButton | PullTrigger) -> Event:
    match command:
        case SwitchOperatingMode(mode=mode):
            return OperatingModeSwitched(mode)
        case SwitchError(active=active):
            return ErrorSwitched(command.entry, active)
        case SwitchPauseButton(pressed=pressed):
            return PauseButton(pressed)
        case PullTrigger(trigger_type=trigger_type):
            return LocalTrigger(trigger_type)


def _drive(driver: LoopbackDriver, command: AnyCommand) -> None:
    match command:
        case SwitchLocalization(localized=localized):
            driver.set_localized(localized=localized)
        case SwitchNavigation(available=available, reason=reason):
            driver.set_navigation(available=available, reason="" if available else reason)
        case MakeUnreachable(active=active):
            driver.set_unreachable(command.circle, active=active)
        case TakeRoute(active=active):
            driver.set_no_route(command.circle, active=active)
        case SwitchCharging(charging=charging):
            driver.set_charging(charging=charging)
        case SetBattery(state_of_charge=charge):
            driver.set_charge(charge)
        case CarryAway():
            driver.carry_to(command.x, command.y, command.theta, command.map_id)
        case SetSpeed(speed=speed):
            driver.set_speed(speed)
