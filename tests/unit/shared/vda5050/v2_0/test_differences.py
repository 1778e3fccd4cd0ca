"""Differences of 2.0 from 2.1."""

from __future__ import annotations

import json
from typing import Any

import pytest

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_0 import CODEC
from support.json_messages import JsonMessages
from support.schemas import schema_problems

JsonObject = dict[str, Any]
MESSAGES = JsonMessages(CODEC)
written = MESSAGES.written


def read(kind: type[Header], content: JsonObject) -> Any:
    return MESSAGES.read(kind, content | {"version": "2.0.0"})


@pytest.mark.clause("7.3", "7.8", "7.10/message")
@pytest.mark.parametrize(("kind", "name"), [(Order, "order"), (State, "state"), (Factsheet, "factsheet")])
def test_examples_are_read_and_written_with_their_version(
    request: pytest.FixtureRequest, kind: type[Header], name: str
) -> None:
    payload = CODEC.encode(read(kind, request.getfixturevalue(name)))

    assert json.loads(payload)["version"] == "2.0.0"
    assert schema_problems("2.0.0", name, payload) == []


@pytest.mark.clause("6.1.5", "7.1/unknown")
def test_corridor_is_an_unknown_field(order: JsonObject) -> None:
    order["edges"][0]["corridor"] = {"leftWidth": "wide"}

    message = read(Order, order)

    assert message.edges[0].corridor is None
    assert "corridor" not in written(message)["edges"][0]


@pytest.mark.clause("6.6.5.3", "7.1/unknown")
def test_maps_and_hints_are_unknown_fields(state: JsonObject) -> None:
    state["maps"] = "all"
    state["errors"] = [{"errorType": "oven", "errorLevel": "FATAL", "errorHint": 5}]

    message = read(State, state)

    assert (message.maps, message.errors[0].error_hint) == (None, None)


@pytest.mark.clause("7.8/power")
@pytest.mark.parametrize(("health", "told"), [(80.4, 80), (99.6, 100), (0, 0)])
def test_battery_health_is_an_integer(state: JsonObject, health: float, told: int) -> None:
    state["batteryState"]["batteryHealth"] = health

    sent = written(read(State, state))["batteryState"]["batteryHealth"]

    assert (sent, type(sent)) == (told, int)


@pytest.mark.clause("7.10/message")
def test_array_limits_are_read_by_both_names(factsheet: JsonObject) -> None:
    limits = factsheet["protocolLimits"]["maxArrayLens"]
    limits |= {"state.informations": 7, "informations.infoReferences": 8}

    message = read(Factsheet, factsheet)

    sent = written(message)["protocolLimits"]["maxArrayLens"]
    assert sent == {"order.nodes": 50, "state.information": 7, "information.infoReferences": 8}
    again = read(Factsheet, written(message)).protocol_limits.maximum_array_lengths
    assert again == message.protocol_limits.maximum_array_lengths


@pytest.mark.clause("7.10/message")
def test_additions_of_2_1_to_the_factsheet_are_omitted(factsheet: JsonObject) -> None:
    corridor = {"parameter": "order.edges.corridor", "support": "SUPPORTED"}
    speed = {"parameter": "order.edges.maxSpeed", "support": "SUPPORTED"}
    factsheet["protocolFeatures"]["optionalParameters"] = [corridor, speed]
    factsheet["physicalParameters"]["angularSpeedMax"] = 1.0
    factsheet["vehicleConfig"] = {"versions": []}
    factsheet["protocolFeatures"]["agvActions"][0]["blockingTypes"] = ["HARD"]

    sent = written(read(Factsheet, factsheet))

    assert sent["protocolFeatures"]["optionalParameters"] == [speed]
    assert "angularSpeedMax" not in sent["physicalParameters"]
    assert "vehicleConfig" not in sent
    assert "blockingTypes" not in sent["protocolFeatures"]["agvActions"][0]


@pytest.mark.clause("7.8")
@pytest.mark.parametrize("theta", [None, 1.5])
def test_the_position_of_a_coming_node_needs_its_theta(state: JsonObject, theta: float | None) -> None:
    position = {"x": 1.0, "y": 2.0, "mapId": "hall"} | ({} if theta is None else {"theta": theta})
    node = {"nodeId": "n1", "sequenceId": 2, "released": True, "nodePosition": position}
    state["nodeStates"] = [node]

    message = read(State, state)
    payload = CODEC.encode(message)

    assert message.node_states[0].node_position.x == 1.0
    assert ("nodePosition" in json.loads(payload)["nodeStates"][0]) is (theta is not None)
    assert schema_problems("2.0.0", "state", payload) == []
