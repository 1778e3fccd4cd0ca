"""Run cases, each in its own process, so that several fleet sizes use several cores."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from itertools import islice
from multiprocessing import get_context

from nena_shared import log
from nena_shared.settings import LogSettings
from nena_simulate.observation import HOUR, Observed, Observer
from nena_simulate.report import Figures
from nena_simulate.site import Case, Site, check
from nena_simulate.virtual_time import VirtualClock, run

HASH_SEED = "PYTHONHASHSEED"


def simulate(case: Case) -> Figures:
    """Run a case in this process."""
    return Figures.of(observe(case), robots=case.robots)


def observe(case: Case) -> Observed:
    """Run a case in this process, and return what was observed."""
    return run(lambda clock: _simulate_case(case, clock))


async def _simulate_case(case: Case, clock: VirtualClock) -> Observed:
    site = Site(case, clock)
    observer = Observer(site)
    await site.run(case.warm_up + case.hours * HOUR, observer.watch)
    return observer.observed()


def simulate_all(cases: Sequence[Case], *, jobs: int, parts: int = 1) -> list[Figures]:
    """Run each case in its own processes, one for each of its ``parts``, ``jobs`` at a time.

    Raises:
        DemandError: a case has recorded orders, which cannot be split.
        ValueError: the robots of a case do not fit into its plant; no process was started.
    """
    for case in cases:
        check(case)
    split = [part for case in cases for part in case.in_parts(parts)]
    with (
        _sets_in_one_order(),
        # spawn: Python reads the hash seed only at its start; a fork would keep ours.
        ProcessPoolExecutor(
            jobs, mp_context=get_context("spawn"), initializer=_prepare_process, max_tasks_per_child=1
        ) as pool,
    ):
        found = iter(list(pool.map(observe, split)))
    return [Figures.of(Observed.joined(list(islice(found, parts))), robots=case.robots) for case in cases]


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


def _prepare_process() -> None:
    log.configure(LogSettings(level="error"))
