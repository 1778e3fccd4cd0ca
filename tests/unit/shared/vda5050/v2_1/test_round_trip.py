"""Whatever a neutral message holds: 2.1 carries it as far as it can, in a form its schema takes."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.base import Header, WireObject
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1 import CODEC
from nena_shared.vda5050.v2_1.error_type import REJECTIONS, WRITTEN
from nena_shared.vda5050.visualization import Visualization
from support.messages import messages
from support.schemas import schema_problems

SCHEMAS: dict[type[Header], str] = {
    Order: "order",
    InstantActions: "instantActions",
    State: "state",
    Visualization: "visualization",
    Connection: "connection",
    Factsheet: "factsheet",
}
ONLY_IN_2_1 = {"start_node_id", "end_node_id"}
NOT_IN_2_1 = {
    "order_description": None,
    "retriable": None,
    "release_required": None,
    "release_loss_behavior": None,
    "planned_path": None,
    "intermediate_path": None,
    "battery_current": None,
    "supported_zones": None,
    "reference_state_header_id": 0,
    "pause_allowed": False,
    "cancel_allowed": False,
}
NEAREST = {
    "blocking_type": {"SINGLE": "HARD"},
    "action_status": {"RETRIABLE": "RUNNING"},
    "connection_state": {"HIBERNATING": "ONLINE"},
    "operating_mode": {"STARTUP": "SERVICE", "INTERVENED": "AUTOMATIC"},
}


def plain(value: Any) -> Any:
    """Take a message apart into names and values, without what only a version adds."""
    if isinstance(value, WireObject):
        names = set(type(value).model_fields) - ONLY_IN_2_1
        return {name: plain(getattr(value, name)) for name in names}
    return [plain(each) for each in value] if isinstance(value, tuple) else value


def nearest(value: Any) -> Any:
    """Give what 2.1 can say of a plain message, as the digest of the standard has it."""
    if isinstance(value, list):
        return [nearest(each) for each in value]
    if isinstance(value, datetime):
        return value.replace(microsecond=value.microsecond // 10_000 * 10_000)
    if not isinstance(value, dict):
        return value
    result = {name: _nearest_name(name, each) for name, each in value.items()}
    result |= {name: each for name, each in NOT_IN_2_1.items() if name in value}
    for special in (_deviation, _corridor, _trajectory, _blocking_types, _scopes, _error, _state):
        special(result)
    return {name: each if name == "value" else nearest(each) for name, each in result.items()}


def _nearest_name(field: str, value: Any) -> Any:
    return NEAREST.get(field, {}).get(value, value) if isinstance(value, str) else value


def _deviation(value: dict[str, Any]) -> None:
    if ellipse := value.get("allowed_deviation_xy"):
        radius = min(ellipse["a"], ellipse["b"])
        value["allowed_deviation_xy"] = {"a": radius, "b": radius, "theta": 0.0}


def _corridor(value: dict[str, Any]) -> None:
    if (value.get("corridor") or {}).get("release_required"):
        value["corridor"] = None


def _trajectory(value: dict[str, Any]) -> None:
    if "control_points" not in value:
        return
    degree = value["degree"] = value["degree"] or 1
    if value["knot_vector"] is None:
        spans = len(value["control_points"]) - degree
        inner = [number / spans for number in range(1, spans)]
        value["knot_vector"] = [0.0] * (degree + 1) + inner + [1.0] * (degree + 1)


def _blocking_types(value: dict[str, Any]) -> None:
    if types := value.get("blocking_types"):
        value["blocking_types"] = ["HARD" if each == "SINGLE" else each for each in types]


def _scopes(value: dict[str, Any]) -> None:
    if "action_scopes" in value:
        value["action_scopes"] = [each for each in value["action_scopes"] if each != "ZONE"]


def _error(value: dict[str, Any]) -> None:
    if "error_type" in value:
        mild = value["error_level"] in ("WARNING", "URGENT") or value["error_type"] in REJECTIONS
        value["error_level"] = "WARNING" if mild else "FATAL"
        value["error_type"] = WRITTEN.get(value["error_type"], value["error_type"])


def _state(value: dict[str, Any]) -> None:
    if "instant_action_states" in value:
        value["action_states"] = value["action_states"] + value["instant_action_states"]
        value["instant_action_states"] = []


@pytest.mark.parametrize("kind", CODEC.forms)
@given(st.data())
def test_message_arrives_as_the_nearest_that_2_1_can_say(kind: type[Header], data: st.DataObject) -> None:
    message = data.draw(messages(kind))
    expected = nearest(plain(message)) | {"version": "2.1.0"}
    if isinstance(message, State) and message.operating_mode == "INTERVENED":
        expected["paused"] = True

    assert plain(CODEC.decode(kind, CODEC.encode(message))) == expected


@pytest.mark.parametrize("kind", CODEC.forms)
@settings(max_examples=50)
@given(st.data())
def test_encoded_message_keeps_the_official_schema(kind: type[Header], data: st.DataObject) -> None:
    payload = CODEC.encode(data.draw(messages(kind)))

    assert schema_problems("2.1.0", SCHEMAS[kind], payload) == []


@pytest.mark.parametrize("kind", CODEC.forms)
@settings(max_examples=50)
@given(st.data())
def test_what_was_read_can_be_written_again_unchanged(kind: type[Header], data: st.DataObject) -> None:
    payload = CODEC.encode(data.draw(messages(kind)))

    assert CODEC.encode(CODEC.decode(kind, payload)) == payload


@pytest.mark.parametrize("kind", CODEC.forms)
@given(st.data())
def test_garbled_message_never_breaks_the_reader(kind: type[Header], data: st.DataObject) -> None:
    payload = bytearray(CODEC.encode(data.draw(messages(kind))))
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    outcome: Header | MalformedMessageError
    try:
        outcome = CODEC.decode(kind, bytes(payload))
    except MalformedMessageError as error:
        outcome = error

    assert outcome.problems if isinstance(outcome, MalformedMessageError) else isinstance(outcome, kind)
