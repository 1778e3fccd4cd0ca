"""What becomes of deviations that are seen in the field: repaired, left out, replaced or refused."""

from __future__ import annotations

import json
from copy import deepcopy
from datetime import UTC, datetime
from math import nan, pi
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic_core import from_json

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.malformed import QUOTED, MalformedMessageError
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.repair import Repair, Repairs, Scope, repair, without_mark
from nena_shared.vda5050.state import EmergencyStop, State
from nena_shared.vda5050.v2_1 import CODEC
from nena_shared.vda5050.versions import CODECS
from support.examples import MESSAGES
from support.fleet_examples import connection, position, way
from support.fleet_examples import state as robot_state
from support.messages import messages

TOPIC = "uagv/v2/ACME/r1/state"
ARRIVAL = datetime(2026, 1, 2, tzinfo=UTC)
MISSING: Any = object()

STATE: dict[str, Any] = json.loads(
    CODEC.encode(
        robot_state(
            **way("A", "B"),
            mobile_robot_position=position(1.0, 2.0),
            velocity={"vx": 0.5},
            errors=(
                {
                    "error_type": "x",
                    "error_level": "WARNING",
                    "error_references": ({"reference_key": "nodeId", "reference_value": "1"},),
                },
            ),
            information=({"info_type": "i", "info_level": "INFO"},),
        )
    )
)


def deviating(path: str, value: Any) -> bytes:
    """Return the state with another value at a path of names and numbers."""
    content = deepcopy(STATE)
    *parents, last = (int(part) if part.isdigit() else part for part in path.split("."))
    place: Any = content
    for parent in parents:
        place = place[parent]
    if value is MISSING:
        del place[last]
    else:
        place[last] = value
    return json.dumps(content).encode()


def read(payload: bytes) -> tuple[State, list[Repair]]:
    repairs: list[Repair] = []
    reader = MessageReader(lambda _, found: repairs.extend(found))
    return reader.read(State, TOPIC, payload, "v2"), repairs


REPAIRED: list[tuple[str, Any, str | None, str, Any]] = [
    ("agvPosition.theta", 3.1416, None, "mobile_robot_position.theta", 3.1416),
    ("agvPosition.theta", 3.142, "angle_wrapped", "mobile_robot_position.theta", 3.142 - 2 * pi),
    ("agvPosition.theta", -3.2, "angle_wrapped", "mobile_robot_position.theta", 2 * pi - 3.2),
    ("agvPosition.theta", "0.5", "text_as_number", "mobile_robot_position.theta", 0.5),
    ("agvPosition.theta", nan, "left_out", "mobile_robot_position", None),
    ("agvPosition.localizationScore", 95, "scaled", "mobile_robot_position.localization_score", 0.95),
    ("agvPosition.localizationScore", -5, "left_out", "mobile_robot_position.localization_score", None),
    ("agvPosition.localizationScore", 900, "left_out", "mobile_robot_position.localization_score", None),
    ("agvPosition.deviationRange", -1, "left_out", "mobile_robot_position.deviation_range", None),
    ("agvPosition.mapId", 7, "number_as_text", "mobile_robot_position.map_id", "7"),
    ("agvPosition.mapId", MISSING, "replaced", "mobile_robot_position.map_id", ""),
    ("agvPosition.positionInitialized", MISSING, "replaced", "mobile_robot_position.localized", False),
    ("agvPosition.positionInitialized", "?", "replaced", "mobile_robot_position.localized", False),
    ("agvPosition.theta", MISSING, "left_out", "mobile_robot_position", None),
    ("agvPosition.positionInitialized", "true", "text_as_boolean", "mobile_robot_position.localized", True),
    ("agvPosition.positionInitialized", 1, "text_as_boolean", "mobile_robot_position.localized", True),
    ("batteryState.batteryCharge", 101.3, "clamped", "power_supply.state_of_charge", 100.0),
    ("batteryState.batteryCharge", -1, "clamped", "power_supply.state_of_charge", 0.0),
    ("batteryState.batteryCharge", "80", "text_as_number", "power_supply.state_of_charge", 80.0),
    ("batteryState.batteryCharge", None, "replaced", "power_supply.state_of_charge", 0.0),
    ("batteryState.batteryCharge", 255, "replaced", "power_supply.state_of_charge", 0.0),
    ("batteryState.batteryHealth", 120, "clamped", "power_supply.battery_health", 100.0),
    ("batteryState.batteryVoltage", nan, "left_out", "power_supply.battery_voltage", None),
    ("batteryState.charging", "FALSE", "text_as_boolean", "power_supply.charging", False),
    ("velocity.vx", nan, "left_out", "velocity.vx", None),
    ("velocity", [], "left_out", "velocity", None),
    ("errors.0.errorLevel", "ERROR", "replaced", "errors.0.error_level", "FATAL"),
    ("errors.0.errorLevel", "warning", "letter_case", "errors.0.error_level", "WARNING"),
    ("errors.0.errorLevel", MISSING, "replaced", "errors.0.error_level", "FATAL"),
    ("errors.0.errorType", MISSING, "replaced", "errors.0.error_type", "unknown"),
    ("errors.0.errorReferences", None, "empty_list", "errors.0.error_references", ()),
    (
        "errors.0.errorReferences.0.referenceValue",
        3,
        "number_as_text",
        "errors.0.error_references.0.reference_value",
        "3",
    ),
    ("errors.0.errorReferences.0.referenceValue", [], "left_out", "errors.0.error_references", ()),
    ("errors", None, "empty_list", "errors", ()),
    ("errors", MISSING, "empty_list", "errors", ()),
    ("edgeStates", MISSING, "empty_list", "edge_states", ()),
    ("actionStates", None, "empty_list", "action_states", ()),
    ("actionStates", MISSING, "empty_list", "action_states", ()),
    ("nodeStates", None, "empty_list", "node_states", ()),
    ("nodeStates", {}, "empty_list", "node_states", ()),
    ("errors", {}, "empty_list", "errors", ()),
    ("nodeStates.0.sequenceId", 2.0, "whole_number", "node_states.0.sequence_id", 2),
    ("nodeStates.0.sequenceId", "2", "text_as_number", "node_states.0.sequence_id", 2),
    ("nodeStates.0.nodeId", 5, "number_as_text", "node_states.0.node_id", "5"),
    ("nodeStates.0.nodePosition", {"x": 1.0}, "left_out", "node_states.0.node_position", None),
    ("information", None, None, "information", None),
    ("information.0.infoLevel", "WARN", "left_out", "information", ()),
    ("loads", [{"weight": -3}], "left_out", "loads.0.weight", None),
    ("loads", [5], "left_out", "loads", None),
    ("orderUpdateId", None, "replaced", "order_update_id", 0),
    ("orderId", 12, "number_as_text", "order_id", "12"),
    ("lastNodeId", None, "replaced", "last_node_id", ""),
    ("lastNodeSequenceId", -1, "replaced", "last_node_sequence_id", 0),
    ("operatingMode", "automatic", "letter_case", "operating_mode", "AUTOMATIC"),
    ("operatingMode", "teach_in", "letter_case", "operating_mode", "TEACH_IN"),
    ("operatingMode", "FLYING", "replaced", "operating_mode", "MANUAL"),
    ("operatingMode", MISSING, "replaced", "operating_mode", "MANUAL"),
    ("safetyState.eStop", "autoAck", "letter_case", "safety_state.field_violation", True),
    ("safetyState.eStop", "none", "letter_case", "safety_state.active_emergency_stop", "NONE"),
    ("safetyState.eStop", "PRESSED", "replaced", "safety_state.active_emergency_stop", "MANUAL"),
    ("headerId", "5", "text_as_number", "header_id", 5),
    ("headerId", 2**40, "replaced", "header_id", 0),
    ("headerId", MISSING, "replaced", "header_id", 0),
    ("serialNumber", 17, "number_as_text", "serial_number", "17"),
    ("version", "2.1", "version_number", "version", "2.1.0"),
    ("version", "v2.1.0", "version_number", "version", "2.1.0"),
    ("version", 2.1, "version_number", "version", "2.1.0"),
    ("version", "2", "version_number", "version", "2.0.0"),
    ("version", None, "version_number", "version", "2.1.0"),
    ("driving", 0, "text_as_boolean", "driving", False),
    ("paused", "yes", "left_out", "paused", None),
    ("distanceSinceLastNode", -0.01, "left_out", "distance_since_last_node", None),
]


@pytest.mark.parametrize(
    ("path", "value", "kind", "field", "expected"),
    REPAIRED,
    ids=[f"{path}={'missing' if value is MISSING else value}"[:60] for path, value, *_ in REPAIRED],
)
def test_clear_deviation_is_repaired_and_reported(
    path: str, value: Any, kind: str | None, field: str, expected: Any
) -> None:
    message, repairs = read(deviating(path, value))

    found: Any = message
    for part in field.split("."):
        found = found[int(part)] if part.isdigit() else getattr(found, part)
    assert found == (pytest.approx(expected) if isinstance(expected, float) else expected)
    assert [each.kind for each in repairs] == ([kind] if kind else [])
    if repairs:
        named = "".join(part for part in path if not part.isdigit()).replace("..", ".")
        assert named.startswith(repairs[0].field) or repairs[0].field.startswith(named)


def test_deviation_is_read_alike_after_any_other() -> None:
    payloads = [deviating(path, value) for path, value, *_ in REPAIRED]
    alone = [read(payload) for payload in payloads]
    found: list[Repair] = []
    reader = MessageReader(lambda _, repairs: found.extend(repairs))
    for payload, (message, repairs) in 2 * list(zip(payloads, alone, strict=True)):
        found.clear()
        assert reader.read(State, TOPIC, payload, "v2") == message
        assert found == repairs


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize(
    "value",
    [
        *(1_700_000_000, "1700000000", 1_700_000_000.0, "1700000000000", "1700000000000000000"),
        *(17 * 10 ** (8 + digits) for digits in (3, 6, 9)),
    ],
)
def test_unix_times_are_read_and_reported(*, value: Any, strict: bool) -> None:
    payload = deviating("timestamp", value)
    if strict:
        with pytest.raises(MalformedMessageError, match="timestamp"):
            MessageReader(strict=True).read(State, TOPIC, payload, "v2")
        return
    message, repairs = read(payload)

    assert message.timestamp == datetime(2023, 11, 14, 22, 13, 20, tzinfo=UTC)
    assert [(each.field, each.kind) for each in repairs] == [("timestamp", "unix_time")]


@pytest.mark.parametrize("value", [MISSING, None, [], "fine"])
def test_objects_that_say_nothing_get_the_safest_values(value: Any) -> None:
    content = json.loads(deviating("batteryState", value))
    content.pop("safetyState") if value is MISSING else content.update(safetyState=value)
    message, repairs = read(json.dumps(content).encode())

    assert message.safety_state.active_emergency_stop is EmergencyStop.MANUAL
    assert (message.power_supply.state_of_charge, message.power_supply.charging) == (0.0, False)
    assert [(each.field, each.kind) for each in repairs] == [
        ("batteryState", "replaced"),
        ("safetyState", "replaced"),
    ]


def sighting(payload: bytes) -> State:
    with pytest.raises(MalformedMessageError):
        read(payload)
    found = MessageReader().sighting("uagv/v2/A/1/state", payload, "v2")
    assert found
    assert found.mobile_robot_position
    assert (found.mobile_robot_position.x, found.mobile_robot_position.y) == (1.0, 2.0)
    return found


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("driving", MISSING),
        ("nodeStates", "none"),
        ("nodeStates", [{"nodeId": []}]),
        ("actionStates", [{"id": "7"}]),
        ("edgeStates", 7),
        ("orderId", None),
        ("errors", {"all": "well"}),
    ],
)
def test_whatever_else_is_wrong_a_state_says_where_the_robot_is(path: str, value: Any) -> None:
    found = sighting(deviating(path, value))

    assert found.last_node_id == STATE["lastNodeId"]


def test_a_state_of_another_version_on_this_topic_says_where_the_robot_is() -> None:
    state = {**STATE, "version": "3.0.0", "mobileRobotPosition": {**STATE["agvPosition"], "localized": True}}
    del state["agvPosition"], state["batteryState"]

    assert sighting(json.dumps(state).encode()).version == "3.0.0"


def test_a_text_that_is_not_utf_8_does_not_hide_where_the_robot_is() -> None:
    state = json.dumps({**STATE, "errors": "Störung"}, ensure_ascii=False).encode("latin-1")

    assert sighting(state).last_node_id == STATE["lastNodeId"]


@pytest.mark.parametrize("payload", [b"", b"[]", b"{", b'{"x": 1}', b"7"])
def test_what_says_nothing_is_no_sighting(payload: bytes) -> None:
    found = MessageReader().sighting("uagv/v2/A/1/state", payload, "v2")

    assert found is None or (found.mobile_robot_position, found.last_node_id) == (None, "")


@pytest.mark.parametrize(
    "value",
    [0, 17_000, 10**11, 10**400, "", None, "yesterday", MISSING, "2026-01-01", "DT#2023-11-17-11:41:32"],
)
def test_time_of_arrival_replaces_an_unreadable_timestamp(value: Any) -> None:
    before = datetime.now(UTC)
    message, repairs = read(deviating("timestamp", value))

    assert (message.timestamp - before).total_seconds() == pytest.approx(0.0, abs=60.0)
    assert [(each.field, each.kind) for each in repairs] == [("timestamp", "time_of_arrival")]


def test_a_byte_order_mark_is_skipped() -> None:
    message, repairs = read(b"\xef\xbb\xbf" + json.dumps(STATE).encode())

    assert message.header_id == 1
    assert [(each.field, each.kind) for each in repairs] == [("message", "byte_order_mark")]


def test_zeros_that_end_a_text_in_c_are_skipped() -> None:
    payload = json.dumps(STATE).encode() + b"\0\0"
    repairs: list[Repair] = []
    reader = MessageReader(lambda _, found: repairs.extend(found))

    for _ in range(2):
        assert reader.read(State, TOPIC, payload, "v2").header_id == 1
    assert list(map(str, repairs)) == ["message 00: left out"] * 2
    with pytest.raises(MalformedMessageError, match="trailing characters"):
        MessageReader(strict=True).read(State, TOPIC, payload, "v2")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("orderId", MISSING),
        ("orderId", None),
        ("nodeStates", MISSING),
        ("nodeStates.0", "A"),
        ("nodeStates.0.nodeId", MISSING),
        ("nodeStates.0.released", MISSING),
        ("nodeStates.0.sequenceId", 1.5),
        ("edgeStates.0.edgeId", None),
        ("driving", "perhaps"),
    ],
)
def test_unsafe_deviation_rejects_the_message(path: str, value: Any) -> None:
    with pytest.raises(MalformedMessageError) as caught:
        read(deviating(path, value))
    assert caught.value.problems[0].startswith(path.removesuffix(".0"))


def test_an_order_update_that_is_null_is_not_called_missing() -> None:
    with pytest.raises(MalformedMessageError) as caught:
        read(deviating("orderUpdateId", None).replace(b'"orderId": ""', b'"orderId": "T1"'))
    assert caught.value.reason == "orderUpdateId: Input should be a valid integer (received null)"


def test_what_makes_an_object_unreadable_is_named() -> None:
    _, repairs = read(deviating("agvPosition.theta", MISSING))
    assert list(map(str, repairs)) == ["agvPosition theta missing: left out"]


@pytest.mark.parametrize("version", CODECS)
@pytest.mark.parametrize(
    "idle",
    [
        {"orderId": MISSING},
        {"orderId": None, "nodeStates": None},
        {"orderId": MISSING, "edgeStates": MISSING},
    ],
)
def test_a_state_that_says_that_there_is_no_order_is_read(idle: dict[str, Any], version: str) -> None:
    content = json.loads(CODECS[version].encode(robot_state()))
    assert content["orderId"] == ""
    content |= idle
    payload = json.dumps({name: value for name, value in content.items() if value is not MISSING}).encode()
    major = CODECS[version].major_version
    message = MessageReader().read(State, f"uagv/{major}/ACME/r1/state", payload, major)

    assert (message.order_id, message.node_states, message.edge_states) == ("", (), ())


@pytest.mark.parametrize("path", ["orderId", "nodeStates"])
def test_an_order_without_its_name_or_nodes_is_never_read_as_idle(path: str) -> None:
    for name in ("headerId", "edgeStates", "actionStates"):
        content = {**STATE, "orderId": "o1", name: STATE[name] if name == "headerId" else []}
        del content[path]
        with pytest.raises(MalformedMessageError, match=f"{path}: is missing"):
            read(json.dumps(content).encode())


def test_a_robot_that_never_names_its_orders_is_not_idle_after_one() -> None:
    reader, idle = MessageReader(), {**STATE, "nodeStates": [], "edgeStates": []}
    del idle["orderId"]
    working = {**STATE, "orderId": None}
    for content in ({**STATE, "version": "1.3.2"}, {**idle, "version": "1.3.2"}, idle, idle):
        assert reader.read(State, TOPIC, json.dumps(content).encode(), "v2").order_id == ""
    for content in (working, idle):
        with pytest.raises(MalformedMessageError, match="orderId"):
            reader.read(State, TOPIC, json.dumps(content).encode(), "v2")


def test_a_strict_reader_repairs_nothing() -> None:
    for path, value, kind, *_ in REPAIRED:
        if kind is not None:
            with pytest.raises(MalformedMessageError):
                MessageReader(strict=True).read(State, TOPIC, deviating(path, value), "v2")


def test_quoted_values_are_short() -> None:
    _, repairs = read(deviating("errors.0.errorLevel", "x" * 1000))
    assert len(repairs[0].received) <= QUOTED + len("...")


def test_connection_state_in_other_case_is_read() -> None:
    payload = CODEC.encode(connection()).replace(b'"ONLINE"', b'"online"')
    read_message = MessageReader().read(Connection, "uagv/v2/ACME/r1/connection", payload, "v2")
    assert read_message.connection_state is ConnectionState.ONLINE


def test_a_factsheet_with_null_lists_and_an_unknown_scope_is_read(factsheet: dict[str, Any]) -> None:
    features = factsheet["protocolFeatures"]
    features["optionalParameters"] = None
    features["agvActions"][0]["actionScopes"].append("SPACE")
    message = MessageReader().read(
        Factsheet, "uagv/v2/ACME/r1/factsheet", json.dumps(factsheet).encode(), "v2"
    )
    assert message.protocol_features.optional_parameters == ()
    assert message.protocol_features.mobile_robot_actions[0].action_scopes == ("NODE",)


INCOMPLETE = [
    ("protocolLimits", MISSING),
    ("protocolLimits", {}),
    ("protocolLimits", {"timing": {"minOrderInterval": "often"}}),
    ("agvGeometry", None),
    ("loadSpecification", MISSING),
    ("loadSpecification", []),
    ("physicalParameters", {"speedMax": 1.5}),
    ("physicalParameters", {"speedMax": -1}),
    ("typeSpecification", {"navigationTypes": "AUTONOMOUS"}),
    ("protocolFeatures", MISSING),
]


@pytest.mark.parametrize(("name", "value"), INCOMPLETE)
def test_what_an_incomplete_factsheet_says_is_read(factsheet: dict[str, Any], name: str, value: Any) -> None:
    series = "" if name == "typeSpecification" else factsheet["typeSpecification"]["seriesName"]
    del factsheet[name]
    factsheet |= {} if value is MISSING else {name: value}
    found: list[Repair] = []
    message = MessageReader(lambda _, repairs: found.extend(repairs)).read(
        Factsheet, "uagv/v2/ACME/r1/factsheet", json.dumps(factsheet).encode(), "v2"
    )

    assert message.type_specification.series_name == series
    assert found
    assert all(each.field.startswith(name) for each in found)
    assert message.protocol_limits.timing.minimum_order_interval in (0.0, 1.0)


def test_enumerations_off_the_list_leave_an_action_usable(factsheet: dict[str, Any]) -> None:
    features = factsheet["protocolFeatures"]
    features["agvActions"] = [
        {
            "actionType": "pick",
            "actionScopes": "NODE",
            "actionParameters": [{"key": "lhd", "valueDataType": "DOUBLE"}],
            "blockingTypes": ["FULL"],
        }
    ]
    features["optionalParameters"] = [{"parameter": "order.nodes.nodeDescription", "support": "OPTIONAL"}]
    message = MessageReader().read(
        Factsheet, "uagv/v2/ACME/r1/factsheet", json.dumps(factsheet).encode(), "v2"
    )

    [pick] = message.protocol_features.mobile_robot_actions
    assert (pick.action_scopes, pick.action_parameters, pick.blocking_types) == (("NODE",), None, ())
    assert [each.support for each in message.protocol_features.optional_parameters] == ["SUPPORTED"]


@pytest.mark.parametrize(
    ("codec", "kind"),
    [(codec, kind) for codec in CODECS.values() for kind in codec.forms],
    ids=lambda value: value.version if isinstance(value, Codec) else value.__name__,
)
@settings(max_examples=MESSAGES)
@given(st.data())
def test_valid_message_is_not_repaired(codec: Codec, kind: type[Header], data: st.DataObject) -> None:
    payload = codec.encode(data.draw(messages(kind)))
    found: Repairs = {}
    content = from_json(without_mark(payload, found))
    assert content is not None
    for scope in Scope:
        repair(codec.forms[kind], content, found, version=codec.version, now=ARRIVAL, scope=scope)
    assert not found
