from __future__ import annotations

from typing import Any

import pytest

from nena_shared.vda5050.state import State
from nena_status_aggregator.fleet.events import state_changes
from support.fleet_examples import position, way
from support.fleet_records import state

ERROR = {"error_type": "orderError", "error_level": "CRITICAL", "error_description": "No way."}


def changes_of(before: State | None, now: State) -> dict[str, Any]:
    """Return the values of the changes by code."""
    return {change.code.value: change.values for change in state_changes(before, now)}


def action(status: str, name: str = "a1") -> dict[str, Any]:
    return {"action_id": name, "action_type": "pick", "action_status": status, "action_result": "box 7"}


CANCELLED = {"action_id": "c", "action_type": "cancelOrder", "action_status": "FINISHED"}
AT_THE_END: dict[str, Any] = {"order_id": "o1", "last_node_id": "B", "last_node_sequence_id": 2}


def test_first_state_only_raises_errors() -> None:
    first = state(order_id="o1", errors=(ERROR,), action_states=(action("FINISHED"),), **way("B"))
    assert changes_of(None, first) == {
        "errorRaised": {"errorType": "orderError", "errorLevel": "CRITICAL", "description": "No way."}
    }


def test_order_from_acceptance_to_end() -> None:
    free = state(last_node_id="A", last_node_sequence_id=0)
    taken = state(order_id="o1", last_node_id="A", **way("B", "C"))
    updated = state(order_id="o1", order_update_id=1, last_node_id="A", **way("B", "C"))
    under_way = state(
        order_id="o1", order_update_id=1, last_node_id="B", last_node_sequence_id=2, **way("C", first=4)
    )
    done = state(order_id="o1", order_update_id=1, last_node_id="C", last_node_sequence_id=4)

    assert changes_of(free, taken) == {"orderTaken": {"orderId": "o1", "orderUpdateId": 0}}
    assert changes_of(taken, updated) == {"orderUpdated": {"orderId": "o1", "orderUpdateId": 1}}
    assert changes_of(updated, under_way) == {"nodeReached": {"nodeId": "B", "sequenceId": 2}}
    assert changes_of(under_way, done) == {
        "orderEnded": {"orderId": "o1", "outcome": "completed"},
        "nodeReached": {"nodeId": "C", "sequenceId": 4},
    }


@pytest.mark.parametrize(
    ("end", "outcome"),
    [
        (state(order_id="o1", last_node_id="B", last_node_sequence_id=2), "completed"),
        (state(order_id="o1", last_node_id="A"), "abandoned"),
        (
            state(
                order_id="o1",
                last_node_id="B",
                last_node_sequence_id=2,
                action_states=(action("FAILED"),),
            ),
            "abandoned",
        ),
        (state(**AT_THE_END, instant_action_states=(CANCELLED,)), "abandoned"),
        (state(**AT_THE_END, action_states=(CANCELLED,)), "abandoned"),
        (state(**AT_THE_END, instant_action_states=({**CANCELLED, "action_status": "FAILED"},)), "completed"),
        (state(order_id="o2", last_node_id="B", **way("D")), "unseen"),
    ],
)
def test_how_an_order_ended(end: State, outcome: str) -> None:
    before = state(order_id="o1", last_node_id="A", action_states=(action("RUNNING"),), **way("B"))
    assert changes_of(before, end)["orderEnded"] == {"orderId": "o1", "outcome": outcome}


def test_the_cancellation_of_an_earlier_order_does_not_count() -> None:
    before = state(order_id="o1", last_node_id="A", instant_action_states=(CANCELLED,), **way("B"))
    end = state(**AT_THE_END, instant_action_states=(CANCELLED,))
    assert changes_of(before, end)["orderEnded"]["outcome"] == "completed"


def test_first_node_of_a_new_order_is_not_reached() -> None:
    before = state(order_id="o1", last_node_id="B", last_node_sequence_id=4)
    assert changes_of(before, state(order_id="o2", last_node_id="B", **way("C"))).keys() == {"orderTaken"}


@pytest.mark.parametrize("status", ["FINISHED", "FAILED"])
def test_an_action_ends_once(status: str) -> None:
    running = state(order_id="o1", action_states=(action("RUNNING"),), **way("B"))
    ended = state(order_id="o1", action_states=(action(status),), **way("B"))
    values = {"actionId": "a1", "actionType": "pick", "status": status, "result": "box 7"}
    assert changes_of(running, ended) == {"actionEnded": values}
    assert changes_of(ended, ended) == {}


def test_errors_are_raised_and_cleared() -> None:
    raised, cleared = state(errors=(ERROR,)), state()
    assert changes_of(cleared, raised).keys() == {"errorRaised"}
    assert changes_of(raised, cleared) == {
        "errorCleared": {"errorType": "orderError", "errorLevel": "CRITICAL"}
    }


def test_mode_charging_loads_and_map() -> None:
    before = state(mobile_robot_position=position(0, 0), loads=())
    now = state(
        operating_mode="MANUAL",
        power_supply={"state_of_charge": 20.0, "charging": True},
        loads=({"load_id": "box"},),
        mobile_robot_position={**position(0, 0), "map_id": "yard"},
    )
    assert changes_of(before, now) == {
        "operatingMode": {"mode": "MANUAL", "before": "AUTOMATIC"},
        "charging": {"charging": True, "charge": 20.0},
        "loads": {"loads": 1, "before": 0},
        "map": {"mapId": "yard", "before": "hall"},
    }
