"""What is read, what is refused, and with which words."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import Any

import pytest
from pydantic import ValidationError

from nena_shared.vda5050.action import ActionParameter, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD
from nena_shared.vda5050.malformed import PROBLEMS_SHOWN, REFERENCE_LENGTH, MalformedMessageError
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1 import CODEC

JsonObject = dict[str, Any]


def read(kind: type[Header], content: object) -> Any:
    return CODEC.decode(kind, json.dumps(content).encode())


def refusal(kind: type[Header], content: object) -> MalformedMessageError:
    payload = content if isinstance(content, bytes) else json.dumps(content).encode()
    with pytest.raises(MalformedMessageError) as caught:
        CODEC.decode(kind, payload)
    return caught.value


@pytest.mark.clause("7.3")
def test_minimal_order_is_read(order: JsonObject) -> None:
    message = read(Order, order)

    assert (message.order_id, message.order_update_id) == ("o1", 0)
    assert [node.node_id for node in message.nodes] == ["A", "B"]
    assert message.nodes[1].node_position.x == 5.0
    assert message.edges[0].edge_id == "A-B"


@pytest.mark.clause("7.8")
def test_smallest_state_is_read(state: JsonObject) -> None:
    message = read(State, state)

    assert message.power_supply.state_of_charge == 80.0
    assert message.loads is None
    assert message.instant_action_states == ()


@pytest.mark.clause("7.2/timestamp")
@pytest.mark.parametrize(
    ("written", "microsecond"),
    [
        ("2026-01-01T00:00:05Z", 0),
        ("2026-01-01T00:00:05.1Z", 100_000),
        ("2026-01-01T00:00:05.12Z", 120_000),
        ("2026-01-01T00:00:05.123Z", 123_000),
        ("2026-01-01T00:00:05.123456Z", 123_456),
        ("2026-01-01T00:00:05.123456789Z", 123_456),
        ("2026-01-01T00:00:05.5", 500_000),
        ("2026-01-01T02:00:05.5+02:00", 500_000),
    ],
)
def test_timestamp_is_read_with_any_decimals_and_as_utc_without_zone(
    state: JsonObject, written: str, microsecond: int
) -> None:
    message = read(State, state | {"timestamp": written})

    assert message.timestamp == datetime(2026, 1, 1, 0, 0, 5, microsecond, UTC)
    assert message.timestamp.tzinfo is UTC


@pytest.mark.clause("7.2/timestamp")
def test_early_years_are_written_with_four_digits(state: JsonObject) -> None:
    message = read(State, state | {"timestamp": "0009-01-01T00:00:00.999Z"})

    assert json.loads(CODEC.encode(message))["timestamp"] == "0009-01-01T00:00:00.99Z"


REFUSED: dict[str, list[object]] = {
    "timestamp": [
        *("yesterday", "2026-01-01", "", 5, None),
        *("0001-01-01T00:00:00+01:00", "9999-12-31T23:59:59-01:00"),
    ],
    "orderUpdateId": [True, "1", 1.0, -1, 2**32, None, [], 10**400],
    "distanceSinceLastNode": [True, "1.5", float("nan"), float("inf"), -0.1, [], 10**400],
    "driving": [0, 1, "true", None],
    "operatingMode": ["automatic", "FLYING", 0, None],
    "version": ["2", "2.1", "two", "2.1.0.0", 2.1, "2." + "1" * 40 + ".0"],
}


@pytest.mark.clause("7.1/types", "7.2/timestamp")
@pytest.mark.parametrize(
    ("field", "value"), [(field, value) for field, values in REFUSED.items() for value in values]
)
def test_value_of_another_type_or_beyond_its_limits_is_refused(
    state: JsonObject, field: str, value: object
) -> None:
    assert refusal(State, state | {field: value}).problems[0].startswith(f"{field}: ")


@pytest.mark.clause("7.1/types")
def test_an_integer_is_a_number(state: JsonObject) -> None:
    assert read(State, state | {"distanceSinceLastNode": 3}).distance_since_last_node == 3.0


@pytest.mark.clause("7.1/unknown")
def test_unknown_fields_are_ignored(order: JsonObject) -> None:
    order["vendorField"] = {"deep": [1]}
    order["nodes"][0]["vendorField"] = "x"

    assert read(Order, order).order_id == "o1"


def test_names_of_the_code_are_no_names_on_the_wire(order: JsonObject) -> None:
    order["order_id"] = order.pop("orderId")

    assert refusal(Order, order).problems == ("orderId: is missing",)


@pytest.mark.clause("7.3.1")
@pytest.mark.parametrize("value", [True, 7, -2.5, "text", [1, "a", None], {"a": {"b": [1.5]}}, "", [], {}])
def test_action_parameter_accepts_any_json_except_null(instant_action: JsonObject, value: object) -> None:
    instant_action["actions"][0]["actionParameters"][0]["value"] = value

    message = read(InstantActions, instant_action)

    assert message.actions[0].parameter("x") == value
    written = json.loads(CODEC.encode(message))
    assert written["actions"][0]["actionParameters"] == [{"key": "x", "value": value}]


@pytest.mark.clause("7.3.1")
@pytest.mark.parametrize("value", [None, float("nan"), [float("inf")], {"a": [float("-inf")]}])
def test_action_parameter_without_a_value_is_refused(instant_action: JsonObject, value: Any) -> None:
    instant_action["actions"][0]["actionParameters"][0]["value"] = value

    assert (
        refusal(InstantActions, instant_action).problems[0].startswith("actions.0.actionParameters.0.value")
    )
    with pytest.raises(ValidationError):
        ActionParameter(key="x", value=value)


@pytest.mark.clause("6.1.4.1")
@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"{",
        b"[]",
        b"[1]",
        b"null",
        b'"order"',
        b"\xff\xfe",
        b"[" * 100_000,
        b'{"headerId":' + b"1" * 5000 + b"}",
    ],
    ids=["empty", "cut off", "list", "list of one", "null", "text", "no utf-8", "deep", "long number"],
)
def test_malformed_message_is_refused_without_references(payload: bytes) -> None:
    error = refusal(Order, payload)

    assert error.problems[0].startswith(("message: ", "headerId: "))
    assert error.references == {}


@pytest.mark.clause("7.1.2/size")
def test_deep_nesting_inside_a_parameter_is_refused(instant_action: JsonObject) -> None:
    payload = json.dumps(instant_action).replace("1.5", "[" * 300 + "]" * 300).encode()

    assert "recursion limit" in refusal(InstantActions, payload).problems[0]


@pytest.mark.clause("7.1.2/size")
def test_size_limit(order: JsonObject) -> None:
    payload = json.dumps(order).encode()
    CODEC.decode(Order, payload.ljust(MAXIMUM_PAYLOAD))

    assert refusal(Order, payload.ljust(MAXIMUM_PAYLOAD + 1)).problems == (
        f"longer than {MAXIMUM_PAYLOAD} bytes",
    )


@pytest.mark.clause("7.2/version")
@pytest.mark.parametrize("version", ["3.0.0", "1.1.0", "21.0.0"])
def test_another_major_version_is_refused(order: JsonObject, version: str) -> None:
    problem = refusal(Order, order | {"version": version}).problems[0]

    assert problem == f"version: {version} is not of the same major version as 2.1.0"


@pytest.mark.clause("7.2/version")
def test_an_older_minor_version_is_read_and_answered_in_our_own(order: JsonObject) -> None:
    message = read(Order, order | {"version": "2.0.0"})

    assert message.version == "2.0.0"
    assert json.loads(CODEC.encode(message))["version"] == "2.1.0"


@pytest.mark.clause("6.1.4.1")
def test_refusal_contains_readable_references(order: JsonObject) -> None:
    order |= {"headerId": 12, "orderId": "o7", "orderUpdateId": 3, "nodes": "none"}

    error = refusal(Order, order)

    assert error.kind == "Order"
    named = {"headerId": "12", "orderId": "o7", "orderUpdateId": "3"}
    assert error.references == {**named, "parameter": "nodes"}
    assert str(error).startswith("not a valid Order: nodes: ")


def test_references_of_the_wrong_type_or_length_are_left_out(order: JsonObject) -> None:
    order |= {"headerId": True, "orderId": ["o7"], "orderUpdateId": "9" * (REFERENCE_LENGTH + 1), "nodes": 1}

    assert refusal(Order, order).references == {"parameter": "headerId"}


def test_refusal_shows_only_the_first_problems() -> None:
    assert len(refusal(State, {}).problems) == PROBLEMS_SHOWN


@pytest.mark.clause("6.1.1")
def test_order_that_breaks_the_graph_rules_is_neither_read_nor_written(order: JsonObject) -> None:
    message = read(Order, order)
    order["edges"] = []

    assert refusal(Order, order).problems == ("edges: 2 nodes require 1 edges, but the order has 0",)
    with pytest.raises(MalformedMessageError, match="2 nodes require 1 edges"):
        CODEC.encode(message.model_copy(update={"edges": ()}))
