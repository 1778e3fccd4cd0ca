"""What happened to the recordings of a program, counted for its metrics."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Self


@dataclass(slots=True)
class RecordingCounts:
    """Counts since the start of the program, and how many files wait now."""

    outcomes: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("written", "not_written", "sent", "refused"), 0)
    )
    sent_bytes: int = 0
    """Size of the files that were sent."""
    waiting: int = 0
    """Number of files that wait for their transfer, with the one being sent."""

    @classmethod
    def total(cls, counts: Iterable[RecordingCounts]) -> Self:
        """Return the sums of the counts of several robots."""
        found = cls()
        for count in counts:
            for outcome, number in count.outcomes.items():
                found.outcomes[outcome] += number
            found.sent_bytes += count.sent_bytes
            found.waiting += count.waiting
        return found
