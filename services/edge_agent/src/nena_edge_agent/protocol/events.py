"""What happens to a robot: messages from fleet control, reports of its driver and of its actions."""

from __future__ import annotations

from dataclasses import dataclass

from nena_edge_agent.driver.port import DriverEvent
from nena_shared.vda5050.action import ActionStatus, InstantActions
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import Load


@dataclass(frozen=True, slots=True)
class Started:
    """The driver works: go on with what the journal held."""


@dataclass(frozen=True, slots=True)
class OrderReceived:
    """A well-formed order or order update for this robot."""

    order: Order


@dataclass(frozen=True, slots=True)
class InstantActionsReceived:
    """Well-formed instant actions for this robot."""

    message: InstantActions


@dataclass(frozen=True, slots=True)
class MessageRefused:
    """A message that could not be read, or was not meant for this robot; ``error`` says so in the state."""

    error: ErrorEntry


@dataclass(frozen=True, slots=True)
class ActionReport:
    """What an action plug-in tells of an action that it was given.

    ``loads`` and ``charging`` say what the robot carries, and whether it charges, from now on; None: as
    before.
    """

    action_id: str
    status: ActionStatus
    result: str | None = None
    loads: tuple[Load, ...] | None = None
    charging: bool | None = None


@dataclass(frozen=True, slots=True)
class JournalReport:
    """Whether the last record went to disk; ``problem`` is empty when it did."""

    problem: str


@dataclass(frozen=True, slots=True)
class TimePassed:
    """Nothing but time: what waits for an answer may be overdue."""


Event = (
    Started
    | OrderReceived
    | InstantActionsReceived
    | MessageRefused
    | ActionReport
    | JournalReport
    | TimePassed
    | DriverEvent
)
