"""The yardstick of the traffic benchmark keeps the rules that it measures others by."""

from __future__ import annotations

import pytest

from bench.halls import HALLS, Hall, demo_is_there
from bench.pibt import LockStep, bound, orders_per_minute


def hall(name: str) -> Hall:
    if name == "demo_01" and not demo_is_there():
        pytest.skip("openTCS's Demo-01 is not at hand")
    return HALLS[name]()


@pytest.mark.parametrize("name", HALLS)
def test_every_station_can_be_reached_from_everywhere(name: str) -> None:
    found = hall(name)
    fleet = LockStep(found, 1)

    for point in found.station_points.values():
        assert fleet.roads.to(point).keys() == fleet.roads.of.keys()


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("name", HALLS)
def test_no_two_robots_are_at_one_point_or_change_places(name: str, turns: bool) -> None:  # noqa: FBT001
    fleet = LockStep(hall(name), 14, turns=turns)

    for _ in range(300):
        before = {each.at: each for each in fleet.agents}
        fleet.step()
        after = {each.at: each for each in fleet.agents}
        assert len(after) == len(fleet.agents)
        for point, agent in before.items():
            other = after.get(point)
            assert other is None or other is agent or before.get(agent.at) is not other
    assert fleet.finished > 10


def test_one_robot_alone_is_as_fast_as_the_bound() -> None:
    found = hall("aisles")

    assert orders_per_minute(found, 1, minutes=300.0) == pytest.approx(bound(found, 1), rel=0.05)
    assert orders_per_minute(found, 1, turns=True, minutes=300.0) == pytest.approx(
        bound(found, 1, turns=True), rel=0.05
    )


def test_a_robot_is_never_beyond_the_bound_with_others_in_its_way() -> None:
    found = hall("spurs")

    assert orders_per_minute(found, 50) < bound(found, 50)
