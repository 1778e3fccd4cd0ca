"""The same seed gives the same result; the figures are right, and disturbances show in them."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from bench.halls import SPEED_MM_S, two_halls
from bench.pibt import bound
from nena_order_service.engine.status import StatusReporter
from nena_simulate.demand import Demand, DemandError, Relation, Transport, every_relation
from nena_simulate.observation import Doing
from nena_simulate.simulation import observe, simulate
from nena_simulate.site import Case, Disturbances

pytestmark = pytest.mark.simulation

HALL = two_halls()
MINUTES = 1.5
CASE = Case(
    plant=HALL.with_robots(4),
    demand=Demand(backlog=5),
    robots=4,
    hours=MINUTES / 60,
    warm_up=10.0,
    speed=SPEED_MM_S / 1000,
    work_seconds=2.0,
)


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize("loss", [0.0, 0.02])
def test_the_same_seed_gives_the_same_result(seed: int, loss: float) -> None:
    case = replace(CASE, seed=seed, disturbances=Disturbances(loss=loss, speed_spread=0.3))

    assert simulate(case) == simulate(case)


@pytest.mark.parametrize("minutes", [2.0, pytest.param(30.0, marks=pytest.mark.long)])
def test_encoded_messages_change_nothing(minutes: float) -> None:
    disturbed = Disturbances(loss=0.01, speed_spread=0.3)
    case = replace(CASE, plant=HALL.with_robots(8), robots=8, hours=minutes / 60, disturbances=disturbed)

    found = observe(case)

    assert len(found.finishes) > 4 * minutes
    assert observe(replace(case, encoded=True)) == found


def test_without_listeners_no_status_of_a_vehicle_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[object] = []
    monkeypatch.setattr(StatusReporter, "vehicle_status", lambda _, vehicle: built.append(vehicle))

    assert observe(CASE).finishes
    assert not built


def test_a_case_is_split_into_shorter_ones_with_their_own_seeds() -> None:
    parts = replace(CASE, seed=4, hours=8.0).runs(parts=2)

    assert [(each.hours, each.seed, each.warm_up) for each in parts] == [(4.0, 4, 10.0), (4.0, 5, 10.0)]
    assert CASE.runs() == [CASE]
    assert [each.seed for each in CASE.runs((5, 8))] == [5, 8]
    with pytest.raises(ValueError, match="use --parts 1"):
        CASE.runs((1, 2), parts=2)


def test_recorded_orders_are_not_split() -> None:
    plant, operations = CASE.plant, CASE.operations()
    relations = every_relation(plant, operations)
    order = next(Demand(relations=relations).timed(Transport(plant, operations), Random(1)))

    with pytest.raises(DemandError, match="use --parts 1"):
        replace(CASE, demand=Demand(orders=(order,))).runs(parts=2)


def test_single_robot_reaches_the_throughput_bound() -> None:
    one_by_one = replace(CASE, plant=HALL.with_robots(1), robots=1, hours=0.3, demand=Demand(backlog=1))

    found = simulate(one_by_one)

    assert found.orders_per_hour / 60 == pytest.approx(bound(HALL, 1, turns=True), rel=0.1)
    assert found.doing[Doing.WAITS] < 0.03
    assert found.doing[Doing.WORKS] == pytest.approx(found.finished * 4.0 / 1080, rel=0.15)
    assert 0.3 < found.empty_share < 0.7
    assert found.failed == 0
    assert sum(found.finished_by_minute) == found.finished
    assert len(found.finished_by_minute) == 18


def test_conflicting_robots_wait_with_place_and_reason() -> None:
    found = simulate(replace(CASE, plant=HALL.with_robots(10), robots=10))

    waited = found.doing[Doing.WAITS] * 10 * 60
    assert waited > 10
    assert sum(found.waiting_by_cause.values()) == pytest.approx(waited, rel=0.02)
    assert sum(found.waiting_by_place.values()) == pytest.approx(waited, rel=0.02)
    known = HALL.plant.points_by_name.keys() | HALL.plant.paths_by_name.keys()
    assert found.waiting_by_place.keys() <= known
    assert not any("Robot" in cause or "robot-" in cause for cause in found.waiting_by_cause)


def test_orders_at_a_rate_that_the_fleet_can_do_are_done_soon() -> None:
    relation = Relation(HALL.stations[0], HALL.stations[-1], 60.0)
    found = simulate(replace(CASE, demand=Demand(relations=(relation,)), hours=0.2))

    assert found.created == pytest.approx(12, abs=8)
    assert abs(found.finished - found.created) <= 5
    assert found.lead_p50 is not None
    assert 10 < found.lead_p50 < 120
    assert found.doing[Doing.IDLE] > 0.1
    assert found.utilisation == pytest.approx(1 - found.doing[Doing.IDLE], abs=0.001)


def test_a_robot_that_breaks_down_costs_orders() -> None:
    alone = replace(CASE, plant=HALL.with_robots(1), robots=1)
    dead = Disturbances(dead=(15.0, MINUTES * 60))

    assert simulate(replace(alone, disturbances=dead)).finished < simulate(alone).finished / 2


def test_more_robots_than_points_are_refused() -> None:
    with pytest.raises(ValueError, match="do not fit"):
        simulate(replace(CASE, robots=len(HALL.plant.points)))
