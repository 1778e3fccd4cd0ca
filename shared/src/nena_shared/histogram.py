"""Histogram of durations, counted as they occur and read by each scrape."""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Sequence
from contextlib import AbstractContextManager
from math import inf

SHORT = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5)
"""Upper bounds of buckets for the program's own work, seconds."""

ANSWERS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Upper bounds of buckets for responses of robots and brokers, seconds."""

LONG = (1.0, 5.0, 10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 1800.0, 3600.0, 7200.0, 14400.0)
"""Upper bounds of buckets for actions and orders of robots, seconds."""


class Histogram:
    """Counts durations by bucket."""

    __slots__ = ("bounds", "counts", "total")

    def __init__(self, bounds: Sequence[float]) -> None:
        """Create an empty histogram; ``bounds``: upper bounds of the buckets, s. An infinite one is added."""
        self.bounds = bounds
        self.counts = [0] * (len(bounds) + 1)
        self.total = 0.0

    def observe(self, seconds: float) -> None:
        """Count a duration."""
        # left: a bucket includes its upper bound (Prometheus: le)
        self.counts[bisect_left(self.bounds, seconds)] += 1
        self.total += seconds

    def timed(self) -> AbstractContextManager[None]:
        """Measure the duration of the block."""
        return _Timed(self)

    def buckets(self) -> list[tuple[str, float]]:
        """Return the cumulative buckets as in Prometheus's text format."""
        running, found = 0, []
        for bound, count in zip((*self.bounds, inf), self.counts, strict=True):
            running += count
            found.append(("+Inf" if bound == inf else str(bound), float(running)))
        return found


class _Timed:
    """Measures the duration of a block; frequent ones, so it is no generator."""

    __slots__ = ("_begun", "_histogram")

    def __init__(self, histogram: Histogram) -> None:
        self._histogram = histogram

    def __enter__(self) -> None:
        self._begun = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self._histogram.observe(time.perf_counter() - self._begun)
