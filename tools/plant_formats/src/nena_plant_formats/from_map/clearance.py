"""Paths of a plant that are nearer to the obstacles of a robot's map than robots should be."""

from collections.abc import Iterator
from typing import Final

import numpy as np
from scipy import ndimage

from nena_plant_formats.from_map.free_space import Cells
from nena_plant_formats.from_map.robot_map import RobotMap
from nena_shared.plant import PlantModel, PlantProblem, curve
from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.geometry import MapTransform, PlantPlace
from nena_shared.plant.model import map_transforms
from nena_shared.plant.track import Path

STEP: Final = 0.02
"""Distance of the places of a path that are looked at, m."""


def find_close_paths(
    model: PlantModel, robot_map: RobotMap, *, width: float, clearance: float
) -> Iterator[PlantProblem]:
    """Yield the paths on a map beside which robots of this width (m) have less room than ``clearance`` (m).

    A map says to within a cell where an obstacle is: so much nearer is near enough.
    """
    # What is outside the map is unknown.
    distance = ndimage.distance_transform_edt(np.pad(robot_map.free, 1)) * robot_map.resolution
    transform = map_transforms(model).get(robot_map.name, MapTransform())
    for path in model.paths:
        ends = (model.point(path.source), model.point(path.destination))
        if any(end.map_id not in (None, robot_map.name) for end in ends):
            continue
        for line in _lines_of(path, [(end.x_m, end.y_m) for end in ends]):
            on_map = [transform.to_map(PlantPlace(*place)) for place in line]
            cells = robot_map.to_cells(np.array([(each.x_m, each.y_m) for each in on_map]))
            room = ndimage.map_coordinates(distance, cells.T[::-1] + 1, order=1) - width / 2
            nearest = int(room.argmin())
            if room[nearest] < clearance:
                yield _problem(path, line[nearest], float(room[nearest]), width, clearance)
                break


def _lines_of(path: Path, ends: list[tuple[float, float]]) -> Iterator[list[tuple[float, float]]]:
    """Yield the places of a path: of each of its curves, or of the straight line."""
    curves = [each.trajectory for each in path.vehicle_types if each.trajectory]
    for trajectory in curves:
        yield [(float(x), float(y)) for x, y in curve.steps(trajectory, STEP)]
    if not curves:
        (x1, y1), (x2, y2) = ends
        steps: Cells = np.linspace(0, 1, max(2, int(np.hypot(x2 - x1, y2 - y1) / STEP)))
        yield [(x1 + (x2 - x1) * float(at), y1 + (y2 - y1) * float(at)) for at in steps]


def _problem(
    path: Path, place: tuple[float, float], room: float, width: float, clearance: float
) -> PlantProblem:
    where = f"at ({place[0]:.2f}, {place[1]:.2f})"
    text = (
        f"{room:.2f} m beside a robot {width:g} m wide {where}, wanted are {clearance:g} m"
        if room > 0
        else f"a robot {width:g} m wide touches an obstacle, or leaves the known part of the map, {where}"
    )
    return PlantProblem(
        "PATH_TOO_CLOSE", ObjectKind.PATH, path.name, f"{text}: move the path, or close it to wide robots"
    )
