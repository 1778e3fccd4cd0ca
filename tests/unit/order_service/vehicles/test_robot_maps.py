from __future__ import annotations

import pytest

from nena_order_service.vehicles.registry import robot_maps, why_not_on
from nena_shared.fleet_api.vehicle import RobotMap
from nena_shared.vda5050.state import State
from support.fleet_examples import state


def with_maps(*maps: tuple[str, str, str]) -> State:
    fields = ("map_id", "map_version", "map_status")
    return state(maps=tuple(dict(zip(fields, each, strict=True)) for each in maps))


OLD_AND_NEW = with_maps(("hall", "1", "DISABLED"), ("hall", "2", "ENABLED"), ("yard", "1", "DISABLED"))


@pytest.mark.clause("6.3.1")
def test_maps_are_reported_as_in_the_state() -> None:
    assert robot_maps(OLD_AND_NEW) == (
        RobotMap(map_id="hall", map_version="1", enabled=False),
        RobotMap(map_id="hall", map_version="2", enabled=True),
        RobotMap(map_id="yard", map_version="1", enabled=False),
    )
    assert robot_maps(state()) is None
    assert robot_maps(with_maps()) == ()


@pytest.mark.clause("6.3.1")
def test_a_map_must_be_enabled_if_the_robot_reports_maps() -> None:
    assert why_not_on("hall", OLD_AND_NEW) is None
    assert str(why_not_on("yard", OLD_AND_NEW)) == "has no version of map 'yard' enabled (enableMap)"
    assert str(why_not_on("roof", OLD_AND_NEW)) == "does not have map 'roof' (downloadMap, enableMap)"
    assert [why_not_on("roof", each) for each in (state(), with_maps())] == [None, None]
    assert why_not_on("", OLD_AND_NEW) is None
