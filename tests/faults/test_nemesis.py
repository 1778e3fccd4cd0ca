"""Faults that a seed draws: the same for the same seed, each kind among them; a few seeds at a whole site."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from faults.history import Kind as Noted
from faults.nemesis import LONGEST, PART, Kind, Plan, run
from faults.pair import LONGEST_SILENCE, places
from nena_shared.vda5050.topics import RobotKey
from support.fleet_examples import state
from support.postgres import Postgres

SEEDS = (12, pytest.param(2, marks=pytest.mark.long), pytest.param(15, marks=pytest.mark.long))
"""Of `make test`; `make soak-nemesis` runs 200."""
MANY = range(1, 201)


def test_a_seed_draws_the_same_faults_again() -> None:
    assert Plan.of(7) == Plan.of(7)
    assert len({str(Plan.of(seed).rounds) for seed in MANY}) > 190


def test_each_kind_of_fault_is_drawn_often_alone_and_with_others() -> None:
    rounds = [each for seed in MANY for each in Plan.of(seed).rounds]
    drawn = Counter(fault.kind for each in rounds for fault in each.faults)
    together = Counter(fault.kind for each in rounds if len(each.faults) > 1 for fault in each.faults)

    assert min(drawn[each] for each in Kind) > 10
    assert min(together[each] for each in Kind if each is not Kind.TWO_LEADERS) > 5
    assert {Plan.of(seed).persistence for seed in MANY} == {False, True}
    assert max(each.seconds for each in rounds) <= LONGEST


def test_faults_that_come_together_strike_different_parts() -> None:
    for each in (each for seed in MANY for each in Plan.of(seed).rounds if len(each.faults) > 1):
        first, second = (PART.get(fault.kind, fault.line) for fault in each.faults)
        assert first != second
        assert Kind.TWO_LEADERS not in {fault.kind for fault in each.faults}


def test_a_silent_robot_is_located_only_until_its_last_report() -> None:
    robot = RobotKey("NeNa", "r")
    seen = [
        state(number, robot=robot, at=at, last_node_id=node)
        for number, (at, node) in enumerate(
            [(0, "A"), (0.5, "A"), (0.9, "B"), (0.9 + 2 * LONGEST_SILENCE, "C")]
        )
    ]
    begin = seen[0].timestamp.timestamp()
    found = [(each.kind, each.what, round(each.at - begin, 3)) for each in places("r", seen)]
    assert found == [
        (Noted.ENTERED, "A", 0),
        (Noted.LEFT, "A", 0.9),
        (Noted.ENTERED, "B", 0.9),
        (Noted.LEFT, "B", 0.9),
        (Noted.ENTERED, "C", 0.9 + 2 * LONGEST_SILENCE),
    ]


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
