"""A clock that tests move."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta


@dataclass
class ManualClock:
    """A clock that only moves when it is set."""

    seconds: float = 0.0
    worked: float = 0.0
    start: datetime = field(default=datetime(2026, 1, 1, tzinfo=UTC))

    def monotonic(self) -> float:
        """Seconds that the clock has been moved."""
        return self.seconds

    def now(self) -> datetime:
        """Return the start plus what the clock has been moved."""
        return self.start + timedelta(seconds=self.seconds)

    def cpu(self) -> float:
        """Return ``worked``."""
        return self.worked

    def advance(self, seconds: float) -> None:
        """Move the clock on by ``seconds`` (not negative)."""
        if seconds < 0:
            message = "a clock cannot go back"
            raise ValueError(message)
        self.seconds += seconds
