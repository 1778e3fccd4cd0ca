"""How often somebody may ask: a bucket of tokens for each, which fills again with time."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

KEPT = 10_000
"""Askers that are remembered; above that the one that has been quiet for longest is forgotten."""


@dataclass(slots=True)
class _Bucket:
    level: float
    at: float


class RateLimit:
    """Allows ``burst`` requests at once and ``rate`` per second in the long run, to each asker."""

    def __init__(self, rate: float, burst: int) -> None:
        self._rate = rate
        self._burst = burst
        self._buckets: OrderedDict[str, _Bucket] = OrderedDict()

    def wait(self, asker: str, now: float, *, cost: float = 1.0) -> float:
        """Count a request; gives the seconds that the asker has to wait, 0 where it may go on.

        A refused request costs nothing, a ``cost`` of 0 only looks. ``now``: seconds of a monotonic clock.
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
