"""The points and paths of a plant in an area."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

from nena_shared.fleet_api.stops import Area
from nena_shared.plant import Path, PlantModel, Point
from nena_shared.plant.curve import CUBIC_BEZIER_KNOTS, fault, places
from nena_shared.plant.track import MM_PER_M, ConnectionType, PathTrajectory, TrajectoryPoint

Line = Sequence[tuple[float, float]]

BEZIER_POINTS: Final = 4
"""Points of a cubic Bezier curve, with its ends."""


def resources_in(plant: PlantModel, area: Area) -> frozenset[str]:
    """Return the names of the points and paths that touch an area.

    A path counts by its straight line, its drawing and its trajectories, as it is unknown which of them a
    robot follows. Points without a map count on every map.
    """
    points = {
        point.name
        for point in plant.points
        if _is_on_map(point, area) and area.contains(point.x_m, point.y_m)
    }
    paths = {path.name for path in plant.paths if _touches_area(plant, path, area)}
    return frozenset(points | paths)


def _is_on_map(point: Point, area: Area) -> bool:
    return None in (point.map_id, area.map_id) or point.map_id == area.map_id


def _touches_area(plant: PlantModel, path: Path, area: Area) -> bool:
    ends = plant.point(path.source), plant.point(path.destination)
    if not any(_is_on_map(point, area) for point in ends):
        return False
    return any(area.crosses(*segment) for line in _possible_lines(path, *ends) for segment in pairwise(line))


def _possible_lines(path: Path, source: Point, destination: Point) -> Iterator[Line]:
    """Yield all lines along which a path may lead, m in the plant frame."""
    start, end = (source.x_m, source.y_m), (destination.x_m, destination.y_m)
    yield (start, end)
    drawn = (
        start,
        *((point.x_mm / MM_PER_M, point.y_mm / MM_PER_M) for point in path.layout.control_points),
        end,
    )
    if path.layout.connection_type in (ConnectionType.BEZIER, ConnectionType.BEZIER_3):
        for first in range(0, len(drawn) - BEZIER_POINTS + 1, BEZIER_POINTS - 1):
            points = drawn[first : first + BEZIER_POINTS]
            controls = tuple(TrajectoryPoint(x=x, y=y) for x, y in points)
            yield places(PathTrajectory(degree=3, knot_vector=CUBIC_BEZIER_KNOTS, control_points=controls))
    elif len(drawn) > len((start, end)):
        yield drawn
    for use in path.vehicle_types:
        if use.trajectory and not fault(use.trajectory):
            yield places(use.trajectory)
