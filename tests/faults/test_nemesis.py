"""Faults that a seed draws: the same for the same seed, each kind among them; a few seeds at a whole site."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from faults.nemesis import LONGEST, Kind, Plan, run
from support.postgres import Postgres

SEEDS = (12, pytest.param(2, marks=pytest.mark.long), pytest.param(15, marks=pytest.mark.long))
"""Of `make test`; `make soak-nemesis` runs 200."""
MANY = range(1, 201)


def test_each_kind_of_fault_is_drawn_often_alone_and_with_others() -> None:
    rounds = [each for seed in MANY for each in Plan.of(seed).rounds]
    drawn = Counter(fault.kind for each in rounds for fault in each.faults)
    together = Counter(fault.kind for each in rounds if len(each.faults) > 1 for fault in each.faults)

    assert min(drawn[each] for each in Kind) > 10
    assert min(together[each] for each in Kind if each is not Kind.TWO_LEADERS) > 5
    assert {Plan.of(seed).persistence for seed in MANY} == {False, True}
    assert max(each.seconds for each in rounds) <= LONGEST


@pytest.mark.e2e
@pytest.mark.broker
@pytest.mark.timeout(900)
@pytest.mark.parametrize("seed", SEEDS)
async def test_a_site_under_seeded_faults_loses_and_repeats_nothing(
    seed: int, tmp_path: Path, own_postgres: Postgres
) -> None:
    """As `python -m faults.nemesis` does with 200 seeds."""
    result = await run(Plan.of(seed, rounds=2), tmp_path, own_postgres)

    assert result.findings == [], result
    assert result.finished > 0
