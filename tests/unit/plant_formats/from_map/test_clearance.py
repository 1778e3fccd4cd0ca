"""How near the paths of a plant are to the obstacles of a map."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as FilePath

import pytest

from nena_plant_formats.from_map.clearance import find_close_paths
from nena_plant_formats.from_map.free_space import RobotSize
from nena_plant_formats.from_map.proposal import propose_plant
from nena_plant_formats.from_map.robot_map import read_map
from nena_shared.plant import PlantModel
from support.drawn_maps import Pixels, hall, office, warehouse, write_map

CURVE = {
    "vehicleTypeId": "any",
    "trajectory": {
        "degree": 2,
        "knotVector": [0, 0, 0, 1, 1, 1],
        "controlPoints": [{"x": 2, "y": 2}, {"x": 5, "y": 0}, {"x": 8, "y": 2}],
    },
}


def plant(y: int, **values: object) -> PlantModel:
    """Return a path of 6 m at this height, mm, in a hall whose free space begins at 1 m."""
    ends = [{"name": name, "xMm": x, "yMm": y, **values} for name, x in (("A", 2000), ("B", 8000))]
    path = {"name": "A --- B", "source": "A", "destination": "B", "lengthMm": 6000}
    return PlantModel.model_validate({"name": "line", "points": ends, "paths": [path]})


def rooms(model: PlantModel, folder: FilePath, **values: object) -> list[str]:
    drawn = read_map(write_map(folder, hall(8, 5), **{key: str(value) for key, value in values.items()}))
    return [each.text for each in find_close_paths(model, drawn, width=0.6, clearance=0.1)]


@pytest.mark.parametrize(
    ("y", "text"),
    [
        (1450, None),
        (1350, "0.08 m beside a robot 0.6 m wide at (2.00, 1.35), wanted are 0.1 m"),
        (1200, "a robot 0.6 m wide touches an obstacle"),
        (-9000, "or leaves the known part of the map, at (2.00, -9.00)"),
    ],
)
def test_room_beside_a_path(tmp_path: FilePath, y: int, text: str | None) -> None:
    found = rooms(plant(y), tmp_path)
    assert [text in each for each in found if text] == ([True] if text else [])
    assert len(found) == bool(text)


def test_curves_other_maps_turned_maps_and_transforms(tmp_path: FilePath) -> None:
    model = plant(2000)
    assert rooms(model, tmp_path) == []
    content = model.model_dump(by_alias=True, mode="json")
    content["paths"][0]["vehicleTypes"] = [CURVE]
    assert len(rooms(PlantModel.model_validate(content), tmp_path)) == 1, "0.6 m nearer in its middle"
    elsewhere = {"vda5050:mapId": "upstairs"}
    assert rooms(plant(-9000, properties=elsewhere), tmp_path) == []
    assert len(rooms(model, tmp_path, origin="[0.0, 0.0, 1.5708]")) == 1, "the hall lies to the left"
    moved = model.model_copy(update={"properties": {"nena:mapTransform.site": "y=-1"}})
    assert len(rooms(moved, tmp_path)) == 1


@pytest.mark.parametrize("draw", [warehouse, office])
def test_proposals_keep_their_clearance(tmp_path: FilePath, draw: Callable[[], Pixels]) -> None:
    drawn = read_map(write_map(tmp_path, draw()))
    model = propose_plant(drawn, RobotSize(0.6, 0.8, 0.1), spacing=3.0, speed=1.0).model
    assert list(find_close_paths(model, drawn, width=0.6, clearance=0.1)) == []
    assert len(list(find_close_paths(model, drawn, width=0.6, clearance=0.6))) > 3
