"""Run a case in this process."""

from __future__ import annotations

import gc

from nena_simulate.observation import HOUR, Observed, Observer
from nena_simulate.report import Figures
from nena_simulate.site import Case, Site
from nena_simulate.virtual_time import VirtualClock, run


def simulate(case: Case) -> Figures:
    """Run a case, and return its figures."""
    return Figures.of([observe(case)], plant=case.plant.name, robots=case.robots)


def observe(case: Case) -> Observed:
    """Run a case, and return what was observed."""
    return run(lambda clock: _simulate_case(case, clock))


async def _simulate_case(case: Case, clock: VirtualClock) -> Observed:
    site = Site(case, clock)
    gc.freeze()  # what lasts is not searched for garbage, as in the programs
    gc.set_threshold(20_000, 10, 100)  # reference counting frees nearly all of the rest
    observer = Observer(site)
    await site.run(case.warm_up + case.hours * HOUR, observer.watch)
    return observer.observed()
