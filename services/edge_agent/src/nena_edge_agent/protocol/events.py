"""Inputs and outputs of the protocol core: events and effects."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from nena_edge_agent.driver.port import Area, DriveGoal, DriverEvent, Pose
from nena_edge_agent.protocol.errors import Until
from nena_shared.vda5050.action import Action, ActionStatus, InstantActions
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.state import EmergencyStop, Load, Map, OperatingMode
from nena_shared.vda5050.zone_set import ZoneSet, ZoneSetTransfer


@dataclass(frozen=True, slots=True)
class Started:
    """The agent has started: continue with the journal's content. ``utc`` is the time of day, if known."""

    utc: datetime | None = None


@dataclass(frozen=True, slots=True)
class OrderReceived:
    """A well-formed order or order update for this robot (section 7.3), received at ``utc``, if known.

    ``dated``: its timestamp is readable.
    """

    order: Order
    utc: datetime | None = None
    dated: bool = True


@dataclass(frozen=True, slots=True)
class InstantActionsReceived:
    """Well-formed instant actions for this robot (section 6.2.1), received at ``utc``, if known."""

    message: InstantActions
    utc: datetime | None = None


@dataclass(frozen=True, slots=True)
class ZoneSetReceived:
    """A well-formed zone set for this robot (section 6.4.1)."""

    message: ZoneSetTransfer


@dataclass(frozen=True, slots=True)
class ResponsesReceived:
    """Well-formed responses to the robot's requests (section 6.9), received at ``utc``."""

    message: Responses
    utc: datetime


@dataclass(frozen=True, slots=True)
class MapsReport:
    """All maps on the robot (section 6.3)."""

    maps: tuple[Map, ...]


@dataclass(frozen=True, slots=True)
class MessageRefused:
    """A message that is malformed or names another robot; ``until`` ends ``error`` in the state."""

    error: ErrorEntry
    until: Until = Until.ORDER_ACCEPTED


@dataclass(frozen=True, slots=True)
class ActionReport:
    """A plug-in's report about one of its actions (section 6.6.9).

    ``loads``, ``charging`` and ``maps`` are the robot's new values; None: unchanged. ``zone_set`` is a zone
    set that the action has downloaded. The state reports ``error`` until the next instant action.
    """

    action_id: str
    status: ActionStatus
    result: str | None = None
    loads: tuple[Load, ...] | None = None
    charging: bool | None = None
    maps: tuple[Map, ...] | None = None
    zone_set: ZoneSet | None = None
    error: ErrorEntry | None = None


@dataclass(frozen=True, slots=True)
class OperatingModeSwitched:
    """A person has switched the robot to ``mode`` (section 6.6.6); the state may report it later."""

    mode: OperatingMode


@dataclass(frozen=True, slots=True)
class SafetyReport:
    """The emergency stop and the protective field (section 7.8); the robot stops while either is active."""

    emergency_stop: EmergencyStop = EmergencyStop.NONE
    field_violation: bool = False


@dataclass(frozen=True, slots=True)
class PauseButton:
    """The robot's pause button was pressed or released (section 7.8); fleet control's pause is separate."""

    pressed: bool


@dataclass(frozen=True, slots=True)
class ErrorSwitched:
    """A person or a device reports an error (section 6.6.5.1), or withdraws it (``active`` False).

    The robot stops while a CRITICAL or FATAL error is active, and accepts no orders while a FATAL one is.
    Type and references identify the error.
    """

    error: ErrorEntry
    active: bool


@dataclass(frozen=True, slots=True)
class LocalTrigger:
    """A person at the robot has released the actions that wait for a trigger of this type (section 6.2.3)."""

    trigger_type: str = "LOCAL"


@dataclass(frozen=True, slots=True)
class LoadSensed:
    """Whether the robot is loaded, by its sensor (section 7.8)."""

    loaded: bool


@dataclass(frozen=True, slots=True)
class PluginsReport:
    """Problems of installed action plug-ins that cannot be used, one sentence each."""

    problems: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class JournalReport:
    """Whether the disk has the last record; ``problem`` is empty if it has."""

    problem: str


@dataclass(frozen=True, slots=True)
class SubscriptionsReport:
    """Topics to which the broker refuses subscriptions."""

    refused: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class LinkReport:
    """Whether the robot is connected to the broker (section 4.1); False until the first report."""

    connected: bool


@dataclass(frozen=True, slots=True)
class TimePassed:
    """Time has passed: a timeout may have expired.

    ``utc`` is the time of day, if known: the monotonic clock stops while a computer is suspended.
    """

    utc: datetime | None = None


class PowerCommand(StrEnum):
    """A configured command that hibernates, wakes or shuts down the robot; the value is its setting."""

    HIBERNATE = "hibernate_command"
    WAKE = "wake_command"
    SHUT_DOWN = "shutdown_command"


@dataclass(frozen=True, slots=True)
class SignedOff:
    """The last state before hibernation or shutdown was sent (section 6.2.3)."""


@dataclass(frozen=True, slots=True)
class PowerReport:
    """A power command has ended; ``problem`` is empty if it has succeeded."""

    command: PowerCommand
    problem: str = ""


Event = (
    Started
    | OrderReceived
    | InstantActionsReceived
    | ZoneSetReceived
    | ResponsesReceived
    | MapsReport
    | MessageRefused
    | ActionReport
    | OperatingModeSwitched
    | SafetyReport
    | PauseButton
    | ErrorSwitched
    | LocalTrigger
    | LoadSensed
    | PluginsReport
    | JournalReport
    | SubscriptionsReport
    | LinkReport
    | TimePassed
    | SignedOff
    | PowerReport
    | DriverEvent
)


@dataclass(frozen=True, slots=True)
class Drive:
    """Send this goal to the driver."""

    goal: DriveGoal


@dataclass(frozen=True, slots=True)
class Halt:
    """Stop the driver and drop its goal."""


@dataclass(frozen=True, slots=True)
class LimitSpeed:
    """Limit the speed to ``speed`` m/s for all goals; None: no limit."""

    speed: float | None


@dataclass(frozen=True, slots=True)
class KeepOut:
    """Make navigation plan around these areas, and no others."""

    areas: tuple[Area, ...]


@dataclass(frozen=True, slots=True)
class SetPosition:
    """Set the robot's pose in the localisation."""

    pose: Pose


@dataclass(frozen=True, slots=True)
class StartAction:
    """Start ``action`` in its plug-in; ``loads`` is what the robot carries now."""

    action: Action
    loads: tuple[Load, ...]


@dataclass(frozen=True, slots=True)
class PauseAction:
    """Pause an action in its plug-in."""

    action_id: str


@dataclass(frozen=True, slots=True)
class ResumeAction:
    """Resume a paused action in its plug-in."""

    action_id: str


@dataclass(frozen=True, slots=True)
class CancelAction:
    """Cancel an action in its plug-in."""

    action_id: str


@dataclass(frozen=True, slots=True)
class SendFactsheet:
    """Publish the factsheet (section 6.10)."""


@dataclass(frozen=True, slots=True)
class Hibernate:
    """Report the connection state HIBERNATING (section 6.5), and run the hibernate command."""

    wake_up_at: datetime | None


@dataclass(frozen=True, slots=True)
class Wake:
    """Run the wake command."""


@dataclass(frozen=True, slots=True)
class GoOnline:
    """Report the connection state ONLINE (section 6.5); states follow."""


@dataclass(frozen=True, slots=True)
class ShutDown:
    """Disconnect, and run the shutdown command."""


@dataclass(frozen=True, slots=True)
class LogIgnored:
    """Log a message of fleet control that the robot ignores while it hibernates or shuts down."""

    message: str


@dataclass(frozen=True, slots=True)
class ReportState:
    """Publish a state as soon as the minimum interval allows (section 6.6.1)."""


Effect = (
    Drive
    | Halt
    | LimitSpeed
    | KeepOut
    | SetPosition
    | StartAction
    | PauseAction
    | ResumeAction
    | CancelAction
    | SendFactsheet
    | Hibernate
    | Wake
    | GoOnline
    | ShutDown
    | LogIgnored
    | ReportState
)
