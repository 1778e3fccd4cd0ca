"""What is written as LIF keeps to LIF, and comes back as it was, save what the warnings name."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from math import pi
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_demo.plants import sample_plant_path
from nena_plant_formats.lif import read, write
from nena_plant_formats.lif.losses import export_warnings
from nena_plant_formats.lif.reader import UNLIMITED_SIZE
from nena_plant_formats.lif.writer import distinct_ids
from nena_plant_formats.opentcs_xml import read as read_opentcs
from nena_shared.plant import (
    Block,
    BoundingBox,
    ConnectionType,
    Envelope,
    Link,
    Location,
    LocationType,
    Path,
    PathLayout,
    PeripheralOperation,
    PlantModel,
    Point,
    PointType,
    Vehicle,
)
from nena_shared.plant.track import PathTrajectory, TrajectoryPoint, VehicleTypeOnPath
from support.lif_files import action, edge, layout, lif, lif_of, node, use
from support.plants import path, plant, point
from support.reference import reference_dir

NOW = datetime(2026, 11, 20, 10, 0, tzinfo=UTC)


def written(model: PlantModel, **more: Any) -> dict[str, Any]:
    return dict(json.loads(write(model, at=NOW, **more).data))


def export_warnings_of(model: PlantModel) -> list[str]:
    return [problem.text.split(" (")[0] for problem in write(model, at=NOW).warnings]


RICH = (
    node(
        "A",
        0,
        0,
        vehicleTypeNodeProperties=[{"vehicleTypeId": "t", "actions": [action("pick")], "theta": 1.0}],
    ),
    node("B", 3, 4, nodeName="bay", nodeDescription="of the truck"),
    edge(
        "A B",
        use(
            maxSpeed=1.5,
            vehicleOrientation=pi,
            rotationAtStartNodeAllowed="NONE",
            minHeight=0.1,
            loadRestriction={"loaded": True, "unloaded": True, "loadSetNames": ["pallet"]},
            trajectory={"knotVector": [0, 0, 1, 1], "controlPoints": [{"x": 0, "y": 0}, {"x": 3, "y": 4}]},
            actions=[action("beep", actionParameters=[{"key": "k", "value": "v"}])],
        ),
        edgeName="ramp",
    ),
    edge("B A", edgeId="B"),
    {
        "stationId": "A",
        "interactionNodeIds": ["A"],
        "stationName": "rack",
        "stationHeight": 1.25,
        "stationPosition": {"x": 0.5, "y": 0.0, "theta": 0.5},
    },
    {"stationId": "S", "interactionNodeIds": ["A", "B"]},
)


@pytest.mark.parametrize(
    "data",
    [
        lif_of(*RICH),
        lif(
            layout(node("A"), edge("A B"), layoutName="Ground", layoutLevelId="0", layoutDescription="d"),
            layout(node("B", 0, 0, mapId="n"), edge("B A"), layoutId="up", layoutVersion="7"),
        ),
    ],
)
def test_lif_round_trip(data: bytes) -> None:
    report = write(read(data).model, at=NOW)
    assert report.warnings == ()
    assert json.loads(report.data)["layouts"] == json.loads(data)["layouts"]


@pytest.mark.parametrize("name", ["vdma-10.13-charging-station.lif.json", "vdma-10.14-two-levels.lif.json"])
def test_samples_come_back_as_the_format_demands(name: str) -> None:
    model = read(reference_dir("lif-samples", name).read_bytes()).model
    again = read(write(model, at=NOW).data, strict=True).model
    assert again.points == model.points
    assert again.paths == model.paths
    assert again.locations == model.locations
    assert again.visual_layout == model.visual_layout


@pytest.mark.parametrize(
    "name",
    [
        "demo-01.v7.0.0.xml",
        "all-features.v7.0.0.xml",
        "all-features.v0.0.4.xml",
        "nena-turtlebot3.v0.0.2.xml",
        "sample plant",
    ],
)
def test_plants_of_opentcs_become_strict_lif(name: str) -> None:
    sample = name == "sample plant"
    file = sample_plant_path() if sample else reference_dir("opentcs-plant-models", name)
    model = read_opentcs(file.read_bytes()).model
    again = read(write(model, at=NOW).data, strict=True).model
    places = [(each.name, each.x_mm, each.y_mm, each.heading_rad) for each in model.points]
    assert [(each.name, each.x_mm, each.y_mm) for each in again.points] == [each[:3] for each in places]
    assert [each.heading_rad for each in again.points] == pytest.approx([each[3] for each in places])
    ways = [(each.id, each.source, each.destination, each.max_velocity_mm_s) for each in model.edges()]
    assert [
        (each.id, each.source, each.destination, each.max_velocity_mm_s) for each in again.edges()
    ] == ways
    assert {each.name for each in again.locations} == {each.name for each in model.locations if each.links}


def test_a_path_for_both_directions_becomes_two_edges() -> None:
    edges = written(plant(path("A B", max_reverse_velocity_mm_s=300)))["layouts"][0]["edges"]
    forward, backward = (each["vehicleTypeEdgeProperties"][0] for each in edges)
    assert [each["edgeId"] for each in edges] == ["A --- B", "A --- B:backward"]
    assert (edges[1]["startNodeId"], edges[1]["endNodeId"]) == ("B", "A")
    assert (forward["vehicleOrientation"], forward["maxSpeed"]) == (0, 1)
    assert (backward["vehicleOrientation"], backward["maxSpeed"]) == (pi, 0.3)


def test_operations_of_a_location_become_actions_of_its_nodes() -> None:
    model = plant(
        points="A B",
        location_types=(LocationType(name="T", allowed_operations=("Load cargo", "Charge", "beep")),),
        locations=(Location(name="L", type="T", links=(Link(point="A", allowed_operations=("Charge",)),)),),
    )
    first, second = written(model)["layouts"][0]["nodes"]
    (only,) = first["vehicleTypeNodeProperties"][0]["actions"]
    assert (only["actionType"], only["requirementType"]) == ("startCharging", "OPTIONAL")
    assert "actions" not in second["vehicleTypeNodeProperties"][0]


def test_map_and_types_default_to_those_of_the_vehicles() -> None:
    kinds = {"vda5050:mapId": "hall", "nena:vehicleType": "ACME.T"}
    model = plant(path("A B"), vehicles=(Vehicle(name="V", properties=kinds),))
    (first, _) = written(model)["layouts"][0]["nodes"]
    assert first["mapId"] == "hall"
    assert [each["vehicleTypeId"] for each in first["vehicleTypeNodeProperties"]] == ["ACME.T"]
    (first, _) = written(model, map_id="m", vehicle_types=["t", "u"])["layouts"][0]["nodes"]
    assert first["mapId"] == "m"
    assert [each["vehicleTypeId"] for each in first["vehicleTypeNodeProperties"]] == ["t", "u"]
    (first, _) = written(plant(path("A B")))["layouts"][0]["nodes"]
    assert (first["mapId"], first["vehicleTypeNodeProperties"]) == ("map", [{"vehicleTypeId": "vehicle"}])


def test_content_that_lif_cannot_hold_is_reported() -> None:
    model = PlantModel(
        name="m",
        points=(point("A", z_mm=1), point("B", 1000, type=PointType.PARK_POSITION)),
        paths=(path("A B", 1500, locked=True),),
        location_types=(LocationType(name="T", allowed_peripheral_operations=("open",)),),
        locations=(Location(name="L", type="T", locked=True),),
        blocks=(Block(name="K"),),
        vehicles=(Vehicle(name="V"),),
        properties={"tcs:modelFileLastModified": "2026"},
    )
    assert export_warnings_of(model) == [
        "parking positions",
        "heights",
        "path locks, which are dropped",
        "path lengths other than the distance between the end points",
        "locations without a link",
        "location locks, which are dropped",
        "peripheral operations of location types",
        "blocks",
        "vehicles",
        "properties",
    ]


def test_empty_and_duplicate_ids_are_not_used() -> None:
    same = {"lif:id": "1"}
    stations = (
        Location(name=name, type="T", links=(Link(point="A"),), properties={"lif:id": own})
        for name, own in (("L", "1"), ("M", "1"), ("N", ""))
    )
    model = plant(
        path("A B", properties=same),
        path("B A", properties=same),
        path("A B", name="C", properties={"lif:id": "2"}),
        location_types=(LocationType(name="T"),),
        locations=tuple(stations),
    )
    hall = written(model)["layouts"][0]
    assert [each["edgeId"] for each in hall["edges"]] == ["A --- B", "B --- A", "2"]
    assert [each["stationId"] for each in hall["stations"]] == ["L", "M", "N"]


@pytest.mark.parametrize("height", ["high", "inf", "1e999", "nan", "-1", ""])
def test_invalid_properties_are_ignored(height: str) -> None:
    spoilt = {"lif:stationHeight": height, "lif:stationPosition": "there"}
    here = Location(name="L", type="T", x_mm=1500, links=(Link(point="A"),), properties=spoilt)
    model = plant(points="A", location_types=(LocationType(name="T"),), locations=(here,))
    (station,) = written(model)["layouts"][0]["stations"]
    assert "stationHeight" not in station
    assert station["stationPosition"] == {"x": 1.5, "y": 0.0}


@pytest.mark.parametrize(
    ("wanted", "ids"),
    [
        ({"A": "1", "B": None}, {"A": "1", "B": "B"}),
        ({"A": "", "B": "1"}, {"A": "A", "B": "1"}),
        ({"A": "1", "B": "1", "C": "2"}, {"A": "A", "B": "B", "C": "2"}),
        ({"A": "B", "B": None}, {"A": "A", "B": "B"}),
        ({"A": "B", "B": "A"}, {"A": "B", "B": "A"}),
        ({"A": "1", "B": "1", "C": "A"}, {"A": "A", "B": "B", "C": "C"}),
    ],
)
def test_unique_id_is_kept(wanted: dict[str, str | None], ids: dict[str, str]) -> None:
    assert distinct_ids(wanted) == ids


@given(st.dictionaries(st.sampled_from("ABCDE"), st.none() | st.sampled_from(["", *"ABCDE12"])))
def test_ids_are_distinct_and_each_is_the_wanted_one_or_the_name(wanted: dict[str, str | None]) -> None:
    ids = distinct_ids(wanted)
    assert list(ids) == list(wanted)
    assert len(set(ids.values())) == len(ids)
    assert all(each and each in (wanted[name], name) for name, each in ids.items())


def model(
    first: Point | None = None, way: Path | None = None, kind: LocationType | None = None, **more: Any
) -> PlantModel:
    """Make two points 1 m apart with a path between; without more LIF holds all of it."""
    content: dict[str, Any] = {
        "points": (first or point("A"), point("B", 1000)),
        "paths": (way or path("A B"),),
        "location_types": (kind or LocationType(name="T"),),
        "locations": (Location(name="L", type="T", links=(Link(point="A"),)),),
        **more,
    }
    return PlantModel(name="m", **content)


def not_exported(plant: PlantModel) -> list[str]:
    found = list(export_warnings(plant))
    assert all((each.code, each.name) == ("NOT_EXPORTED", "m") for each in found)
    return [each.text.removesuffix(": not representable in LIF") for each in found]


OPERATION = PeripheralOperation(name="open", location="L")
BENT = PathLayout(connection_type=ConnectionType.POLYPATH)
DRAWN = VehicleTypeOnPath(
    vehicle_type_id="t",
    rotation_allowed=False,
    trajectory=PathTrajectory(
        knot_vector=(0, 0, 1, 1), control_points=(TrajectoryPoint(x=0, y=0), TrajectoryPoint(x=1, y=0))
    ),
)


@pytest.mark.parametrize(
    "plant",
    [
        model(),
        model(first=point("A", max_vehicle_bounding_box=UNLIMITED_SIZE)),
        model(first=point("A", properties={"vda5050:mapId": "m", "lif:name": "x"})),
        model(way=path("A B", 1001)),
        model(first=point("A", 1000), way=path("A B", 2)),
        model(way=path("A B", 1700, vehicle_types=(DRAWN,), layout=BENT)),
    ],
)
def test_representable_content_is_no_loss(plant: PlantModel) -> None:
    assert not_exported(plant) == []


@pytest.mark.parametrize(
    ("plant", "loss"),
    [
        (model(first=point("A", type=PointType.PARK_POSITION)), "parking positions"),
        (
            model(first=point("A", max_vehicle_bounding_box=BoundingBox(length_mm=1))),
            "maximum vehicle sizes at points",
        ),
        (model(first=point("A", envelopes=(Envelope(key="e", vertices=()),))), "envelopes of points"),
        (model(first=point("A", z_mm=-1)), "heights (z) of points"),
        (model(way=path("A B", locked=True)), "path locks, which are dropped"),
        (model(way=path("A B", envelopes=(Envelope(key="e", vertices=()),))), "envelopes of paths"),
        (model(way=path("A B", peripheral_operations=(OPERATION,))), "peripheral operations of paths"),
        (model(way=path("A B", 1002)), "path lengths other than the distance between the end points"),
        (model(way=path("A B", layout=BENT)), "drawn shapes of paths, which become straight"),
        (model(locations=(Location(name="L", type="T"),)), "locations without a link"),
        (
            model(locations=(Location(name="L", type="T", links=(Link(point="A"),), locked=True),)),
            "location locks, which are dropped",
        ),
        (
            model(kind=LocationType(name="T", allowed_peripheral_operations=("open",))),
            "peripheral operations of location types",
        ),
        (model(blocks=(Block(name="K"),)), "blocks"),
        (model(vehicles=(Vehicle(name="V"),)), "vehicles"),
        (model(properties={"tcs:x": "1", "lif:creator": "me"}), "properties"),
        (model(way=path("A B", properties={"a": "1"})), "properties"),
    ],
)
def test_each_loss_is_reported_with_its_count(plant: PlantModel, loss: str) -> None:
    assert not_exported(plant) == [f"{loss} (1 times)"]


def test_many_of_a_kind_are_one_loss() -> None:
    blocks = tuple(Block(name=name) for name in "KLM")
    assert not_exported(model(blocks=blocks)) == ["blocks (3 times)"]
