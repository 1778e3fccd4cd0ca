"""What robots are sent for a plant that was made for openTCS's own driver of VDA 5050."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from math import pi
from typing import Any

import pytest

from nena_order_service.fleet.feasibility import fitted_order
from nena_order_service.fleet.link import Dialect
from nena_order_service.fleet.robot import Abilities
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.fleet_api.transport_order import Property
from nena_shared.plant import Link, Location, LocationType, PlantModel, Vehicle
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import codec_named
from support.fleet_examples import factsheet
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine

VERSIONS = ["2.0", "2.1", "3.0"]


def keyed(properties: dict[str, str]) -> dict[str, str]:
    return {f"vda5050:{key}": value for key, value in properties.items()}


def hall(**properties: dict[str, str]) -> PlantModel:
    """Return the row A, B, C with a press at C; ``ab`` and ``bc`` are paths, and may be driven backwards."""
    own = {name: keyed(given) for name, given in properties.items()}
    two_ways = {"max_reverse_velocity_mm_s": 500}
    return PlantModel(
        name="hall",
        points=tuple(
            point(name, 4000 * index, properties=own.get(name.lower(), {}))
            for index, name in enumerate("ABC")
        ),
        paths=(
            path("A B", 4000, properties=own.get("ab", {}), **two_ways),
            path("B C", 4000, properties=own.get("bc", {}), **two_ways),
        ),
        location_types=(
            LocationType(
                name="Press",
                allowed_operations=("Load", "Press.Now", "Charge", "Recharge"),
                properties=own.get("type", {}),
            ),
        ),
        locations=(
            Location(name="Press 1", type="Press", links=(Link(point="C"),), properties=own.get("press", {})),
        ),
        vehicles=(Vehicle(name="V1", properties=own.get("vehicle", {})),),
    )


async def vda_order(plant: PlantModel, goal: str = "Press 1:Load", start: str = "A", **more: str) -> VdaOrder:
    fleet = ScriptedFleet({})
    engine = await make_engine(plant, MemoryStore(), fleet, release_ahead=0)
    fleet.appear("V1", start)
    order = request(goal, name="T-1")
    destinations = tuple(
        each.model_copy(
            update={
                "properties": tuple(
                    Property(key=f"vda5050:{key.replace('_', '.')}", value=value)
                    for key, value in more.items()
                )
            }
        )
        for each in order.destinations
    )
    engine.create(order.model_copy(update={"destinations": destinations}), "T-1")
    ((_, sent),) = fleet.sent
    return sent


def on_the_wire(
    sent: VdaOrder, version: str = "2.1", abilities: Abilities | None = None, dialect: Dialect | None = None
) -> dict[str, Any]:
    stored = VdaOrder.model_validate_json(sent.model_dump_json(by_alias=True, exclude_none=True))
    fitted = fitted_order(stored, abilities)
    codec = codec_named(version)
    message = Order(
        header_id=1,
        timestamp=datetime(2026, 1, 1, tzinfo=UTC),
        version=codec.version,
        manufacturer="ACME",
        serial_number="r1",
        order_id=fitted.order_id,
        order_update_id=0,
        nodes=fitted.nodes,
        edges=fitted.edges,
    )
    payload = (dialect or Dialect()).rename_keys(Topic.ORDER, codec.encode(message))
    found: dict[str, Any] = json.loads(payload)
    assert b"turns" not in payload.lower()
    return found


def actions(part: dict[str, Any]) -> list[tuple[str, str, dict[str, Any]]]:
    return [
        (
            each["actionType"],
            each["blockingType"],
            {parameter["key"]: parameter["value"] for parameter in each.get("actionParameters", ())},
        )
        for each in part["actions"]
    ]


BEEP = {"action.01": "beep"}
DOOR = {
    "action.02": "closeDoor",
    "action.01": "openDoor",
    "action.01.blockingType": "Hard",
    "action.01.parameter.door": "D7",
    "action.01.parameter.number": "integer:7",
    "action.01.parameter.height": "float:2",
    "action.01.parameter.fast": "boolean:True",
    "action.01.parameter.text": "string:integer:7",
    "action.01.parameter.bad": "integer:seven",
}


@pytest.mark.parametrize("version", VERSIONS)
async def test_actions_of_paths_and_points_are_in_the_order(version: str) -> None:
    order = on_the_wire(await vda_order(hall(a=BEEP, bc=DOOR), "C"), version)
    assert [actions(edge) for edge in order["edges"]] == [
        [],
        [
            (
                "openDoor",
                "HARD",
                {"door": "D7", "number": 7, "height": 2.0, "fast": True, "text": "integer:7"},
            ),
            ("closeDoor", "NONE", {}),
        ],
    ]
    assert [actions(node) for node in order["nodes"]] == [[("beep", "NONE", {})], [], []]
    ids = [each["actionId"] for part in (*order["nodes"], *order["edges"]) for each in part["actions"]]
    assert len(set(ids)) == 3


@pytest.mark.parametrize(
    ("when", "at"),
    [
        (None, "ABC"),
        ("PASSING", "B"),
        ("ORDER_START | ORDER_END", "AC"),
        ("ORDER_END|nonsense", "C"),
        ("order_end", "C"),
        ("nonsense", ""),
    ],
)
async def test_actions_of_points_wait_for_their_triggers(when: str | None, at: str) -> None:
    own = BEEP if when is None else {**BEEP, "action.01.when": when}
    order = on_the_wire(await vda_order(hall(a=own, b=own, c=own), "C"))
    assert "".join(node["nodeId"] for node in order["nodes"] if node["actions"]) == at


async def test_an_order_without_a_drive_ends_where_it_starts() -> None:
    order = on_the_wire(await vda_order(hall(c={**BEEP, "action.01.when": "ORDER_END"}), "C", "C"))
    assert [actions(node) for node in order["nodes"]] == [[("beep", "NONE", {})]]


@pytest.mark.parametrize(
    ("vehicle", "bc", "at"),
    [
        ({}, {}, "BC"),
        ({"actionTags": "*"}, {"actionTags": "default"}, "BC"),
        ({"actionTags": "line 1 | other"}, {}, "B"),
        ({"actionTags": ""}, {}, ""),
        ({}, {"actionTags": "other"}, "B"),  # of the node behind the path
    ],
)
async def test_tags_of_vehicles_and_paths_let_actions_pass(
    vehicle: dict[str, str], bc: dict[str, str], at: str
) -> None:
    tagged = {**BEEP, "action.01.tags": "line 1 | line 2"}
    order = on_the_wire(await vda_order(hall(b=tagged, c=BEEP, vehicle=vehicle, bc=bc), "C"))
    assert "".join(node["nodeId"] for node in order["nodes"] if node["actions"]) == at


async def test_a_vehicle_overrides_blocking_types() -> None:
    vehicle = {"action.beep.blockingType": "SOFT", "action.openDoor.blockingType": "NONE"}
    order = on_the_wire(await vda_order(hall(a=BEEP, bc=DOOR, vehicle=vehicle), "C"))
    assert actions(order["nodes"][0])[0][1] == "SOFT"
    assert actions(order["edges"][1])[0][1] == "NONE"


@pytest.mark.parametrize("version", VERSIONS)
async def test_the_action_at_a_destination_is_that_of_its_location(version: str) -> None:
    kind = {
        "destinationAction.Load.blockingType": "SOFT",
        "destinationAction.Load.parameter.stationType": "shelf",
        "destinationAction.Load.parameter.height": "float:0.5",
    }
    press = {
        "destinationAction.Load.parameter.stationType": "floor",
        "destinationAction.Load.blockingType": "?",
        "destinationAction.Other.parameter.x": "1",
        "action.1": "look",
    }
    order = on_the_wire(await vda_order(hall(c=BEEP, type=kind, press=press)), version)
    assert actions(order["nodes"][-1]) == [
        ("beep", "NONE", {}),
        ("look", "NONE", {}),
        ("Load", "SOFT", {"stationType": "floor", "height": 0.5}),
    ]


async def test_a_destination_of_an_order_takes_precedence() -> None:
    sent = await vda_order(
        hall(press={"destinationAction.Load.parameter.x": "1", "destinationAction.Load.parameter.y": "2"}),
        destinationAction_parameter_x="integer:5",
        destinationAction_blockingType="HARD",
        action_1="wave",
    )
    assert actions(on_the_wire(sent)["nodes"][-1]) == [
        ("Load", "HARD", {"x": 5, "y": "2"}),
        ("wave", "NONE", {}),
    ]


@pytest.mark.parametrize(
    ("own", "operation", "sent"),
    [
        ("Recharge", "Recharge", "startCharging"),
        (None, "Recharge", "Recharge"),
        (None, "Charge", "startCharging"),
    ],
)
async def test_the_recharge_operation_of_a_vehicle_is_to_charge(
    own: str | None, operation: str, sent: str
) -> None:
    plant = hall(
        vehicle={"rechargeOperation": own} if own else {},
        type={f"destinationAction.{operation}.parameter.x": "1"} if sent == "startCharging" else {},
    )
    order = on_the_wire(await vda_order(plant, f"Press 1:{operation}"))
    ((action_type, _, parameters),) = actions(order["nodes"][-1])
    assert (action_type, parameters) == (sent, {})


ABILITIES = [None, Abilities(factsheet()), Abilities(factsheet(takes=("order.edges.maximumSpeed",)))]


@pytest.mark.parametrize("abilities", ABILITIES)
@pytest.mark.parametrize(("version", "rotation"), [("2.0", False), ("2.1", False), ("3.0", True)])
async def test_headings_on_paths_reach_each_robot(
    version: str, *, rotation: bool, abilities: Abilities | None
) -> None:
    back = {"orientation.forward": "180", "rotationAllowed.forward": "false", "orientation.reverse": "1"}
    forward, other = on_the_wire(await vda_order(hall(ab=back), "C"), version, abilities)["edges"]
    key = "reachOrientationBeforeEntering" if version == "3.0" else "rotationAllowed"
    assert (forward["orientation"], forward[key]) == (pytest.approx(pi), rotation)
    assert "orientationType" not in forward
    assert "orientation" not in other


@pytest.mark.parametrize(
    ("properties", "orientation", "allowed"),
    [
        ({"orientation.forward": "10"}, None, None),
        ({"orientation.reverse": "-270", "rotationAllowed.reverse": "TRUE"}, pi / 2, True),
        ({"orientation.reverse": "x", "rotationAllowed.reverse": "maybe"}, None, None),
        ({"rotationAllowed.reverse": "false"}, None, False),
    ],
)
async def test_backwards_on_a_path_its_reverse_headings_count(
    properties: dict[str, str], orientation: float | None, *, allowed: bool | None
) -> None:
    (edge,) = on_the_wire(await vda_order(hall(ab=properties), "A", "B"))["edges"]
    assert edge.get("orientation") == (None if orientation is None else pytest.approx(orientation))
    assert edge.get("rotationAllowed") is allowed


@pytest.mark.parametrize("version", VERSIONS)
async def test_deviations_of_points_come_before_those_of_the_vehicle(version: str) -> None:
    plant = hall(
        b={"deviationXY": "0.05", "deviationTheta": "5"},
        c={"deviationXY": "text"},
        vehicle={"deviationXY": "0.3", "deviationTheta": "20"},
    )
    turned = tuple(each.model_copy(update={"orientation_deg": 90.0}) for each in plant.points)
    positions = [
        node["nodePosition"]
        for goal in ("B", "C")
        for node in on_the_wire(await vda_order(plant.model_copy(update={"points": turned}), goal), version)[
            "nodes"
        ]
    ]
    found = [each["allowedDeviationXY"] for each in positions]
    radii = [each["a"] if isinstance(each, dict) else each for each in found]
    assert radii == [0.5, 0.05, 0.5, 0.05, 0.3]  # a robot outside its first node's would refuse the order
    at_b, at_c = positions[1]["allowedDeviationTheta"], positions[4]["allowedDeviationTheta"]
    assert (at_b, at_c) == (pytest.approx(pi / 36), pytest.approx(pi / 9))


@pytest.mark.parametrize("version", VERSIONS)
async def test_fields_that_a_vehicle_does_not_support_are_not_sent(version: str) -> None:
    unsupported = {
        "optionalParams.order.nodes.nodePosition.allowedDeviationXY": "NOT_SUPPORTED",
        "optionalParams.order.edges.rotationAllowed": "NOT_SUPPORTED",
        "optionalParams.order.edges.orientation": "SUPPORTED",
        "optionalParams.order.nodes.actions.actionDescription": "NOT_SUPPORTED",
        "optionalParams.order.nodes.nodeId": "NOT_SUPPORTED",
    }
    plant = hall(
        vehicle=unsupported, c=BEEP, bc={"rotationAllowed.forward": "true", "orientation.forward": "0"}
    )
    dialect = Dialect.from_vehicle(plant.vehicles[0])
    order = on_the_wire(await vda_order(plant, "C"), version, dialect=dialect)
    for node in order["nodes"]:
        assert node["nodeId"]
        assert "allowedDeviationXY" not in node["nodePosition"]
        assert not any("Descri" in key for action in node["actions"] for key in action)
    edge = order["edges"][1]
    assert "orientation" in edge
    assert not {"rotationAllowed", "reachOrientationBeforeEntering"} & set(edge)


@pytest.mark.parametrize(
    ("limits", "released"),
    [
        ({"maxStepsBase": "1"}, 1),
        ({"maxDistanceBase": "4000"}, 1),
        ({"maxDistanceBase": "4001"}, 2),
        ({"maxStepsBase": "2", "maxDistanceBase": "1"}, 1),
        ({"maxStepsBase": "none"}, 2),
        ({}, 2),
    ],
)
async def test_a_base_ends_at_the_limits_of_its_vehicle(limits: dict[str, str], released: int) -> None:
    plant, fleet = hall(vehicle=limits), ScriptedFleet({})
    engine = await make_engine(plant, MemoryStore(), fleet, release_ahead=0)
    fleet.appear("V1", "A")
    engine.create(request("C", name="T-1"), "T-1")
    ((_, sent),) = fleet.sent
    assert [node.released for node in sent.nodes].count(True) == 1 + released
    fleet.pass_node("V1", 1)
    assert len(fleet.extended) == (1 if released == 1 else 0)
