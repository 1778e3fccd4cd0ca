"""Whether a robot can be sent an order, and why not."""

from __future__ import annotations

from typing import Any

import pytest

from nena_conversations.kit.honest_robot import HonestRobot
from nena_order_service.fleet.availability import significant_fields, vehicle_state_of
from nena_order_service.fleet.outputs import RobotChanged
from nena_order_service.fleet.robot import POSITION_WITHIN, LinkStatus, VdaOrderPhase
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel
from nena_shared.vda5050.state import OperatingMode
from support.fleet import Bench, make_action, make_vda_order
from support.fleet_examples import position, power, state


def reason(bench: Bench) -> str | None:
    """Return the reason why the robot cannot take an order; None if it can."""
    bench.report()
    told = bench.view().availability
    return None if told.can_take_order else str(told.reason)


def test_an_idle_online_robot_can_take_an_order() -> None:
    bench = Bench().online()
    assert str(bench.view().availability.reason) == "is free"
    assert bench.view().vehicle_state is VehicleState.IDLE


def test_a_robot_that_is_not_connected_has_a_reason() -> None:
    bench = Bench()
    assert "no connection to the MQTT broker" in str(bench.view().availability.reason)
    bench.set_broker(connected=True)
    assert str(bench.view().availability.reason) == "has never connected"
    bench.connection(ConnectionState.ONLINE)
    assert str(bench.view().availability.reason) == "has not reported its state yet"
    assert bench.view().vehicle_state is VehicleState.UNKNOWN


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("localized", False, "is not localised: set its initial position"),
        ("has_pose", False, "is not localised: set its initial position"),
        ("paused", True, "is paused"),
    ],
)
def test_a_robot_that_cannot_drive(field: str, value: object, expected: str) -> None:
    bench = Bench().online()
    setattr(bench.robot, field, value)
    assert reason(bench) == expected


@pytest.mark.clause("6.6.6/fleet")
@pytest.mark.parametrize("mode", [OperatingMode.MANUAL, OperatingMode.SERVICE, OperatingMode.TEACH_IN])
def test_modes_without_fleet_control(mode: OperatingMode) -> None:
    bench = Bench().online()
    bench.robot.set_mode(mode)
    words = mode.lower().replace("_", " ")
    assert reason(bench) == f"is in operating mode {words}, which takes no orders"
    assert bench.view().vehicle_state is VehicleState.UNAVAILABLE


@pytest.mark.clause("6.6.8")
def test_a_foreign_order() -> None:
    bench = Bench().online()
    other = Bench(robot=bench.robot).online()
    other.start(make_vda_order("theirs", "A", "B"))
    other.deliver()
    assert reason(bench) == "still works on the order 'theirs'"
    assert bench.instants_sent() == [], "it is none of our business"


def test_a_vda_order_of_our_own() -> None:
    bench = Bench().online()
    bench.start(make_vda_order("m", "A", "B"))
    assert reason(bench) == "works on the VDA order 'm'"


@pytest.mark.clause("6.6.5.1/fleet")
def test_a_fatal_error() -> None:
    bench = Bench().online()
    bench.robot.errors.append(
        ErrorEntry(
            error_type="wheelLost",
            error_level=ErrorLevel.FATAL,
            error_description="left",
            error_hint="find it",
        )
    )
    assert reason(bench) == "has a fatal error: wheelLost: left (find it)"
    assert bench.view().vehicle_state is VehicleState.ERROR


def test_a_robot_that_never_reports_its_position_can_take_an_order() -> None:
    bench = Bench(robot=HonestRobot(has_pose=False)).online()
    assert reason(bench) is None


def test_a_reconnected_robot_takes_orders_once_it_has_reported_its_state() -> None:
    bench = Bench().online()
    bench.now += 1.0
    bench.connection(ConnectionState.ONLINE)
    assert str(bench.view().availability.reason) == "has not reported its state since it connected"
    assert reason(bench) is None
    bench.connection(ConnectionState.ONLINE)
    assert str(bench.view().availability.reason) == "is free", "the broker has kept that one"


def test_a_robot_that_reports_no_position_any_more_since_it_connected_can_take_an_order() -> None:
    bench = Bench().online()
    bench.robot.has_pose = False
    bench.wait(POSITION_WITHIN + 5, reporting=True)
    assert reason(bench) == "is not localised: set its initial position", "it has not connected again"
    bench.connection(ConnectionState.ONLINE)
    bench.wait(POSITION_WITHIN - 5, reporting=True)
    assert reason(bench) == "is not localised: set its initial position"
    bench.news.clear()
    bench.wait(10, reporting=True)
    assert reason(bench) is None
    assert len(bench.told(RobotChanged)) == 1

    bench.robot.has_pose = True
    assert reason(bench) is None
    bench.robot.has_pose = False
    assert reason(bench) == "is not localised: set its initial position"


def test_a_paused_robot_is_still_sent_its_vda_order() -> None:
    bench = Bench().online()
    bench.robot.paused = True
    bench.report()
    bench.start(make_vda_order("m", "A", "B"))
    assert bench.orders_sent() == ["m"]


@pytest.mark.clause("6.6.8")
def test_a_running_instant_action_does_not_keep_a_robot_from_orders() -> None:
    bench = Bench().online()
    action = make_action("startCharging", "c")
    bench.instruct(action)
    bench.robot.instants["c"] = (action, ActionStatus.RUNNING)
    assert reason(bench) is None


@pytest.mark.clause("6.6.8")
@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({}, VehicleState.IDLE),
        ({"power_supply": {"state_of_charge": 8.0, "charging": True}}, VehicleState.CHARGING),
        (
            {"node_states": [{"node_id": "B", "sequence_id": 2, "released": True}]},
            VehicleState.EXECUTING,
        ),
        ({"action_states": [{"action_id": "a", "action_status": "RUNNING"}]}, VehicleState.EXECUTING),
        ({"action_states": [{"action_id": "a", "action_status": "RETRIABLE"}]}, VehicleState.EXECUTING),
        ({"action_states": [{"action_id": "a", "action_status": "FAILED"}]}, VehicleState.IDLE),
    ],
)
def test_the_vehicle_state_of_opentcs(fields: dict[str, Any], expected: VehicleState) -> None:
    assert vehicle_state_of(state(**fields), LinkStatus.ONLINE, ()) is expected


def place(x: float, **fields: Any) -> dict[str, Any]:
    return {"mobile_robot_position": {**position(x, 0.0), **fields}}


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
def test_continuously_changing_fields_are_not_significant(
    before: dict[str, Any], after: dict[str, Any]
) -> None:
    assert significant_fields(state(**before)) == significant_fields(state(**after))


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
def test_fields_used_by_vda_orders_and_events_are_significant(fields: dict[str, Any]) -> None:
    plain = {**place(1.0), **power(80.0), "driving": False}
    assert significant_fields(state(**plain)) != significant_fields(state(**{**plain, **fields}))


def test_the_first_remaining_node_represents_all() -> None:
    assert significant_fields(state(**to_come(2, 4))) != significant_fields(state(**to_come(4)))


def test_unchanged_states_still_count_as_received() -> None:
    bench = Bench().online()
    bench.start_and_tell(make_vda_order("m", "A", "B", "C"))
    for _ in range(3):
        bench.now += 1.0
        told = bench.report()
        assert not told
        assert bench.view().state_at == bench.now
        assert bench.view().order_phase is VdaOrderPhase.RUNNING
