"""Route graphs of Nav2: ids, places in the map's frame, and what is left out."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from nena_plant_formats import files
from nena_plant_formats.exchange import ImportReport
from nena_plant_formats.nav2_route import write
from nena_shared.plant import PlantModel, PlantModelError
from support.plants import path, point

UP: dict[str, Any] = {"properties": {"vda5050:mapId": "up"}}
DOWN: dict[str, Any] = {"properties": {"vda5050:mapId": "down"}}


def graph(model: PlantModel, **options: Any) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return nodes and edges."""
    features = json.loads(write(model, **options).data)["features"]
    nodes = [each for each in features if each["geometry"]["type"] == "Point"]
    return nodes, [each for each in features if each not in nodes]


def test_points_are_nodes_and_forward_paths_are_edges_with_ids_of_their_own() -> None:
    model = PlantModel(
        name="hall",
        points=(point("A"), point("B", 2000, 500)),
        paths=(path("A B", 2100, max_velocity_mm_s=800),),
    )
    nodes, edges = graph(model)
    assert [each["properties"]["id"] for each in (*nodes, *edges)] == [0, 1, 2]
    assert nodes[1]["geometry"]["coordinates"] == [2.0, 0.5]
    assert nodes[1]["properties"]["frame"] == "map"
    (edge,) = edges
    assert edge["properties"] == {
        "id": 2,
        "startid": 0,
        "endid": 1,
        "cost": 2.1,
        "metadata": {"name": "A --- B", "abs_speed_limit": 0.8},
    }
    assert edge["geometry"]["coordinates"] == [[[0.0, 0.0], [2.0, 0.5]]]


def test_one_map_is_written_in_its_own_frame() -> None:
    model = PlantModel(
        name="hall",
        points=(point("A", 1000, **UP), point("B", **DOWN), point("C", 0, 1000, **UP)),
        paths=(path("A C"), path("A B")),
        properties={"nena:mapTransform.up": "x=10 rotation=90"},
    )
    nodes, edges = graph(model, map_id="up", frame="floor_2")
    assert [each["geometry"]["coordinates"] for each in nodes] == [[10.0, 1.0], [9.0, 0.0]]
    assert {each["properties"]["frame"] for each in nodes} == {"floor_2"}
    assert [each["properties"]["metadata"]["name"] for each in edges] == ["A --- C"]
    assert [(each.name, each.code) for each in write(model, map_id="up").warnings] == [
        ("B", "NOT_EXPORTED"),
        ("A --- B", "NOT_EXPORTED"),
    ]


def test_content_without_a_counterpart_is_omitted_with_a_warning() -> None:
    model = PlantModel(
        name="hall",
        points=(point("A"), point("B")),
        paths=(path("A B", max_reverse_velocity_mm_s=500), path("B A", locked=True)),
    )
    _, edges = graph(model)
    assert [each["properties"]["metadata"]["name"] for each in edges] == ["A --- B"]
    assert [each.text for each in write(model).warnings] == [
        "backward driving, which route graphs do not have",
        "locked",
    ]


@pytest.mark.parametrize(("map_id", "problem"), [(None, "name one: down, up"), ("attic", "no point is on")])
def test_the_map_must_be_certain(map_id: str | None, problem: str) -> None:
    model = PlantModel(name="hall", points=(point("A", **UP), point("B", **DOWN)))
    with pytest.raises(PlantModelError, match=problem):
        write(model, map_id=map_id)


FIELD = Path(__file__).parents[4] / "shared" / "field" / "11-route-graph.geojson"


def node(number: Any, x: Any = 0, y: Any = 0, **properties: Any) -> dict[str, Any]:
    values = {"id": number, "frame": "map", **properties}
    return {"type": "Feature", "properties": values, "geometry": {"type": "Point", "coordinates": [x, y]}}


def edge(start: Any, end: Any, shape: Any = None, **properties: Any) -> dict[str, Any]:
    values = {"id": 90, "startid": start, "endid": end, **properties}
    return {"type": "Feature", "properties": values, "geometry": shape}


def read(*features: Any) -> ImportReport:
    return files.read(json.dumps({"type": "FeatureCollection", "features": features}).encode())


def test_what_is_written_is_read_again() -> None:
    model = PlantModel(
        name="hall",
        points=(point("A"), point("B", 2000, 500), point("C", -30, 7)),
        paths=(path("A B", 2100, max_velocity_mm_s=800), path("B A", 2062), path("B C", 2089)),
    )
    again = files.read(write(model).data)
    assert again.model == model
    assert {each.code for each in again.warnings} <= {"NO_PARK_POSITION", "NOT_STRONGLY_CONNECTED"}


def test_a_graph_without_names_is_read_and_losses_are_named() -> None:
    bent = {"type": "MultiLineString", "coordinates": [[[0, 0], [1, 1], [3, 4]]]}
    straight = {"type": "LineString", "coordinates": [[0, 0], [3, 4]]}
    report = read(
        node(0, operations={"open_door": {"type": "OpenDoor"}}),
        node(1, 3, 4, metadata={"class": "dock"}),
        edge(0, 1, bent, cost=1.5, metadata={"speed_limit": 50}),
        edge(1, 0, straight, cost=20, overridable=False),
    )
    assert [(each.name, each.x_mm, each.y_mm) for each in report.model.points] == [
        ("0", 0, 0),
        ("1", 3000, 4000),
    ]
    assert [(each.name, each.length_mm) for each in report.model.paths] == [
        ("0 --- 1", 5000),
        ("1 --- 0", 20000),
    ]
    assert [each.text for each in report.warnings if each.code == "NOT_HEEDED"] == [
        "bends: the path is straight, as it is for Nav2's route server (found 1 times)",
        "metadata 'class' (found 1 times)",
        "metadata 'speed_limit' (found 1 times)",
        "operations (found 1 times)",
    ]


@pytest.mark.parametrize(
    ("features", "text"),
    [
        ([], "GeoJSON without points"),
        ([node(0), node(0)], "1 features are neither"),
        ([node(0), {"type": "Feature"}], "1 features are neither"),
        ([node(0), node(1, frame="up")], "in the frames map, up; write one file for each"),
        ([node(0, "a")], "the coordinates of a node are ['a', 0]"),
        ([node(0), edge(0, 7)], "refers to unknown point '7'"),
        ([node(0), node(1, 1), edge(0, 1, metadata={"abs_speed_limit": -1})], "maxVelocityMmS"),
        ([node(0, 1e300)], "xMm"),
    ],
)
def test_a_graph_that_cannot_be_driven_is_refused(features: list[Any], text: str) -> None:
    with pytest.raises(PlantModelError, match=re.escape(text)):
        read(*features)


def test_the_graph_of_the_field_is_read() -> None:
    if not FIELD.exists():
        pytest.skip("needs ../shared")
    model = files.read(FIELD.read_bytes()).model
    assert (model.name, len(model.points), [each.name for each in model.paths]) == (
        "hall_graph",
        2,
        ["0 --- 1"],
    )
