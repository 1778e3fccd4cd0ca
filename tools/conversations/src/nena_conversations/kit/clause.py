"""Clauses of the standard that a robot is tested against, and their verdicts."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from nena_conversations.rules import Sections

if TYPE_CHECKING:
    from nena_conversations.kit.session import RobotSession


class Strength(StrEnum):
    """How strictly the standard words a clause."""

    MUST = "must"
    SHOULD = "should"


class Outcome(StrEnum):
    """Verdict on a clause."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_APPLICABLE = "not applicable"


class ClauseFailedError(Exception):
    """The robot violates the clause: what was expected, and what it did."""


class NotApplicableError(Exception):
    """The clause cannot be tested with this robot, for the reason in the message."""


@dataclass(frozen=True, slots=True)
class Clause:
    """A clause that is tested by doing something."""

    id: str
    title: str
    sections: Sections
    run: Callable[[RobotSession], Awaitable[None]]
    strength: Strength = Strength.MUST
    moves: bool = False
    """Whether the robot drives."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a clause."""

    id: str
    title: str
    section: str
    strength: Strength
    outcome: Outcome
    reason: str = ""
    """Why it failed or is not applicable."""
    messages: tuple[str, ...] = ()
    """The messages that show it, as ``topic payload``, the last ones."""
    seconds: float = 0.0

    @property
    def violated(self) -> bool:
        """Return whether the robot violates what it must keep."""
        return self.outcome is Outcome.FAILED and self.strength is Strength.MUST
