"""Commands of other fleet controls: what is certain is read, the rest is refused by its name."""

from __future__ import annotations

import json
from collections.abc import Collection
from copy import deepcopy
from datetime import UTC, datetime
from math import nan, pi
from typing import Any, TypeVar

import pytest

from nena_shared.vda5050.action import BlockingType, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.command_reader import read_command
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import codec_for

H = TypeVar("H", bound=Header)
ROBOT = RobotKey("ACME", "0001")
ARRIVAL = datetime(2026, 1, 2, tzinfo=UTC)
MISSING: Any = object()
BEEP = {"actionType": "beep", "actionId": "b", "blockingType": "NONE", "actionParameters": []}


def read(
    content: dict[str, Any], kind: type[H], version: str = "2.1.0", maps: Collection[str] = ("m",)
) -> tuple[H, list[str]]:
    payload, codec = json.dumps(content).encode(), codec_for(version)
    message, repairs = read_command(kind, codec, payload, now=ARRIVAL, robot=ROBOT, maps=maps)
    return message, [str(repair) for repair in repairs]


def changed(content: dict[str, Any], values: dict[str, Any]) -> dict[str, Any]:
    """Return the message with other values at paths of names and numbers."""
    content = deepcopy(content)
    for path, value in values.items():
        *parents, last = (int(part) if part.isdigit() else part for part in path.split("."))
        place: Any = content
        for parent in parents:
            place = place[parent]
        if value is MISSING:
            del place[last]
        else:
            place[last] = value
    return content


@pytest.mark.parametrize("version", ["1.3.2", "1.1.0", "0.8.4", "5.0.0", "3.0.0", "v1", 3, "1.1"])
@pytest.mark.parametrize("kind", [Order, InstantActions])
def test_the_topic_decides_the_version(
    order: dict[str, Any], instant_action: dict[str, Any], kind: type[Header], version: Any
) -> None:
    message, repairs = read((order if kind is Order else instant_action) | {"version": version}, kind)

    assert message.version == "2.1.0"
    assert len(repairs) == 1
    assert repairs[0].endswith("read as 2.1.0: unknown version")


def test_a_field_that_only_the_other_version_has_is_not_ignored(order: dict[str, Any]) -> None:
    order["edges"][0]["maxSpeed"] = 0.3
    del order["nodes"][1]["nodePosition"]["allowedDeviationXY"]

    assert read(order | {"version": "3.0.0"}, Order)[0].edges[0].maximum_speed == 0.3
    with pytest.raises(
        MalformedMessageError, match=r"maxSpeed: is a field of 2\.1\.0; use topics of v2"
    ) as caught:
        read(order, Order, "3.0.0")
    assert caught.value.references["parameter"] == "maxSpeed"
    del order["edges"][0]["maxSpeed"]
    assert read(order, Order, "3.0.0")[1] == ["version 2.1.0, read as 3.0.0: unknown version"]


CERTAIN: dict[str, tuple[dict[str, Any], list[str]]] = {
    "no header": (
        dict.fromkeys(("headerId", "timestamp", "version", "manufacturer", "serialNumber"), MISSING),
        [
            "manufacturer missing: replaced",
            "serialNumber missing: replaced",
            "version null: version number",
            "timestamp null: time of arrival",
            "headerId missing: replaced",
        ],
    ),
    "header null": (
        {"headerId": None, "manufacturer": None},
        ["manufacturer null: replaced", "headerId null: replaced"],
    ),
    "names empty": (
        {"manufacturer": "", "serialNumber": ""},
        ['manufacturer "": replaced', 'serialNumber "": replaced'],
    ),
    "name in small letters": ({"manufacturer": "acme"}, ['manufacturer "acme": letter case']),
    "timestamp in s": ({"timestamp": 1700000000}, ["timestamp 1700000000: unix time"]),
    "timestamp of a PLC": (
        {"timestamp": "DT#2023-11-17-11:41:32"},
        ['timestamp "DT#2023-11-17-11:41:32": time of arrival'],
    ),
    "no actions": (
        {"nodes.0.actions": MISSING, "nodes.1.actions": None, "edges.0.actions": MISSING},
        ["nodes.actions null: empty list", "edges.actions missing: empty list"],
    ),
    "an empty list as Lua writes it": (
        {"nodes.0.actions": {}, "edges.0.actions": {}},
        ["nodes.actions {}: empty list", "edges.actions {}: empty list"],
    ),
    "mapId missing": (
        {"nodes.0.nodePosition.mapId": MISSING},
        ["nodes.nodePosition.mapId missing: replaced"],
    ),
    "mapId empty": ({"nodes.1.nodePosition.mapId": ""}, ['nodes.nodePosition.mapId "": replaced']),
    "mapId null": ({"nodes.1.nodePosition.mapId": None}, ["nodes.nodePosition.mapId null: replaced"]),
    "mapId in capitals": (
        {"nodes.1.nodePosition.mapId": "M"},
        ['nodes.nodePosition.mapId "M": letter case'],
    ),
    "one node, no edges": ({"nodes.1": MISSING, "edges": MISSING}, ["edges missing: empty list"]),
    "an edge without its nodes": (
        {"edges.0.startNodeId": MISSING, "edges.0.endNodeId": ""},
        ["edges.startNodeId missing: replaced", 'edges.endNodeId "": replaced'],
    ),
    "numbers as text": (
        {"nodes.1.nodePosition.x": "5", "nodes.1.sequenceId": "2", "orderUpdateId": "0"},
        ['orderUpdateId "0": text as number', 'nodes.sequenceId "2": text as number'],
    ),
    "numbers and booleans as text that 2.x has in another form": (
        {"nodes.1.nodePosition.allowedDeviationXY": "0.3", "edges.0.rotationAllowed": "False"},
        [
            'nodes.nodePosition.allowedDeviationXY "0.3": text as number',
            'edges.rotationAllowed "False": text as boolean',
        ],
    ),
    "any heading is allowed, in degrees": (
        {"nodes.1.nodePosition.theta": 1.0, "nodes.1.nodePosition.allowedDeviationTheta": 360},
        ["nodes.nodePosition.allowedDeviationTheta 360: clamped"],
    ),
    "words in small letters": (
        {"edges.0.orientation": 0.0, "edges.0.orientationType": "tangential"},
        ['edges.orientationType "tangential": letter case'],
    ),
}


@pytest.mark.parametrize(("values", "reported"), CERTAIN.values(), ids=CERTAIN)
def test_what_has_one_meaning_is_read_and_reported(
    order: dict[str, Any], values: dict[str, Any], reported: list[str]
) -> None:
    message, repairs = read(changed(order, values), Order)

    assert (message.manufacturer, message.serial_number) == ("ACME", "0001")
    assert {node.node_position.map_id for node in message.nodes if node.node_position} == {"m"}
    assert repairs[: len(reported)] == reported


@pytest.mark.parametrize("value", [MISSING, None])
def test_an_action_without_blocking_type_blocks_everything(
    order: dict[str, Any], instant_action: dict[str, Any], value: Any
) -> None:
    beep = changed({"actions": [BEEP]}, {"actions.0.blockingType": value})

    ordered, repairs = read(changed(order, {"nodes.1.actions": beep["actions"]}), Order)
    instant, _ = read(instant_action | beep, InstantActions)

    assert ordered.nodes[1].actions[0].blocking_type is instant.actions[0].blocking_type is BlockingType.HARD
    assert repairs == [f"nodes.actions.blockingType {'missing' if value is MISSING else 'null'}: replaced"]


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0"])
def test_all_angles_of_an_order_are_in_degrees_if_one_heading_can_only_be(
    order: dict[str, Any], version: str
) -> None:
    headings = {
        "nodes.0.nodePosition.theta": "3",
        "nodes.1.nodePosition.theta": 270,
        "edges.0.orientation": -90.0,
    }
    turn = {"nodes.1.nodePosition.allowedDeviationTheta": 5.0}

    message, repairs = read(changed(order, headings | turn) | {"version": version}, Order, version)

    start, end = (node.node_position for node in message.nodes)
    assert start
    assert end
    assert [start.theta, end.theta] == pytest.approx([pi / 60, -pi / 2])
    assert end.allowed_deviation_theta == pytest.approx(pi / 36)
    assert message.edges[0].orientation == pytest.approx(-pi / 2)
    assert "nodes.nodePosition.theta 270: degrees" in repairs


REFUSED: dict[str, tuple[dict[str, Any], str, str]] = {
    "cause behind what is tolerated": (
        {"version": "1.3.2", "nodes.0.actions": MISSING, "nodes.1.nodePosition.x": MISSING},
        "nodes.1.nodePosition.x",
        "is missing",
    ),
    "cause before what is tolerated": (
        {"version": "2.1", "nodes.0.nodePosition.x": MISSING, "nodes.1.actions": MISSING},
        "nodes.0.nodePosition.x",
        "is missing",
    ),
    "no orderId": ({"orderId": MISSING, "nodes.0.actions": None}, "orderId", "is missing"),
    "no orderUpdateId": ({"orderUpdateId": MISSING}, "orderUpdateId", "is missing"),
    "no nodes": ({"nodes": None, "headerId": "7"}, "nodes", "at least one node"),
    "released is unclear": (
        {"nodes.1.released": None, "edges.0.actions": None},
        "nodes.1.released",
        "boolean",
    ),
    "an edge is lacking": ({"edges": [], "version": "2.1"}, "edges", "2 nodes require 1 edges"),
    "odd sequenceIds": (
        {"nodes.0.sequenceId": 1, "nodes.1.sequenceId": 3, "edges.0.sequenceId": 2},
        "nodes.0.sequenceId",
        "odd sequenceId 1",
    ),
    "sequenceIds counted apart": (
        {"nodes.1.sequenceId": 1, "edges.0.sequenceId": 0},
        "nodes.1.sequenceId",
        "has sequenceId 1, not 2",
    ),
    "more than a full turn of degrees": (
        {"nodes.1.nodePosition.theta": 450},
        "nodes.1.nodePosition.theta",
        "3.14",
    ),
    "a deviation in degrees alone": (
        {"nodes.1.nodePosition.theta": 1.0, "nodes.1.nodePosition.allowedDeviationTheta": 10},
        "nodes.1.nodePosition.allowedDeviationTheta",
        "3.14",
    ),
    "maxSpeed -1": ({"edges.0.maxSpeed": -1, "nodes.0.actions": None}, "edges.0.maxSpeed", "greater than"),
    "maxSpeed NaN": ({"edges.0.maxSpeed": nan}, "edges.0.maxSpeed", "finite"),
    "unknown blockingType": (
        {"edges.0.actions": [BEEP | {"blockingType": "EXCLUSIVE"}]},
        "edges.0.actions.0.blockingType",
        "HARD",
    ),
}


@pytest.mark.parametrize(("values", "field", "problem"), REFUSED.values(), ids=REFUSED)
def test_what_has_no_certain_meaning_is_refused_by_its_name_alone(
    order: dict[str, Any], values: dict[str, Any], field: str, problem: str
) -> None:
    with pytest.raises(MalformedMessageError) as caught:
        read(changed(order, values), Order)

    assert caught.value.problems[0].startswith(f"{field}: ")
    assert problem in caught.value.problems[0]
    assert caught.value.references["parameter"] == field
    assert not any(
        name in problem for problem in caught.value.problems for name in ("actions: ", "version", "headerId")
    ), "what was repaired is not named"


def test_a_missing_map_is_refused_by_a_robot_with_several(order: dict[str, Any]) -> None:
    with pytest.raises(MalformedMessageError, match=r"nodes\.0\.nodePosition\.mapId: is missing"):
        read(changed(order, {"nodes.0.nodePosition.mapId": MISSING}), Order, maps=("m", "n"))


@pytest.mark.parametrize(
    ("maps", "said", "meant"),
    [
        (("hall", "yard"), "Hall", "hall"),
        (("hall", "HALL"), "Hall", "Hall"),
        (("hall", "Hall"), "Hall", "Hall"),
        (("hall", "yard"), "attic", "attic"),
        ((), "Hall", "Hall"),
    ],
)
def test_a_map_is_read_in_any_letter_case_if_only_one_is_meant(
    order: dict[str, Any], maps: Collection[str], said: str, meant: str
) -> None:
    message, repairs = read(changed(order, {"nodes.0.nodePosition.mapId": said}), Order, maps=maps)

    assert message.nodes[0].node_position
    assert message.nodes[0].node_position.map_id == meant
    assert (f'nodes.nodePosition.mapId "{said}": letter case' in repairs) == (said != meant)


def test_the_name_of_another_robot_is_left_as_it_is(order: dict[str, Any]) -> None:
    message, repairs = read(order | {"serialNumber": "0002"}, Order)

    assert (message.serial_number, repairs) == ("0002", [])


def test_names_of_fields_are_read_in_any_letter_case_but_not_those_in_values(order: dict[str, Any]) -> None:
    beep = BEEP | {"actionParameters": [{"key": "tone", "value": {"NodeId": 1}}]}
    odd = json.loads(json.dumps(changed(order, {"nodes.0.actions": [beep]})).replace('"nodeId"', '"NODEID"'))
    odd["Nodes"] = odd.pop("nodes")

    message, repairs = read(odd, Order)
    assert message.nodes[0].actions[0].parameter("tone") == {"NodeId": 1}
    assert {'nodes "Nodes": letter case', 'nodeId "NODEID": letter case'} <= set(repairs)
