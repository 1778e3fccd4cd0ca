"""Rate limits of clients and of robots."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Final

from nena_shared.log import get_logger

log = get_logger(__name__)

KEPT = 10_000
"""Maximum stored clients; beyond it, the one idle for longest is removed."""


@dataclass(slots=True)
class _Bucket:
    level: float
    at: float


class RateLimit:
    """Allows each client ``rate`` requests per second, with bursts of ``burst`` requests."""

    def __init__(self, rate: float, burst: int) -> None:
        self._rate = rate
        self._burst = burst
        self._buckets: OrderedDict[str, _Bucket] = OrderedDict()

    def wait(self, asker: str, now: float, *, cost: float = 1.0) -> float:
        """Count a request; return the seconds that the client has to wait, 0 if it may continue.

        Rejected requests cost nothing; a ``cost`` of 0 only checks. ``now``: monotonic clock, s.
        """
        bucket = self._buckets.setdefault(asker, _Bucket(self._burst, now))
        self._buckets.move_to_end(asker)
        if len(self._buckets) > KEPT:
            self._buckets.popitem(last=False)
        bucket.level = min(self._burst, bucket.level + (now - bucket.at) * self._rate)
        bucket.at = now
        if bucket.level < 1.0:
            return (1.0 - bucket.level) / self._rate
        bucket.level -= cost
        return 0.0


BYTES_PER_MESSAGE: Final = 10_000
"""A longer message counts as several."""


class MessageRate:
    """Limits the messages on each topic, so that a faulty robot cannot occupy a program.

    A program drops messages beyond the limit before it reads them. The next message makes up for a dropped
    state, because each state is complete; a dropped connection message or factsheet stays unknown until the
    robot sends another.
    """

    def __init__(self, rate: float, burst: int) -> None:
        self._limit = RateLimit(rate, burst)
        self._logged = RateLimit(rate=1 / 60, burst=1)

    def exceeded(self, topic: str, size: int, now: float) -> bool:
        """Count a message of ``size`` bytes; return whether to drop it. ``now``: monotonic clock, s."""
        if not self._limit.wait(topic, now, cost=max(1.0, size / BYTES_PER_MESSAGE)):
            return False
        if not self._logged.wait(topic, now):
            log.warning("dropping messages: a robot sends too many or too long ones", topic=topic)
        return True
