"""A moment as the model is told it."""

from __future__ import annotations

from datetime import datetime
from typing import NamedTuple

from nena_shared.clock import Clock


class Instant(NamedTuple):
    """The same moment twice: seconds that never go back, for durations; UTC, for people."""

    monotonic: float
    utc: datetime

    @classmethod
    def of(cls, clock: Clock) -> Instant:
        """Read ``clock``."""
        return cls(clock.monotonic(), clock.now())


def iso(moment: datetime) -> str:
    """Write a UTC time as ISO 8601 with milliseconds, as the rest of the API does."""
    return f"{moment.isoformat(timespec='milliseconds')[:23]}Z"
