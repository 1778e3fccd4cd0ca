"""How far a robot's clock is off ours."""

from __future__ import annotations

from collections import deque
from datetime import datetime

SAMPLES = 8


class ClockSkew:
    """Compares timestamps of messages with the time of their arrival.

    A delay on the way can only make a robot's clock look slower, so the greatest of the last differences is
    the best estimate.
    """

    __slots__ = ("_differences",)

    def __init__(self) -> None:
        self._differences: deque[float] = deque(maxlen=SAMPLES)

    def measure(self, sent: datetime, arrived: datetime) -> None:
        """Take in one message."""
        self._differences.append((sent - arrived).total_seconds())

    @property
    def seconds(self) -> float | None:
        """Robot's clock minus ours, s; None before the first message."""
        return max(self._differences, default=None)
