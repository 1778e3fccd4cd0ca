"""Detects drift in the measurements of a long run: steady growth, not just variation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import mean, median

from faults.footprint import Footprint

MORE_MB, MORE_OF_MB = 10.0, 0.08
"""What a program may have grown by between the first third and the last one: so many MB and this share."""
MORE_DESCRIPTORS, MORE_THREADS = 6.0, 3.0
SLOWER, SLOWER_S = 2.0, 0.05
"""By how much the median of the latency may have become worse: this factor, and so many seconds."""
LEAST_WINDOWS = 3
WARM_UP_ORDERS = 1000
"""The order service keeps so many orders that have ended in memory: until then it grows, and then no more."""


@dataclass(frozen=True, slots=True)
class Window:
    """A few minutes of the run."""

    answers: Sequence[float]
    """Seconds until each order was answered."""
    orders: Sequence[float]
    """Seconds from the creation of each order that ended until its end."""
    footprints: Mapping[str, Footprint]
    """At its end, by program."""
    yardstick: Sequence[float] = ()
    """Seconds that the same computation took each time: they show how much else the machine had to do."""


def drift(windows: Sequence[Window]) -> list[str]:
    """Return what has drifted, a sentence each; empty if nothing has.

    The windows in which programs and caches warm up are left out: the first one, and if the run is long
    enough, those until the order service has as many ended orders as it keeps.
    """
    settled = windows[_warming_up(windows) :]
    third = len(settled) // 3
    if third == 0:
        message = f"at least {1 + LEAST_WINDOWS} windows are needed, there are {len(windows)}"
        raise ValueError(message)
    first, last = settled[:third], settled[-third:]
    return [*_grown(first, last), *_slower(first, last)]


def _warming_up(windows: Sequence[Window]) -> int:
    """Return the number of warm-up windows."""
    ended = 0
    for count, window in enumerate(windows[:-LEAST_WINDOWS], 1):
        ended += len(window.orders)
        if ended >= WARM_UP_ORDERS:
            return count
    return 1


def _grown(first: Sequence[Window], last: Sequence[Window]) -> list[str]:
    found = []
    for name in first[0].footprints:
        before, after = ([window.footprints[name] for window in part] for part in (first, last))
        for measure, room in (
            ("megabytes", MORE_MB + MORE_OF_MB * before[0].megabytes),
            ("descriptors", MORE_DESCRIPTORS),
            ("threads", MORE_THREADS),
        ):
            was, now = (mean(getattr(each, measure) for each in part) for part in (before, after))
            if now > was + room:
                found.append(f"{name}: {now:.1f} {measure} in the last third, {was:.1f} in the first")
    return found


def _slower(first: Sequence[Window], last: Sequence[Window]) -> list[str]:
    found = []
    busier = _busier(first, last)
    for measure in ("answers", "orders"):
        was, now = (
            median(value for window in part for value in getattr(window, measure)) for part in (first, last)
        )
        if now > busier * (SLOWER * was + SLOWER_S):
            found.append(
                f"{measure}: {now:.3f} s in the last third, {was:.3f} s in the first "
                f"(the machine was {busier:.1f} times as busy)"
            )
    return found


def _busier(first: Sequence[Window], last: Sequence[Window]) -> float:
    """Return how much longer the same computation took in the last third, at least 1."""
    was, now = ([value for window in part for value in window.yardstick] for part in (first, last))
    return max(1.0, median(now) / median(was)) if was and now else 1.0
