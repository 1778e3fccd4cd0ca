"""Clauses of the standard that robots and fleet controls are tested against, and their verdicts."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, TypeVar

from nena_conversations.rules import Sections, both_versions

S = TypeVar("S")
"""The conversation in which a clause is tried."""
Run = Callable[[S], Awaitable[None]]


class Strength(StrEnum):
    """How strictly the standard words a clause."""

    MUST = "must"
    SHOULD = "should"
    MAY = "may"


class Outcome(StrEnum):
    """Verdict on a clause."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_APPLICABLE = "not applicable"


class ClauseFailedError(Exception):
    """The tested side violates the clause: what was expected, and what it did."""


class NotApplicableError(Exception):
    """The clause cannot be tested here, for the reason in the message."""


@dataclass(frozen=True, slots=True)
class Clause(Generic[S]):
    """A clause that is tested by doing something."""

    id: str
    title: str
    sections: Sections
    run: Run[S]
    strength: Strength = Strength.MUST
    moves: bool = False
    """Whether a robot under test drives."""


class Clauses(list[Clause[S]]):
    """The clauses for one side, in the order in which they are tried."""

    def add(
        self,
        id_: str,
        title: str,
        sections: tuple[str | None, str],
        strength: Strength = Strength.MUST,
        *,
        moves: bool = False,
    ) -> Callable[[Run[S]], Run[S]]:
        """Return a decorator that adds a clause with its sections in 2.x and 3.x."""

        def register(run: Run[S]) -> Run[S]:
            self.append(Clause(id_, title, both_versions(*sections), run, strength, moves))
            return run

        return register


def require(holds: object, message: str) -> None:
    """Raise ClauseFailedError unless something holds."""
    if not holds:
        raise ClauseFailedError(message)


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
    drives: bool = False
    """Whether the robot under test has to drive for it."""

    @property
    def violated(self) -> bool:
        """Return whether the tested side violates what it must keep."""
        return self.outcome is Outcome.FAILED and self.strength is Strength.MUST

    @property
    def words(self) -> str:
        """The outcome, which tells what should be done from what must be."""
        advised = self.outcome is Outcome.FAILED and not self.violated
        return f"{self.outcome.value} ({self.strength.value})" if advised else self.outcome.value
