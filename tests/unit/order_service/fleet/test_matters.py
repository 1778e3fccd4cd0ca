from __future__ import annotations

from typing import Any

import pytest

from nena_order_service.fleet import MissionPhase
from nena_order_service.fleet.availability import matters
from support.fleet import Bench, make_mission
from support.fleet_examples import position, state


def place(x: float, **fields: Any) -> dict[str, Any]:
    return {"mobile_robot_position": {**position(x, 0.0), **fields}}


def power(charge: float, *, charging: bool = False) -> dict[str, Any]:
    return {"power_supply": {"state_of_charge": charge, "charging": charging}}


def to_come(*sequence_ids: int) -> dict[str, Any]:
    return {"node_states": tuple({"node_id": "N", "sequence_id": n, "released": True} for n in sequence_ids)}


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ({}, {"header_id": 9}),
        (place(1.0), place(2.0)),
        ({"loads": ({"weight": 10.0},)}, {"loads": ({"weight": 10.1},)}),
        (power(80.9), power(80.1)),
    ],
)
def test_what_changes_all_the_time_does_not_matter(before: dict[str, Any], after: dict[str, Any]) -> None:
    assert matters(state(**before)) == matters(state(**after))


@pytest.mark.parametrize(
    "fields",
    [
        {"order_id": "other"},
        {"loads": ({"load_position": "fork"},)},
        {"maps": ({"map_id": "hall", "map_version": "1", "map_status": "ENABLED"},)},
        {"order_update_id": 7},
        {"last_node_id": "elsewhere"},
        {"last_node_sequence_id": 8},
        to_come(4, 6),
        {"edge_states": ({"edge_id": "E", "sequence_id": 3, "released": True},)},
        {"driving": True},
        {"paused": True},
        {"new_base_request": True},
        {"operating_mode": "MANUAL"},
        {"errors": ({"error_type": "wheel", "error_level": "FATAL"},)},
        {"safety_state": {"active_emergency_stop": "MANUAL", "field_violation": False}},
        power(41.0),
        power(80.0, charging=True),
        place(1.0, map_id="other map"),
        place(1.0, localized=False),
    ],
)
def test_what_missions_and_news_are_made_of_matters(fields: dict[str, Any]) -> None:
    plain = {**place(1.0), **power(80.0), "driving": False}
    assert matters(state(**plain)) != matters(state(**{**plain, **fields}))


def test_the_first_node_to_come_stands_for_all() -> None:
    assert matters(state(**to_come(2, 4))) != matters(state(**to_come(4)))
    assert matters(state(**to_come(4, 6))) == matters(state(**to_come(4, 6)))


def test_states_that_say_nothing_new_are_seen_all_the_same() -> None:
    bench = Bench().online()
    bench.start(make_mission("m", "A", "B", "C"))
    bench.deliver()
    bench.report()
    for _ in range(3):
        bench.now += 1.0
        told = bench.report()
        assert not told
        assert bench.view().state_at == bench.now
        assert bench.view().mission_phase is MissionPhase.RUNNING
