"""Measures how long the order service plans, and how long it holds its event loop.

The real programs under accelerated time, as ``nena simulate`` runs them: 50 robots on 300 points and 200 on
2,500. After the first half a path in the middle is locked, after which all routes are searched again, and
unlocked a quarter later. Times are CPU times of the thread, because the machine may be shared; a hold is one
unit of work with its planning, or the effects of one commit. The step that locks a path is one hold, as in
the service (``PathLocks``): it ends with the first vehicles that are led around the path.

``PYTHONPATH=tests PYTHONHASHSEED=0 python -m bench.traffic_planning --robots 200 --minutes 2``
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from statistics import quantiles
from typing import Any

from bench.traffic import Extent, case_of
from bench.traffic_halls import HALLS, Hall, grid_point, large_hall
from nena_order_service.__main__ import GC_THRESHOLDS
from nena_order_service.engine.engine import Timings
from nena_order_service.engine.unit_of_work import UnitOfWork
from nena_shared import log
from nena_shared.histogram import SHORT, Histogram
from nena_shared.settings import LogSettings
from nena_simulate.site import Case, Site
from nena_simulate.virtual_time import VirtualClock, run
from support.pausing import time_passes

LARGE = 100
"""Robots from which the large hall is used."""


class Collections:
    """The pauses of the garbage collector, which are counted apart: its heap has all robots here, too."""

    def __init__(self) -> None:
        self.kept: list[float] = []
        self.total = 0.0
        self._begun = 0.0

    def __call__(self, phase: str, _: dict[str, int]) -> None:
        """Note the start or the end of a collection."""
        if phase == "start":
            self._begun = time.thread_time()
            return
        self.kept.append(time.thread_time() - self._begun)
        self.total += self.kept[-1]


COLLECTIONS = Collections()


class Exact(Histogram):
    """Keeps each duration, as CPU time without that of the garbage collector."""

    __slots__ = ("kept",)

    def __init__(self) -> None:
        super().__init__(SHORT)
        self.kept: list[float] = []

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Measure the CPU time of the block."""
        begun = time.thread_time() - COLLECTIONS.total
        try:
            yield
        finally:
            self.kept.append(time.thread_time() - COLLECTIONS.total - begun)


@dataclass
class Watched:
    """What was measured, in CPU seconds."""

    traffic: Exact = field(default_factory=Exact)
    dispatch: Exact = field(default_factory=Exact)
    holds: Exact = field(default_factory=Exact)
    after_lock: Exact = field(default_factory=Exact)
    """The holds in the second after the path was locked or unlocked."""
    locked: bool = False
    under_way: int = 0

    def hold(self) -> Exact:
        """Return where the next hold belongs."""
        return self.after_lock if self.locked else self.holds


async def _watched(case: Case, clock: VirtualClock, path: str) -> Watched:
    watched, site = Watched(), Site(case, clock)
    engine = site.engine
    engine.prepare()  # as the service does before it serves
    engine.timings = Timings(watched.dispatch, watched.traffic)
    _watch_units(engine.unit_of_work, watched)

    async def lock() -> None:
        seconds = case.warm_up + case.hours * 3600
        await time_passes(seconds / 2)
        for locked in (True, False):
            watched.under_way = len(engine.traffic.waiting)
            watched.locked = True
            with watched.after_lock.timed():  # all of it, with the work between its units
                engine.context.finder.set_locks({path: locked})
                engine.traffic.resources.set_locks({path: locked})
                engine.plant_changed()
            await time_passes(1)
            watched.locked = False
            await time_passes(seconds / 4 - 1)

    await site.run(case.warm_up + case.hours * 3600, lock)
    return watched


def _watch_units(units: UnitOfWork, watched: Watched) -> None:
    begin: Callable[[], Any] = units.begin
    committed: Callable[..., None] = units._committed

    @contextmanager
    def timed_begin() -> Iterator[None]:
        with watched.hold().timed(), begin():
            yield

    def timed_committed(*arguments: object) -> None:
        with watched.hold().timed():
            committed(*arguments)

    units.begin = timed_begin  # type: ignore[method-assign]
    units._committed = timed_committed  # type: ignore[method-assign, assignment]


def _figures(durations: list[float]) -> str:
    cuts = quantiles(durations, n=100, method="inclusive")
    p50, p99 = (f"{1000 * cuts[index]:.2f}" for index in (49, 98))
    return f"p50 {p50}, p99 {p99}, longest {1000 * max(durations):.1f} ms, of {len(durations)}"


def main() -> None:
    """Measure one fleet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=50)
    parser.add_argument("--minutes", type=float, default=2.0)
    arguments = parser.parse_args()
    log.configure(LogSettings(level="error"))
    gc.set_threshold(*GC_THRESHOLDS)
    gc.callbacks.append(COLLECTIONS)
    hall: Hall = large_hall() if arguments.robots >= LARGE else HALLS["aisles"]()
    case = case_of(hall, arguments.robots, Extent(minutes=arguments.minutes, warm_up=1.0))
    middle = max(int(name[1:3]) for name in hall.plant.points_by_name) // 2
    path = f"{grid_point(middle, 6)} --- {grid_point(middle + 1, 6)}"
    watched = run(lambda clock: _watched(case, clock, path))
    for name, durations in (
        ("decisions of traffic control", watched.traffic.kept),
        ("dispatching", watched.dispatch.kept),
        ("holds of the loop", watched.holds.kept),
        ("holds after locking and unlocking", watched.after_lock.kept),
        ("garbage collections", COLLECTIONS.kept),
    ):
        sys.stdout.write(
            f"{arguments.robots} robots, {len(hall.plant.points)} points: {name}: {_figures(durations)}\n"
        )
    sys.stdout.write(f"waiting vehicles when the path was unlocked: {watched.under_way}\n")


if __name__ == "__main__":
    main()
