"""Clocks, and conversion of times: UTC, milliseconds."""

from __future__ import annotations

import time
from collections import deque
from datetime import UTC, datetime, timedelta
from functools import lru_cache, partial
from typing import Protocol


class Clock(Protocol):
    """Source of time."""

    def monotonic(self) -> float:
        """Return seconds since an arbitrary fixed time; never goes back."""
        ...

    def now(self) -> datetime:
        """Return the time of day, in UTC."""
        ...

    def cpu(self) -> float:
        """Return the seconds that this thread has worked, without those in which others had the core."""
        ...


class SystemClock:
    """The system clock."""

    monotonic = staticmethod(time.monotonic)
    now = staticmethod(partial(datetime.now, UTC))
    cpu = staticmethod(time.thread_time)


def in_utc(value: datetime) -> datetime:
    """Convert a time to UTC; a time without a zone is assumed to be UTC.

    Raises:
        ValueError: the result is outside the years 1 to 9999.
    """
    try:
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)
    except OverflowError as error:
        raise ValueError("the time lies outside the years 1 to 9999 in UTC") from error


@lru_cache(maxsize=4096)
def iso(moment: datetime) -> str:
    """Return a UTC time as ISO 8601 with milliseconds and a four-digit year; a time of another zone is wrong.

    The times of an order are written many times: in each of its statuses, and in the store.
    """
    # not strftime: on Linux, it writes years before 1000 with fewer digits
    return f"{moment.isoformat(timespec='milliseconds')[:23]}Z"


SAMPLES = 8
RECENT = timedelta(minutes=1)
"""Age before the latest message up to which differences count: a clock may have been set right since."""


class ClockSkew:
    """Estimates the deviation of another program's clock from the timestamps of its messages.

    Latency can only make the other clock look slow, so the largest recent difference is the best estimate.
    """

    __slots__ = ("_arrivals",)

    def __init__(self) -> None:
        self._arrivals: deque[tuple[datetime, float]] = deque(maxlen=SAMPLES)
        """Times of arrival, and differences in seconds."""

    def measure(self, sent: datetime, arrived: datetime) -> None:
        """Add the timestamp of a message and its time of arrival."""
        # abs: this computer's clock may have been set back
        while self._arrivals and abs(arrived - self._arrivals[0][0]) > RECENT:
            self._arrivals.popleft()
        self._arrivals.append((arrived, (sent - arrived).total_seconds()))

    @property
    def seconds(self) -> float | None:
        """Other clock minus this computer's clock, s; None before the first message."""
        return max((difference for _, difference in self._arrivals), default=None)
