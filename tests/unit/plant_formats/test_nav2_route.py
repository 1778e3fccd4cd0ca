"""Route graphs of Nav2: ids, places in the map's frame, and what is left out."""

from __future__ import annotations

import json
from typing import Any

import pytest

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
