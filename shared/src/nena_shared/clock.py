"""Clocks for durations and the time of day, and how times are read and written: UTC, milliseconds."""

from __future__ import annotations

import time
from collections import deque
from datetime import UTC, datetime
from typing import Protocol


class Clock(Protocol):
    """Source of time for cores and shells."""

    def monotonic(self) -> float:
        """Return seconds since an arbitrary fixed time; never goes back."""
        ...

    def now(self) -> datetime:
        """Return the time of day, in UTC."""
        ...


class SystemClock:
    """The machine's clock."""

    def monotonic(self) -> float:
        """Return seconds since an arbitrary fixed time; never goes back."""
        return time.monotonic()

    def now(self) -> datetime:
        """Return the time of day, in UTC."""
        return datetime.now(UTC)


def in_utc(value: datetime) -> datetime:
    """Return the same time in UTC; a time without a zone is assumed to be UTC.

    Raises:
        ValueError: in UTC the time would be before the year 1 or after the year 9999.
    """
    try:
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)
    except OverflowError as error:
        message = "the time lies outside the years 1 to 9999 in UTC"
        raise ValueError(message) from error


def iso(moment: datetime) -> str:
    """Return a UTC time as ISO 8601 with milliseconds and a four-digit year."""
    return f"{moment.isoformat(timespec='milliseconds')[:23]}Z"


SAMPLES = 8


class ClockSkew:
    """Estimates the deviation of another program's clock from the timestamps of its messages.

    Latency only makes the other clock look slow, so the greatest of the last differences is the best
    estimate.
    """

    __slots__ = ("_differences",)

    def __init__(self) -> None:
        self._differences: deque[float] = deque(maxlen=SAMPLES)

    def measure(self, sent: datetime, arrived: datetime) -> None:
        """Add a message."""
        self._differences.append((sent - arrived).total_seconds())

    @property
    def seconds(self) -> float | None:
        """The other clock minus this computer's, s; None before the first message."""
        return max(self._differences, default=None)
