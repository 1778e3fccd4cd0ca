"""The model's events, and its counters of them."""

from __future__ import annotations

from typing import Any

from nena_shared.fleet_api.stops import Area, StopStatus
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.transport_order import OrderOutcome, TransportOrderState
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet.events import Code, Event, Outcome
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.settings import JamSettings
from support.fleet_examples import ROBOT, START, connection, order_status, position, vehicle_status, way
from support.fleet_examples import timestamp as at
from support.fleet_records import state


class Recorded:
    """A model and what it has published."""

    def __init__(self, **limits: Any) -> None:
        self.published: list[Event] = []
        self.model = FleetModel(ModelLimits(**limits), self.published.append)
        self.model.on_link(connected=True, at=at(0))

    def codes(self) -> list[str]:
        return [each.code.value for each in self.published]

    def last(self, code: Code) -> Event:
        return [each for each in self.published if each.code is code][-1]


def test_connection_change_is_logged_once() -> None:
    recorded = Recorded()
    for number in range(3):
        recorded.model.on_connection(ROBOT, connection(number=number), at(number))
    event = recorded.last(Code.CONNECTION)
    assert recorded.codes().count("connection") == 1
    assert (event.robot, event.time) == ("ACME/r1", START)
    assert event.values == {"state": "ONLINE", "before": None}


def test_conditions_are_logged_with_reasons() -> None:
    recorded = Recorded()
    stop = {"active_emergency_stop": "MANUAL", "field_violation": False}
    scenes: tuple[dict[str, Any], ...] = (
        {},
        {"safety_state": stop},
        {"paused": True},
        {"driving": True},
        {"driving": True, "order_id": "o"},
    )
    for number, fields in enumerate(scenes):
        recorded.model.on_state(ROBOT, state(number + 1, at=number, **fields), at(number))
        recorded.model.flush(at(number))
    conditions = [each for each in recorded.published if each.code is Code.CONDITION]
    assert [(each.values["condition"], each.values["reason"]) for each in conditions] == [
        ("IDLE", "idle"),
        ("BLOCKED", "emergency_stop"),
        ("BLOCKED", "paused"),
        ("BUSY", "driving_free"),
    ]
    assert conditions[1].text == "Emergency stop active; reset it at the robot."
    assert conditions[1].values["how"] == "at the robot"


def test_values_of_a_condition_are_short_and_name_coordinates() -> None:
    recorded = Recorded()
    error = {"error_type": "x", "error_level": "FATAL", "error_description": "e" * 100_000}
    recorded.model.on_state(ROBOT, state(errors=[error]), at(0))
    recorded.model.flush(at(0))
    assert len(str(recorded.last(Code.CONDITION).values)) < 10_000

    route = way("goal:7")
    (node,) = route["node_states"]
    route["node_states"] = ({**node, "node_position": {"x": 1.0, "y": 2.0, "map_id": "m"}},)
    driving = state(2, at=1, driving=True, order_id="o", last_node_id="A", **route)
    recorded.model.on_state(ROBOT, driving, at(1))
    recorded.model.flush(at(1))
    assert recorded.last(Code.CONDITION).values["next"] == "x 1.00, y 2.00"


def test_silence_is_logged_without_a_message() -> None:
    recorded = Recorded(silence=5)
    recorded.model.on_state(ROBOT, state(), at(0))
    recorded.model.flush(at(0))
    recorded.model.flush(at(6))
    assert recorded.last(Code.CONDITION).values["condition"] == "SILENT"
    assert recorded.last(Code.CONDITION).time == at(6).utc


def test_events_of_a_robot_are_logged_with_its_order_and_counted() -> None:
    recorded = Recorded()
    model = recorded.model
    model.on_state(ROBOT, state(last_node_id="A"), at(0))
    model.on_state(ROBOT, state(2, at=1, order_id="v1", last_node_id="A", **way("B")), at(1))
    model.on_vehicle_status(vehicle_status(transport_order="TO-1"), at(1))
    done = state(3, at=2, order_id="v1", last_node_id="B", last_node_sequence_id=2)
    model.on_state(ROBOT, done, at(2))
    model.on_state(ROBOT, done, at(2))
    assert [(each.code, each.order) for each in recorded.published[1:]] == [
        (Code.ORDER_TAKEN, "v1"),
        (Code.ORDER_ENDED, "TO-1"),
        (Code.NODE_REACHED, "TO-1"),
    ]
    counted = model.statistics
    assert (counted.robot_orders_taken, counted.nodes_reached) == (1, 1)
    assert counted.robot_orders_ended == {
        Outcome.COMPLETED: 1,
        Outcome.ABANDONED: 0,
        Outcome.UNSEEN: 0,
    }


def test_transport_orders_are_logged_on_changes_of_state_or_reason() -> None:
    recorded = Recorded()
    for version, (order_state, reason) in enumerate(
        (
            (TransportOrderState.DISPATCHABLE, "Waits."),
            (TransportOrderState.DISPATCHABLE, "Waits."),
            (TransportOrderState.DISPATCHABLE, "No vehicle is free."),
            (TransportOrderState.BEING_PROCESSED, "Drives."),
        )
    ):
        status = order_status(version=version + 1, state=order_state, reason=reason)
        recorded.model.on_order_status(status, at(version))
    orders = [each for each in recorded.published if each.code is Code.TRANSPORT_ORDER]
    assert [each.text for each in orders] == [
        "DISPATCHABLE: Waits.",
        "DISPATCHABLE: No vehicle is free.",
        "BEING_PROCESSED: Drives.",
    ]
    assert (orders[-1].order, orders[-1].values["before"]) == ("TO-1", "DISPATCHABLE")
    assert orders[-1].values["reason"] == "Drives."


def test_end_of_a_transport_order_has_what_reports_need() -> None:
    recorded = Recorded()
    ends: dict[str, dict[str, Any]] = {
        "TO-1": {"deadline": at(100).utc, "late": False},
        "TO-2": {"deadline": at(50).utc, "late": True},
        "TO-3": {"automatic": True},
        "TO-4": {"outcome": OrderOutcome.WITHDRAWN},
    }
    for name, fields in ends.items():
        recorded.model.on_order_status(order_status(name), at(0))
        assert "leadTime" not in recorded.last(Code.TRANSPORT_ORDER).values
        done = order_status(name, 2, TransportOrderState.FINISHED, finished=at(61.5).utc, **fields)
        recorded.model.on_order_status(done, at(62))
    found = [each.values for each in recorded.published if each.values.get("state") == "FINISHED"]
    assert [(each["leadTime"], each["late"], each["automatic"], each["outcome"]) for each in found] == [
        (61.5, False, False, "FINISHED"),
        (61.5, True, False, "FINISHED"),
        (61.5, None, True, "FINISHED"),
        (61.5, None, False, "WITHDRAWN"),
    ]


def test_end_of_a_robots_order_has_its_distances() -> None:
    recorded = Recorded()

    def drive(number: int, x: float, loads: tuple[dict[str, str], ...] | None, **fields: Any) -> None:
        here = position(x, 0)
        told = state(number, at=number, mobile_robot_position=here, loads=loads, **fields)
        recorded.model.on_state(ROBOT, told, at(number))

    box = ({"load_id": "box"},)
    drive(1, 0, ())
    drive(2, 0, (), order_id="o1", last_node_id="A", **way("B"))
    drive(3, 4, box, order_id="o1", last_node_id="A", **way("B"))
    drive(4, 10, box, order_id="o1", last_node_id="B", last_node_sequence_id=2)
    ended = recorded.last(Code.ORDER_ENDED).values
    assert (ended["distance"], ended["emptyDistance"]) == (10.0, 4.0)
    drive(5, 10, None, order_id="o2", last_node_id="B", **way("C"))
    drive(6, 12, None, order_id="o2", last_node_id="C", last_node_sequence_id=2)
    ended = recorded.last(Code.ORDER_ENDED).values
    assert (ended["distance"], ended["emptyDistance"]) == (2.0, None)


def test_new_cause_of_waiting_is_logged() -> None:
    recorded = Recorded()
    waiting = state(order_id="o", last_node_id="A", **way("B", released=0))
    recorded.model.on_state(ROBOT, waiting, at(0))
    for number, cause in enumerate((None, WaitCause.PASSES, WaitCause.PASSES, WaitCause.STANDS)):
        wait = cause and TrafficWait(vehicles=("Vehicle-2",), at="B", cause=cause, reason="waits")
        recorded.model.on_vehicle_status(vehicle_status(wait=wait), at(number))
        recorded.model.flush(at(number))
    reasons = [each.values["reason"] for each in recorded.published if each.code is Code.CONDITION]
    assert reasons == ["waiting_for_release", "waits_passing", "waits_standing"]


def test_jams_and_stops_are_logged_for_the_replay() -> None:
    recorded = Recorded(jam=JamSettings(robots=1, seconds=0))
    for second, behind in ((0, 3), (1, 3), (2, 0)):
        for number in range(4):
            key = RobotKey("ACME", f"r{number}")
            wait = TrafficWait(vehicles=("V-0",), at="B", cause=WaitCause.PASSES, reason="waits")
            told = vehicle_status(f"V-{number}", robot=key, wait=wait if 0 < number <= behind else None)
            recorded.model.on_vehicle_status(told, at(second))
            recorded.model.on_state(key, state(second + 1, robot=key, at=second), at(second))
        recorded.model.flush(at(second))
    jams = [(each.robot, each.values) for each in recorded.published if each.code is Code.JAM]
    assert jams == [("ACME/r0", {"robots": 3}), ("ACME/r0", {"robots": 0})]

    stop = StopStatus(
        name="S-1", by="Anna", reason="oil", since=START, area=Area(x_min=0, y_min=1, x_max=2, y_max=3)
    )
    recorded.model.direct_stops = (stop,)
    recorded.model.flush(at(3))
    recorded.model.flush(at(4))
    recorded.model.direct_stops = ()
    recorded.model.flush(at(5))
    stops = [each.values for each in recorded.published if each.code is Code.STOP]
    assert [(each["stop"], each["active"], each["by"], each["xMax"]) for each in stops] == [
        ("S-1", True, "Anna", 2),
        ("S-1", False, "Anna", 2),
    ]


def test_first_connection_of_a_run_is_marked() -> None:
    recorded = Recorded()
    recorded.model.on_link(connected=False, at=at(1))
    recorded.model.on_link(connected=True, at=at(2))
    links = [each.values for each in recorded.published if each.code is Code.LINK]
    assert links == [{"connected": True, "started": True}, {"connected": False}, {"connected": True}]


def test_removed_robot_and_lost_link_are_logged() -> None:
    recorded = Recorded(robots=1, silence=1)
    recorded.model.on_state(ROBOT, state(), at(0))
    other = RobotKey("ACME", "r2")
    recorded.model.on_state(other, state(robot=other), at(10))
    recorded.model.on_link(connected=False, at=at(11))
    assert recorded.last(Code.ROBOT_FORGOTTEN).robot == "ACME/r1"
    assert recorded.last(Code.LINK).values == {"connected": False}
