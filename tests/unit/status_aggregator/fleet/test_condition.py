from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import pytest

from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.stops import VehicleStop
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.state import State
from nena_status_aggregator.fleet.condition import (
    Condition,
    ConditionInputs,
    RosSession,
    SessionState,
    assess_condition,
    ros_session,
    session_of,
)
from support.fleet_examples import START, position, way
from support.fleet_records import state


def inputs_of(**fields: Any) -> ConditionInputs:
    inputs: dict[str, Any] = {
        "connection": ConnectionState.ONLINE,
        "connection_since": datetime(2026, 1, 1, 8, tzinfo=UTC),
        "state": state(),
        "state_time": datetime(2026, 1, 1, 8, 0, 5, tzinfo=UTC),
        "state_after_connection": True,
        "overdue": False,
        "silence_limit": 35.0,
        "link_up": True,
        **fields,
    }
    return ConditionInputs(**inputs)


def conclude(**fields: Any) -> tuple[Condition, str]:
    condition, reason = assess_condition(inputs_of(**fields))
    return condition, reason.text


def conclude_of(**fields: Any) -> tuple[Condition, str]:
    return conclude(state=state(**fields))


def test_free() -> None:
    assert conclude() == (Condition.IDLE, "No order.")


def test_idle_reason_is_that_of_the_order_service() -> None:
    assert conclude(fleet_remark="No order waits.") == (Condition.IDLE, "No order waits.")


@pytest.mark.parametrize("charging", [False, True])
def test_a_robot_that_the_order_service_has_taken_out_needs_a_person(charging: bool) -> None:  # noqa: FBT001
    power = {"state_of_charge": 50.0, "charging": charging}
    condition, reason = assess_condition(
        inputs_of(state=state(power_supply=power), taken_out=True, fleet_remark="was taken out")
    )

    assert (condition, reason.code, reason.text) == (Condition.ERROR, "taken_out", "was taken out")
    assert reason.urgent


def test_a_robot_that_was_taken_out_may_still_make_room() -> None:
    driving = conclude(state=state(driving=True), taken_out=True, fleet_remark="was taken out")
    assert driving == (Condition.BUSY, "Driving without an order.")


def test_silent_reason_has_its_start() -> None:
    assert conclude(overdue=True) == (
        Condition.SILENT,
        "No state since 08:00:05 UTC (limit: 35 s).",
    )


def test_silence_is_attributed_to_a_lost_broker_connection() -> None:
    condition, text = conclude(overdue=True, link_up=False)
    assert condition is Condition.SILENT
    assert "not connected to the broker" in text


def test_no_state_ever() -> None:
    first = "No state received yet; waiting for the first one for up to 35 s."
    assert conclude(state=None) == (Condition.SILENT, first)
    condition, text = conclude(state=None, overdue=True)
    assert condition is Condition.SILENT
    assert text == "No state received yet."


def test_vehicle_known_only_to_the_order_service_is_not_silent() -> None:
    condition, text = conclude(state=None, connection=None, fleet_remark="Never connected.")
    assert condition is Condition.OFFLINE
    assert text.startswith("Never connected")


def test_unheard_robot_shows_the_similar_topic_on_which_a_message_came() -> None:
    reason = Reason(ReasonCode.OTHER_TOPIC, topic="uagv/v2/ACME/R1/state", expected="uagv/v2/ACME/r1/state")
    remark = {"fleet_remark": str(reason), "coded_remark": reason.coded}
    condition, text = conclude(state=None, connection=None, **remark)
    assert condition is Condition.OFFLINE
    assert "'uagv/v2/ACME/R1/state' instead of 'uagv/v2/ACME/r1/state'" in text


def test_no_state_that_could_be_read() -> None:
    condition, text = conclude(state=None, problem="headerId: missing")
    assert (condition, text) == (Condition.ERROR, "Unreadable state: headerId: missing")


def test_broken_by_the_will_even_while_the_last_state_is_fresh() -> None:
    condition, text = conclude(connection=ConnectionState.CONNECTION_BROKEN, state_after_connection=False)
    assert condition is Condition.BROKEN
    assert "08:00:00 UTC" in text


def test_a_robot_that_still_sends_states_is_not_broken() -> None:
    connection = ConnectionState.CONNECTION_BROKEN
    assert conclude(connection=connection, state_after_connection=True)[0] is Condition.IDLE


@pytest.mark.parametrize(
    ("connection", "word"),
    [(ConnectionState.OFFLINE, "Disconnected"), (ConnectionState.HIBERNATING, "Hibernating")],
)
def test_disconnected_robot_is_not_silent(connection: ConnectionState, word: str) -> None:
    condition, text = conclude(connection=connection, overdue=True)
    assert condition is Condition.OFFLINE
    assert text.startswith(word)


@pytest.mark.parametrize("mode", ["MANUAL", "SERVICE", "TEACH_IN", "STARTUP", "INTERVENED"])
def test_modes_without_fleet_control(mode: str) -> None:
    condition, text = conclude_of(operating_mode=mode, **way("B"))
    assert condition is Condition.MANUAL
    assert mode in text


def test_semiautomatic_is_under_fleet_control() -> None:
    assert conclude_of(operating_mode="SEMIAUTOMATIC")[0] is Condition.IDLE


BEHIND = TrafficWait(vehicles=("V-2", "V-3"), at="B", cause=WaitCause.STANDS, reason="it waits")


def test_a_robot_whose_next_node_is_not_released_waits() -> None:
    condition, text = conclude_of(last_node_id="A", driving=False, **way("B", released=0))
    assert (condition, text) == (Condition.WAITING, "Waiting at A until B is released.")


def test_waiting_reason_names_the_vehicles() -> None:
    waits = state(last_node_id="A", **way("B", released=0))
    condition, text = conclude(state=waits, transport_order="T-1", wait=BEHIND)
    assert (condition, text) == (Condition.WAITING, "Blocked at B by V-2, V-3.")


def test_a_robot_between_two_drive_orders_is_not_idle() -> None:
    assert conclude(transport_order="T-1") == (Condition.BUSY, "Has order T-1.")
    assert conclude(transport_order="T-1", wait=BEHIND)[0] is Condition.WAITING
    locked = TrafficWait(reason="path 'A --- B' is locked")
    assert conclude(transport_order="T-1", wait=locked) == (
        Condition.WAITING,
        "Order T-1: path 'A --- B' is locked.",
    )


def test_evading_robot_without_an_order_waits_only_for_other_robots() -> None:
    assert conclude(wait=TrafficWait(reason="it makes room"))[0] is Condition.IDLE
    assert conclude(wait=BEHIND)[0] is Condition.WAITING


@pytest.mark.parametrize(
    ("fields", "condition"),
    [
        ({"driving": True, **way("B", released=0)}, Condition.BUSY),
        (way("B", "C", released=1), Condition.BUSY),
        ({"power_supply": {"state_of_charge": 20.0, "charging": True}}, Condition.WAITING),
        ({"operating_mode": "MANUAL"}, Condition.MANUAL),
        ({"paused": True, **way("B", released=0)}, Condition.BLOCKED),
        (
            {"action_states": ({"action_id": "a", "action_type": "pick", "action_status": "RUNNING"},)},
            Condition.BUSY,
        ),
    ],
)
def test_driving_working_or_stuck_robot_does_not_wait(fields: dict[str, Any], condition: Condition) -> None:
    assert conclude(state=state(**fields), transport_order="T-1", wait=BEHIND)[0] is condition


def test_a_robot_that_charges_for_its_order_charges() -> None:
    charging = state(power_supply={"state_of_charge": 20.0, "charging": True})
    assert conclude(state=charging, transport_order="Recharge-1")[0] is Condition.CHARGING


@pytest.mark.parametrize(
    ("fields", "urgent"),
    [
        ({"safety_state": {"active_emergency_stop": "MANUAL", "field_violation": False}}, True),
        ({"errors": ({"error_type": "lost", "error_level": "FATAL"},)}, True),
        ({"mobile_robot_position": position(0, 0, localized=False)}, True),
        ({"paused": True}, False),
        ({"safety_state": {"active_emergency_stop": "NONE", "field_violation": True}}, False),
        ({"errors": ({"error_type": "dust", "error_level": "WARNING"},)}, False),
        ({}, False),
    ],
)
def test_emergency_stop_error_and_lost_position_are_urgent(fields: dict[str, Any], *, urgent: bool) -> None:
    inputs = ConditionInputs(
        connection=ConnectionState.ONLINE,
        connection_since=START,
        state=state(**fields),
        state_time=START,
        state_after_connection=True,
        overdue=False,
        silence_limit=35.0,
        link_up=True,
    )
    assert assess_condition(inputs)[1].urgent is urgent


def test_the_worst_error_is_the_reason() -> None:
    errors = (
        {"error_type": "small", "error_level": "WARNING"},
        {
            "error_type": "nodeUnreachable",
            "error_level": "FATAL",
            "error_description": "No way to B.",
            "error_hint": "Clear the aisle.",
        },
    )
    assert conclude_of(errors=errors, driving=True) == (
        Condition.ERROR,
        "nodeUnreachable: No way to B. Clear the aisle.",
    )


@pytest.mark.parametrize("level", ["WARNING", "URGENT"])
def test_warnings_do_not_change_the_status(level: str) -> None:
    errors = ({"error_type": "small", "error_level": level},)
    assert conclude_of(errors=errors)[0] is Condition.IDLE


@pytest.mark.parametrize(
    ("fields", "word"),
    [
        ({"safety_state": {"active_emergency_stop": "MANUAL", "field_violation": False}}, "at the robot"),
        ({"safety_state": {"active_emergency_stop": "REMOTE", "field_violation": False}}, "remotely"),
        ({"safety_state": {"active_emergency_stop": "NONE", "field_violation": True}}, "Protective field"),
        ({"mobile_robot_position": position(0, 0, localized=False)}, "Not localised"),
        ({"paused": True}, "Paused"),
    ],
)
def test_blocked_reason_has_the_cause(fields: dict[str, Any], word: str) -> None:
    condition, text = conclude_of(**fields, **way("B"))
    assert condition is Condition.BLOCKED
    assert word in text


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"driving": True, **way("B", "C")}, "Driving to B."),
        ({"driving": False, **way("B")}, "Stopped at A on the way to B."),
        ({"driving": True}, "Driving without an order."),
    ],
)
def test_busy_reason_has_the_activity(fields: dict[str, Any], text: str) -> None:
    assert conclude_of(last_node_id="A", **fields) == (Condition.BUSY, text)


@pytest.mark.parametrize(
    ("status", "text"), [("RUNNING", "Running pick at A."), ("WAITING", "Waiting at A to start pick.")]
)
def test_busy_with_an_action(status: str, text: str) -> None:
    actions = (
        {"action_id": "1", "action_type": "beep", "action_status": "FINISHED"},
        {"action_id": "2", "action_type": "pick", "action_status": status},
    )
    assert conclude_of(last_node_id="A", action_states=actions) == (Condition.BUSY, text)


def test_running_action_explains_a_stationary_robot() -> None:
    actions = (
        {"action_id": "1", "action_type": "drop", "action_status": "WAITING"},
        {"action_id": "2", "action_type": "pick", "action_status": "RUNNING"},
    )
    assert conclude_of(last_node_id="A", action_states=actions, **way("B"))[1] == "Running pick at A."


def test_node_at_a_coordinate_is_shown_as_coordinate() -> None:
    node = {
        "node_id": "goal:TOrder-0",
        "sequence_id": 2,
        "released": True,
        "node_position": {"x": 10.662, "y": 3.33, "map_id": "hall"},
    }
    assert conclude_of(driving=True, node_states=(node,))[1] == "Driving to x 10.66, y 3.33."


def test_charging_while_there_is_nothing_else() -> None:
    power = {"state_of_charge": 41.6, "charging": True}
    assert conclude_of(power_supply=power) == (Condition.CHARGING, "Battery at 42 %.")
    assert conclude_of(power_supply=power, driving=True, **way("B"))[0] is Condition.BUSY


def test_braces_of_a_robots_text_do_no_harm() -> None:
    errors = ({"error_type": "{x}", "error_level": "FATAL", "error_description": "{0} {type}"},)
    assert conclude_of(errors=errors)[1] == "{x}: {0} {type}"


BLIND = state(errors=({"error_type": "NAVIGATION_NOT_AVAILABLE", "error_level": "WARNING"},))


def reporting(name: str, **fields: Any) -> State:
    """Return a state of a robot whose edge agent reports its ROS session."""
    facts = {"state": name, "namespace": "/r1", "domainId": "7"}
    references = [{"reference_key": key, "reference_value": value} for key, value in facts.items()]
    entry = {"info_type": "rosSession", "info_level": "INFO", "info_references": references}
    return state(information=(entry,), **fields)


@pytest.mark.parametrize(
    ("condition", "last", "session"),
    [
        (Condition.OFFLINE, state(), "NOT_ACTIVE"),
        (Condition.BROKEN, state(), "FAILED"),
        (Condition.SILENT, None, "INITIATING"),
        (Condition.SILENT, state(), "FAILED"),
        (Condition.IDLE, state(), "ACTIVE"),
        (Condition.MANUAL, state(), "ACTIVE"),
        (Condition.IDLE, BLIND, "FAILED"),
        *((Condition.IDLE, reporting(each), each) for each in SessionState),
        (Condition.IDLE, reporting("ACTIVE", errors=BLIND.errors), "ACTIVE"),
        (Condition.IDLE, reporting("DREAMING"), "ACTIVE"),
        (Condition.SILENT, reporting("ACTIVE"), "FAILED"),
        (Condition.OFFLINE, reporting("ACTIVE"), "NOT_ACTIVE"),
    ],
)
def test_the_state_of_a_node(condition: Condition, last: State | None, session: str) -> None:
    assert session_of(condition, last).value == session


def test_ros_session_of_a_state() -> None:
    assert ros_session(reporting("FAILED")) == RosSession(SessionState.FAILED, "/r1", "7")
    assert ros_session(state()) is None


def test_a_robot_whose_states_are_unreadable_is_not_silent() -> None:
    condition, text = conclude(overdue=True, unreadable="state: orderId: is missing")
    assert condition is Condition.ERROR
    assert text.endswith("state: orderId: is missing")


@pytest.mark.parametrize(
    ("area", "text"),
    [
        (False, "Paused with all robots by Anna: fire drill"),
        (True, "Paused with this area by Anna: fire drill"),
    ],
)
def test_stopped_robot_has_who_and_why(*, area: bool, text: str) -> None:
    stop = VehicleStop(name="stop-1", by="Anna", reason="fire drill", area=area)
    assert conclude(state=state(paused=True), stop=stop) == (Condition.BLOCKED, text)
    assert conclude(state=state(), stop=stop)[0] is Condition.IDLE, "it is not paused yet"
