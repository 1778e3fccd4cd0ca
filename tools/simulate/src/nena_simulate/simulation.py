"""Run cases, each in its own process, so that several fleet sizes use several cores."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context

from nena_shared import log
from nena_shared.settings import LogSettings
from nena_simulate.observation import Observer
from nena_simulate.report import Figures
from nena_simulate.site import Case, Site
from nena_simulate.virtual_time import VirtualClock, run

HOUR = 3600.0
HASH_SEED = "PYTHONHASHSEED"


def simulate(case: Case) -> Figures:
    """Run a case in this process."""
    observer, site = run(lambda clock: _observed(case, clock))
    waiting = len(site.engine.state.orders.dispatchable())
    return Figures.of(observer, robots=case.robots, hours=case.hours, waiting=waiting)


async def _observed(case: Case, clock: VirtualClock) -> tuple[Observer, Site]:
    site = Site(case, clock)
    observer = Observer(site)
    await site.run(case.warm_up + case.hours * HOUR, observer.watch)
    return observer, site


def simulate_all(cases: Iterable[Case], *, jobs: int) -> list[Figures]:
    """Run each case in its own process, ``jobs`` at a time."""
    with (
        _sets_in_one_order(),
        ProcessPoolExecutor(
            jobs, mp_context=get_context("spawn"), initializer=_prepare, max_tasks_per_child=1
        ) as pool,
    ):
        return list(pool.map(simulate, cases))


@contextmanager
def _sets_in_one_order() -> Iterator[None]:
    """Start processes with a fixed hash seed, which Python otherwise chooses at random."""
    before = os.environ.get(HASH_SEED)
    os.environ[HASH_SEED] = "0"
    try:
        yield
    finally:
        del os.environ[HASH_SEED]
        if before is not None:
            os.environ[HASH_SEED] = before


def _prepare() -> None:
    log.configure(LogSettings(level="error"))
    gc.set_threshold(100_000, 50, 50)
