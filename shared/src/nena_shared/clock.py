"""Time, handed to whoever needs it: monotonic for durations, UTC for what people and the wire see."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Protocol


class Clock(Protocol):
    """What a core or a shell knows of time."""

    def monotonic(self) -> float:
        """Seconds since some fixed moment; never goes back."""
        ...

    def now(self) -> datetime:
        """Give the time of day, in UTC."""
        ...


class SystemClock:
    """The machine's clock."""

    def monotonic(self) -> float:
        """Seconds since some fixed moment; never goes back."""
        return time.monotonic()

    def now(self) -> datetime:
        """Give the time of day, in UTC."""
        return datetime.now(UTC)


@dataclass
class ManualClock:
    """A clock that stands still until it is moved: for tests, replay and simulation."""

    seconds: float = 0.0
    start: datetime = field(default=datetime(2026, 1, 1, tzinfo=UTC))

    def monotonic(self) -> float:
        """Seconds that the clock has been moved."""
        return self.seconds

    def now(self) -> datetime:
        """Give the start plus what the clock has been moved."""
        return self.start + timedelta(seconds=self.seconds)

    def advance(self, seconds: float) -> None:
        """Move the clock on by ``seconds`` (not negative)."""
        if seconds < 0:
            message = "a clock does not go back"
            raise ValueError(message)
        self.seconds += seconds
