from __future__ import annotations

from copy import deepcopy
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant.model import PlantModel
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet.messages import MessageKind
from nena_status_aggregator.fleet.model import FleetModel, MapCache, ModelLimits, RobotRegistry
from nena_status_aggregator.fleet.publication import Delta
from nena_status_aggregator.fleet.robot import Timestamp
from nena_status_aggregator.fleet.views import RobotView
from support.deltas import apply_delta
from support.fleet_examples import (
    ROBOT,
    connection,
    factsheet,
    order_status,
    position,
    vehicle_status,
    way,
)
from support.fleet_examples import timestamp as at
from support.fleet_records import state, visualization
from support.robot_maps import robot_map


def model(**limits: Any) -> FleetModel:
    made = FleetModel(ModelLimits(**limits))
    made.on_link(connected=True, at=at(0))
    return made


def view_of(fleet: FleetModel, seconds: float = 0, key: RobotKey = ROBOT) -> RobotView:
    fleet.flush(at(seconds))
    view = fleet.robot_view(key)
    assert view is not None
    return view


def test_a_robot_is_discovered_by_its_first_message() -> None:
    fleet = model()
    fleet.on_connection(ROBOT, connection(), at(0))
    view = view_of(fleet)
    assert (view["id"], view["name"], view["connection"]) == ("ACME/r1", "r1", "ONLINE")
    assert (view["condition"], view["lastState"]) == ("SILENT", None)


def test_all_fields_of_a_state_are_in_the_view() -> None:
    fleet = model()
    fleet.on_factsheet(ROBOT, factsheet(), at(0))
    fleet.on_state(
        ROBOT,
        state(
            at=1,
            order_id="o1",
            last_node_id="A",
            driving=True,
            mobile_robot_position=position(1.0, 2.0, 0.5),
            velocity={"vx": 0.8, "vy": 0.0, "omega": 0.1},
            loads=({"load_id": "p7", "weight": 12.0},),
            errors=({"error_type": "small", "error_level": "WARNING", "error_description": "so so"},),
            action_states=({"action_id": "a1", "action_type": "pick", "action_status": "WAITING"},),
            **way("B", "C", released=1),
        ),
        at(1),
    )
    view = view_of(fleet, 1)
    assert view["condition"] == "BUSY"
    assert view["position"] == {"x": 1.0, "y": 2.0, "theta": 0.5, "mapId": "hall", "localized": True}
    assert view["velocity"] == {"vx": 0.8, "vy": 0.0, "omega": 0.1}
    assert view["battery"] == {"charge": 80.0, "charging": False, "voltage": None, "range": None}
    assert view["loads"] == [{"loadId": "p7", "loadType": None, "loadPosition": None, "weight": 12.0}]
    assert [each["errorType"] for each in view["errors"]] == ["small"]
    assert [each["status"] for each in view["actions"]] == ["WAITING"]
    assert view["order"] is not None
    assert (view["order"]["orderId"], view["order"]["active"], view["order"]["progress"]) == ("o1", True, 0)
    assert [each["released"] for each in view["order"]["ahead"]] == [True, False]
    assert view["body"] is not None
    assert view["body"]["length"] == 1.1


def test_late_and_repeated_states_change_nothing_and_are_counted() -> None:
    fleet = model()
    fleet.on_state(ROBOT, state(5, at=5, last_node_id="new"), at(5))
    before = view_of(fleet, 5)
    fleet.on_state(ROBOT, state(5, at=5, last_node_id="new"), at(6))
    fleet.on_state(ROBOT, state(3, at=3, last_node_id="old"), at(6))
    assert view_of(fleet, 6) == before
    assert fleet.statistics.repeated[MessageKind.STATE] == 1
    assert fleet.statistics.late[MessageKind.STATE] == 1
    assert fleet.statistics.received[MessageKind.STATE] == 3


def test_last_will_with_an_old_header_is_accepted() -> None:
    fleet = model()
    fleet.on_connection(ROBOT, connection("ONLINE", 8, at=100), at(100))
    fleet.on_state(ROBOT, state(at=101), at(101))
    fleet.on_connection(ROBOT, connection("CONNECTION_BROKEN", 7, at=99), at(130))
    assert view_of(fleet, 130)["condition"] == "BROKEN"


def test_silence_is_detected_without_a_message() -> None:
    fleet = model()
    fleet.on_state(ROBOT, state(), at(0))
    assert view_of(fleet, 35)["condition"] == "IDLE"
    delta = fleet.flush(at(36))
    assert delta is not None
    assert [each["condition"] for each in delta["robots"]] == ["SILENT"]
    assert fleet.flush(at(37)) is None


def test_wrong_clock_is_detected() -> None:
    fleet = model()
    fleet.on_state(ROBOT, state(at=61), at(1))
    assert view_of(fleet)["clockSkew"] == 60
    other = RobotKey("ACME", "r2")
    fleet.on_state(other, state(robot=other, at=0.5), at(1))
    assert view_of(fleet, key=other)["clockSkew"] is None


def test_robot_with_only_unreadable_messages_is_listed() -> None:
    fleet = model()
    fleet.on_malformed(MessageKind.STATE, "uagv/v2/ACME/r1/state", "headerId: missing", at(0), key=ROBOT)
    view = view_of(fleet)
    assert (view["condition"], view["malformed"]) == ("ERROR", 1)
    assert view["reason"] == "Unreadable state: state: headerId: missing"
    shown = fleet.snapshot()["malformed"]
    assert (shown["counts"], shown["lastProblem"]) == ({"state": 1}, "headerId: missing")


def test_malformed_message_keeps_the_last_state() -> None:
    fleet = model()
    fleet.on_state(ROBOT, state(), at(0))
    fleet.on_malformed(MessageKind.STATE, "t", "bad", at(1), key=ROBOT)
    view = view_of(fleet, 1)
    assert (view["condition"], view["reason"]) == ("ERROR", "Unreadable state: state: bad")
    assert (view["battery"], view["urgent"]) == (view_of(model_with_state(), 0)["battery"], True)


def model_with_state() -> FleetModel:
    fleet = model()
    fleet.on_state(ROBOT, state(), at(0))
    return fleet


def test_an_unreadable_state_shows_where_the_robot_is() -> None:
    fleet = model()
    fleet.on_malformed(MessageKind.STATE, "t", "bad", at(1), key=ROBOT)
    fleet.on_sighting(ROBOT, state(mobile_robot_position=position(1.0, 2.0)))
    view = view_of(fleet, 1)
    assert view["position"]
    assert (view["condition"], view["position"]["x"], view["position"]["y"]) == ("ERROR", 1.0, 2.0)


def test_states_with_the_same_header_are_new_if_their_content_differs() -> None:
    fleet = model()
    for node in ("A", "B", "B", "C"):
        fleet.on_state(ROBOT, state(0, at=0, last_node_id=node), at(1))
    robot = fleet.robots.get(ROBOT)
    assert robot
    assert robot.state
    assert robot.state.last_node_id == "C"
    assert fleet.statistics.repeated[MessageKind.STATE] == 1


def test_a_robot_whose_states_are_ignored_is_not_silent_without_a_word() -> None:
    fleet = model()
    fleet.on_state(ROBOT, state(9, at=9), at(9))
    for second in range(10, 60):
        fleet.on_state(ROBOT, state(5, at=5), at(second))
    view = view_of(fleet, 60)
    assert view["condition"] == "ERROR"
    assert "ignored, because neither headerId nor timestamp increases (headerId 5" in view["reason"]


def test_new_errors_are_counted_once() -> None:
    fleet = model()
    error = {"error_type": "orderError", "error_level": "WARNING"}
    for number in (1, 2):
        fleet.on_state(ROBOT, state(number, at=number, errors=(error,)), at(number))
    assert fleet.statistics.errors_raised == {("orderError", "WARNING"): 1}
    fleet.on_state(ROBOT, state(3, at=3), at(3))
    fleet.on_state(ROBOT, state(4, at=4, errors=(error,)), at(4))
    assert fleet.statistics.errors_raised == {("orderError", "WARNING"): 2}


def test_order_service_provides_name_and_idle_reason() -> None:
    fleet = model()
    fleet.on_state(ROBOT, state(), at(0))
    fleet.on_vehicle_status(vehicle_status(), at(0))
    view = view_of(fleet)
    assert (view["name"], view["reason"]) == ("Vehicle-1", "No order waits for it.")


def test_an_order_advances_with_its_vehicle() -> None:
    fleet = model()
    fleet.on_order_status(order_status(), at(0))
    fleet.on_vehicle_status(vehicle_status(transport_order="TO-1"), at(0))
    fleet.on_state(ROBOT, state(last_node_id="A"), at(0))
    fleet.flush(at(0))
    fleet.on_state(ROBOT, state(2, at=2, last_node_id="C"), at(2))
    delta = fleet.flush(at(2))
    assert delta is not None
    assert delta["orders"] == [{"id": "TO-1", "progress": 22.5}]


def test_removed_robot_is_in_the_delta() -> None:
    fleet = model(robots=1)
    fleet.on_state(ROBOT, state(), at(0))
    fleet.flush(at(0))
    other = RobotKey("ACME", "r2")
    fleet.on_state(other, state(robot=other), at(5))
    assert fleet.statistics.refused[MessageKind.STATE] == 1
    fleet.on_state(other, state(robot=other), at(60))
    delta = fleet.flush(at(60))
    assert delta is not None
    assert delta["robotsGone"] == ["ACME/r1"]
    assert [each["id"] for each in fleet.snapshot()["robots"]] == ["ACME/r2"]


def test_the_plant_is_numbered_by_its_changes() -> None:
    fleet = model()
    for plant in (PlantModel(name="a"), PlantModel(name="a"), PlantModel(name="b"), None):
        fleet.on_plant_model(plant)
        fleet.flush(at(0))
        shown = fleet.snapshot()["plant"]
        assert shown is None if plant is None else shown is not None and shown["name"] == plant.name
    assert fleet.plant is None


def test_no_change_no_delta_and_numbers_without_gaps() -> None:
    fleet = model()
    fleet.on_state(ROBOT, state(), at(0))
    first = fleet.flush(at(0))
    assert fleet.flush(at(1)) is None
    fleet.on_state(ROBOT, state(2, at=1, driving=True), at(2))
    second = fleet.flush(at(2))
    assert first is not None
    assert second is not None
    assert [first["id"], second["id"]] == [1, 2]
    assert "manufacturer" not in second["robots"][0]
    assert fleet.snapshot()["id"] == 2


Event = tuple[str, int, int, int]
EVENTS: st.SearchStrategy[Event] = st.tuples(
    st.sampled_from(
        (
            "connection",
            "state",
            "visualization",
            "factsheet",
            "malformed",
            "vehicle",
            "order",
            "cleared",
            "plant",
            "link",
            "flush",
        )
    ),
    st.integers(0, 5),
    st.integers(0, 8),
    st.integers(0, 40),
)


def happen(fleet: FleetModel, event: Event, now: Timestamp) -> None:
    kind, who, number, variant = event
    key = RobotKey("ACME", f"r{who}")
    match kind:
        case "connection":
            word = ("ONLINE", "OFFLINE", "CONNECTION_BROKEN", "HIBERNATING")[variant % 4]
            fleet.on_connection(key, connection(word, number, robot=key, at=variant), now)
        case "state":
            busy = {**way("B", "C"), "order_id": "o", "driving": True} if variant % 2 else {}
            fleet.on_state(key, state(number, robot=key, at=variant, **busy), now, retained=variant == 7)
        case "visualization":
            fleet.on_visualization(key, visualization(number, robot=key, at=variant, x=variant), now)
        case "factsheet":
            fleet.on_factsheet(key, factsheet(number, robot=key, at=variant), now)
        case _:
            happen_beside(fleet, event, now)


def happen_beside(fleet: FleetModel, event: Event, now: Timestamp) -> None:
    kind, who, number, variant = event
    key = RobotKey("ACME", f"r{who}")
    match kind:
        case "malformed":
            fleet.on_malformed(MessageKind.STATE, "t", "p", now, key=key if variant % 2 else None)
        case "vehicle":
            fleet.on_vehicle_status(vehicle_status(f"v{who}", robot=key, transport_order=f"TO-{number}"), now)
        case "order":
            states = tuple(TransportOrderState)
            fleet.on_order_status(order_status(f"TO-{who}", number, states[variant % len(states)]), at(0))
        case "cleared":
            fleet.on_order_cleared(f"TO-{who}")
        case "plant":
            fleet.on_plant_model(PlantModel(name=f"p{variant}") if variant else None)
        case "link":
            fleet.on_link(connected=variant % 2 == 0, at=now)


def by_id(views: list[Any]) -> list[Any]:
    return sorted(views, key=lambda each: each["id"])


@settings(max_examples=150, deadline=None)
@given(st.lists(EVENTS, max_size=60))
def test_deltas_connect_snapshots_for_any_messages(
    events: list[Event],
) -> None:
    fleet = FleetModel(ModelLimits(robots=4, orders=3))
    view = deepcopy(fleet.snapshot())
    now = 0.0
    for event in (*events, ("flush", 0, 0, 1)):
        now += event[3] / 4
        happen(fleet, event, at(now))
        if event[0] != "flush":
            continue
        delta: Delta | None = fleet.flush(at(now))
        if delta is not None:
            assert delta["id"] == view["id"] + 1
            view = apply_delta(deepcopy(delta), view)
        snapshot = fleet.snapshot()
        assert by_id(view["robots"]) == by_id(snapshot["robots"])
        assert by_id(view["orders"]) == by_id(snapshot["orders"])
        assert {**view, "robots": [], "orders": []} == {**snapshot, "robots": [], "orders": []}
        assert len(snapshot["robots"]) <= 4
        assert len(snapshot["orders"]) <= 3


def test_conditions_advance_without_clients_and_the_next_delta_is_complete() -> None:
    fleet = model(silence=5)
    fleet.on_state(ROBOT, state(), at(0))
    assert fleet.flush(at(0)) is not None
    fleet.on_state(ROBOT, state(2, at=1, driving=True), at(1))
    fleet.update_conditions(at(1))
    robot = fleet.robots.get(ROBOT)
    assert robot is not None
    assert (robot.condition, fleet.snapshot()["robots"][0]["condition"]) == ("BUSY", "IDLE")
    fleet.update_conditions(at(9))
    delta = fleet.flush(at(10))
    assert delta is not None
    assert (delta["id"], delta["robots"][0]["condition"]) == (2, "SILENT")
    assert delta["robots"][0]["driving"] is True


A, B, C = (RobotKey("ACME", name) for name in "abc")


def test_new_robot_is_refused_while_none_is_silent() -> None:
    register = RobotRegistry(2, None)
    register.find_or_add(A, at(0))
    register.find_or_add(B, at(0))
    assert register.find_or_add(C, at(30)) == (None, None)
    assert [robot.key for robot in register] == [A, B]


def test_new_robot_replaces_the_longest_silent_one() -> None:
    register = RobotRegistry(2, None)
    register.find_or_add(A, at(0))
    register.find_or_add(B, at(0))
    register.find_or_add(A, at(90))
    newcomer, gone = register.find_or_add(C, at(100))
    assert newcomer is not None
    assert gone is not None
    assert gone.key == B
    assert [robot.key for robot in register] == [A, C]


OTHER = "fedcba9876543210"


def test_equal_maps_are_stored_once() -> None:
    cache = MapCache()
    first = cache.share_map(robot_map())
    assert cache.share_map(robot_map()) is first
    assert cache.share_map(robot_map(OTHER)) is not first
    elsewhere = robot_map(x=5.0)
    assert cache.share_map(elsewhere) is elsewhere, "the same digest does not make it the same map"


def test_map_beyond_the_limit_is_refused_until_another_is_freed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nena_status_aggregator.fleet.model.ROOM", 2 * len(robot_map().png) - 1)
    cache = MapCache()
    first = cache.share_map(robot_map())
    assert first is not None
    assert cache.share_map(robot_map(OTHER)) is None
    del first
    assert cache.share_map(robot_map(OTHER)) is not None
