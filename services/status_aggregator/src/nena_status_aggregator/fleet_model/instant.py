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
