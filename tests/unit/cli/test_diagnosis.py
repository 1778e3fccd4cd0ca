from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from nena_cli.diagnosis import explain_order, explain_vehicle, report_of, with_services
from nena_client import ServiceState
from nena_shared.fleet_api.stops import StopStatus
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.transport_order import (
    Hold,
    OrderOutcome,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import ProcessingState, VehicleState, VehicleStatus

NOW = datetime(2026, 1, 1, 12, tzinfo=UTC)


def vehicle(
    name: str, state: VehicleState = VehicleState.EXECUTING, *behind: str, **more: Any
) -> VehicleStatus:
    wait = TrafficWait(
        vehicles=behind, at="B", cause=WaitCause.PASSES, reason=f"waits for {', '.join(behind)}"
    )
    return VehicleStatus.model_validate(
        {
            "name": name,
            "manufacturer": "NeNa",
            "serial_number": name,
            "state": state,
            "processing_state": ProcessingState.IDLE,
            "connection": "ONLINE",
            "reason": "reason of " + name,
            "wait": wait if behind else None,
            **more,
        }
    )


def order(name: str, state: TransportOrderState, **more: Any) -> TransportOrderStatus:
    return TransportOrderStatus.model_validate(
        {
            "name": name,
            "version": 1,
            "state": state,
            "reason": "reason of " + name,
            "type": "-",
            "priority": 0,
            "drive_orders": (),
            "current_drive_order_index": -1,
            "created": NOW,
            **more,
        }
    )


def test_a_healthy_fleet_needs_nobody() -> None:
    fleet = [vehicle("V-1"), vehicle("V-2", VehicleState.IDLE), vehicle("V-3", VehicleState.EXECUTING, "V-1")]
    report = report_of(
        {"http://a": ServiceState("active, ready", healthy=True)},
        fleet,
        [order("T", TransportOrderState.ACTIVE)],
        NOW,
    )

    assert report.attention == ()
    assert report.waiting_vehicles == 1
    assert report.vehicles == {VehicleState.EXECUTING: 2, VehicleState.IDLE: 1}
    assert report.orders == {TransportOrderState.ACTIVE: 1}


def test_an_order_service_that_is_not_ready_comes_first() -> None:
    services = {
        "http://a": ServiceState("active, not ready, broker not connected", healthy=False),
        "http://b": ServiceState("standby", healthy=True),
    }
    found = report_of(services, [vehicle("V-1", VehicleState.ERROR)], [], NOW).attention

    assert [(each.name, each.state) for each in found] == [("http://a", "NOT READY"), ("V-1", "ERROR")]
    assert "broker not connected" in found[0].reason


def test_the_head_of_the_longest_queue_comes_first() -> None:
    fleet = [
        vehicle("V-1", VehicleState.ERROR, errors=("emergency stop",)),
        vehicle("V-2", VehicleState.UNAVAILABLE, operating_mode="MANUAL"),
        vehicle("V-3", VehicleState.EXECUTING, "V-2"),
        vehicle("V-4", VehicleState.UNKNOWN, connection="OFFLINE"),
        vehicle("V-5", VehicleState.UNKNOWN, connection="HIBERNATING"),
        vehicle("V-6", VehicleState.UNKNOWN, connection="UNKNOWN"),
    ]
    found = report_of({}, fleet, [], NOW).attention

    assert [(each.name, each.waiting_behind) for each in found] == [
        ("V-2", 1),
        ("V-1", 0),
        ("V-4", 0),
        ("V-6", 0),
    ]
    assert found[0].advice == "Switch the robot to AUTOMATIC."
    assert found[1].reason == "reason of V-1; emergency stop"
    assert "network" in found[2].advice
    assert "serial number" in found[3].advice


def test_a_circle_is_reported_once() -> None:
    fleet = [
        vehicle("V-1", VehicleState.EXECUTING, "V-2"),
        vehicle("V-2", VehicleState.EXECUTING, "V-1"),
        vehicle("V-3", VehicleState.EXECUTING, "V-1"),
    ]
    (found,) = report_of({}, fleet, [], NOW).attention

    assert "circle of waiting vehicles: V-1, V-2" in found.reason
    assert found.advice == "nena vehicles reroute V-1 --forced"
    assert explain_vehicle("V-3", {each.name: each for each in fleet}).advice == found.advice


def test_orders_that_need_a_person() -> None:
    hold = Hold(by="Ann", reason="tea", since=NOW)
    orders = [
        order("recent", TransportOrderState.FAILED, finished=NOW - timedelta(minutes=59)),
        order("parking", TransportOrderState.FAILED, finished=NOW, outcome=OrderOutcome.GAVE_WAY),
        order("not-wanted", TransportOrderState.FAILED, finished=NOW, outcome=OrderOutcome.WITHDRAWN),
        order("old", TransportOrderState.FAILED, finished=NOW - timedelta(minutes=61)),
        order("nowhere", TransportOrderState.UNROUTABLE, finished=NOW),
        order("held", TransportOrderState.ACTIVE, held=hold),
        order("late", TransportOrderState.BEING_PROCESSED, late=True),
        order("late-at-its-end", TransportOrderState.FINISHED, late=True, finished=NOW),
    ]
    found = report_of({}, [], orders, NOW).attention

    assert [(each.name, each.state) for each in found] == [
        ("recent", "FAILED"),
        ("nowhere", "UNROUTABLE"),
        ("held", "HELD"),
        ("late", "LATE"),
    ]


def test_a_waiting_vehicle_is_explained_to_the_head_of_its_queue() -> None:
    fleet = {
        "V-1": vehicle("V-1", VehicleState.EXECUTING, "V-2"),
        "V-2": vehicle("V-2", VehicleState.EXECUTING, "V-3"),
        "V-3": vehicle("V-3", VehicleState.ERROR, errors=("emergency stop",)),
    }
    found = explain_vehicle("V-1", fleet)

    assert [(each.name, each.state, each.reason) for each in found.steps] == [
        ("V-1", "WAITING", "waits for V-2"),
        ("V-2", "WAITING", "waits for V-3"),
        ("V-3", "ERROR", "reason of V-3; emergency stop"),
    ]
    assert "nena vehicles show V-3" in found.advice


def test_a_vehicle_behind_one_that_is_not_known() -> None:
    found = explain_vehicle("V-1", {"V-1": vehicle("V-1", VehicleState.EXECUTING, "foreign")})

    assert [each.name for each in found.steps] == ["V-1"]
    assert found.advice == ""


def test_an_order_is_explained_through_its_dependency_and_vehicle() -> None:
    fleet = {"V-1": vehicle("V-1", VehicleState.UNAVAILABLE, connection="SILENT")}
    orders = [
        order("T-2", TransportOrderState.ACTIVE),
        order("T-1", TransportOrderState.BEING_PROCESSED, processing_vehicle="V-1"),
    ]
    found = explain_order(orders, fleet)

    assert [each.name for each in found.steps] == ["T-2", "T-1", "V-1"]
    assert found.advice == "Check the robot's power, its network and its edge agent."


def test_a_held_order_is_resumed() -> None:
    hold = Hold(by="Ann", reason="tea", since=NOW)
    assert explain_order([order("T", TransportOrderState.ACTIVE, held=hold)], {}).advice == (
        "nena orders resume T"
    )


def test_an_order_without_a_vehicle_says_its_own_reason() -> None:
    (step,) = explain_order([order("T", TransportOrderState.DISPATCHABLE)], {}).steps
    assert step.reason == "reason of T"


def test_an_order_service_that_is_not_ready_is_the_root() -> None:
    found = explain_order([order("T", TransportOrderState.DISPATCHABLE)], {})
    ready = ServiceState("active, ready", healthy=True)
    broken = ServiceState("active, not ready, The MQTT broker is not connected", healthy=False)

    assert with_services(found, {"http://a": ready}) == found
    root = with_services(found, {"http://a": ready, "http://b": broken})
    assert [(each.name, each.state) for each in root.steps] == [
        ("T", "DISPATCHABLE"),
        ("http://b", "NOT READY"),
    ]
    assert root.advice.startswith("Check the order service")


EMERGENCY = {"active_emergency_stop": "MANUAL"}
LOCKED = {"code": "but", "causes": [{"code": "travels"}, {"code": "path_locked", "causes": []}]}


@pytest.mark.parametrize(
    ("more", "state", "told", "advice"),
    [
        (EMERGENCY, "BLOCKED", "emergency stop MANUAL", "reset it when everyone is safe"),
        ({"active_emergency_stop": "REMOTE"}, "BLOCKED", "emergency stop REMOTE", "reset it"),
        ({"field_violation": True}, "BLOCKED", "protective field", "Go to the robot"),
        ({"paused": True}, "BLOCKED", "paused", "Go to the robot"),
        ({"localized": False}, "BLOCKED", "not localised", "Set its position"),
        ({"errors": ("CRITICAL bumper",)}, "ERROR", "CRITICAL bumper", "Go to the robot"),
        ({"taken_out": True}, "ERROR", "reason of V-1", "nena vehicles level V-1 TO_BE_UTILIZED"),
        (
            {"state": VehicleState.UNKNOWN, "connection": "UNREADABLE"},
            "UNKNOWN",
            "reason of V-1",
            "Compare its messages with VDA 5050",
        ),
        (
            {"state": VehicleState.UNAVAILABLE, "operating_mode": "MANUAL"},
            "UNAVAILABLE",
            "reason of V-1",
            "Switch the robot to AUTOMATIC.",
        ),
        ({"state": VehicleState.ERROR}, "ERROR", "reason of V-1", "Go to the robot"),
        (
            {"state": VehicleState.IDLE, "coded_reason": {"code": "must_recharge"}},
            "IDLE",
            "reason of V-1",
            "charging station",
        ),
        ({"coded_reason": LOCKED}, "EXECUTING", "reason of V-1", "Unlock the path"),
    ],
)
def test_what_holds_a_robot_needs_a_person_with_all_who_wait_behind_it(
    more: dict[str, Any], state: str, told: str, advice: str
) -> None:
    fleet = [
        vehicle("V-1", **more),
        vehicle("V-2", VehicleState.EXECUTING, "V-1"),
        vehicle("V-3", VehicleState.EXECUTING, "V-2"),
    ]
    (found,) = report_of({}, fleet, [], NOW).attention

    assert (found.name, found.state, found.waiting_behind) == ("V-1", state, 2)
    assert told in found.reason
    assert advice in found.advice
    assert advice in explain_vehicle("V-3", {each.name: each for each in fleet}).advice


def test_an_emergency_stop_at_the_head_of_a_queue_counts_although_it_waits_itself() -> None:
    fleet = [
        vehicle("V-1", VehicleState.EXECUTING, "V-4", **EMERGENCY),
        vehicle("V-2", VehicleState.EXECUTING, "V-1", "V-4"),
        vehicle("V-4"),
    ]
    (found,) = report_of({}, fleet, [], NOW).attention

    assert (found.name, found.waiting_behind) == ("V-1", 1)
    assert "waits for V-4" not in found.reason


def test_a_stop_is_reported_once_and_not_for_each_robot() -> None:
    stop = {"name": "stop-1", "by": "Anna", "reason": "fire drill"}
    fleet = [
        vehicle(f"V-{number}", paused=True, stop={**stop, "area": False}, reason="is stopped")
        for number in range(3)
    ]
    status = StopStatus.model_validate({**stop, "since": NOW})
    (found,) = report_of({}, fleet, [], NOW, [status]).attention

    assert (found.name, found.state, found.advice) == ("stop-1", "STOPPED", "nena stops end stop-1")
    assert found.reason == "all robots are paused by Anna: fire drill"


@pytest.mark.parametrize(
    "more",
    [
        {"active_emergency_stop": "NONE", "localized": True},
        {"localized": None},
        {"errors": ("WARNING dust", "URGENT filter")},
        {"state": VehicleState.CHARGING, "coded_reason": {"code": "recharges"}},
    ],
)
def test_what_needs_nobody(more: dict[str, Any]) -> None:
    assert report_of({}, [vehicle("V-1", **more)], [], NOW).attention == ()
