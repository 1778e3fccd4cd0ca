"""What the core wants done by the shell around it."""

from __future__ import annotations

from dataclasses import dataclass

from nena_edge_agent.driver.port import DriveGoal, Pose
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.state import Load


@dataclass(frozen=True, slots=True)
class Drive:
    """Give the driver this goal."""

    goal: DriveGoal


@dataclass(frozen=True, slots=True)
class Halt:
    """Have the driver stop and drop its goal."""


@dataclass(frozen=True, slots=True)
class LimitSpeed:
    """Have the driver be no faster than ``speed`` m/s, whatever its goal allows; None: no limit."""

    speed: float | None


@dataclass(frozen=True, slots=True)
class SetPosition:
    """Tell the localisation where the robot is."""

    pose: Pose


@dataclass(frozen=True, slots=True)
class StartAction:
    """Have a plug-in begin ``action``; ``loads`` is what the robot carries now."""

    action: Action
    loads: tuple[Load, ...]


@dataclass(frozen=True, slots=True)
class PauseAction:
    """Have a plug-in hold an action."""

    action_id: str


@dataclass(frozen=True, slots=True)
class ResumeAction:
    """Have a plug-in go on with a held action."""

    action_id: str


@dataclass(frozen=True, slots=True)
class CancelAction:
    """Have a plug-in give up an action."""

    action_id: str


@dataclass(frozen=True, slots=True)
class SendFactsheet:
    """Publish the factsheet."""


@dataclass(frozen=True, slots=True)
class ReportState:
    """Publish a state, as soon as the minimum interval allows."""


Effect = (
    Drive
    | Halt
    | LimitSpeed
    | SetPosition
    | StartAction
    | PauseAction
    | ResumeAction
    | CancelAction
    | SendFactsheet
    | ReportState
)
