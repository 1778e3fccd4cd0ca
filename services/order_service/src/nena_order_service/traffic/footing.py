"""Footing: what a vehicle stands on that was found somewhere, not followed there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot

from nena_order_service.traffic.resources import Resources, ResourceSet
from nena_shared.plant import PlantModel, Point
from nena_shared.plant.geometry import BoundingBox
from nena_shared.plant.planar_index import Box, PlanarIndex


@dataclass(frozen=True, slots=True)
class Found:
    """Where a vehicle was found, in mm of the plant's frame.

    ``point`` is the point where its ways begin: it is there, or ``on_point`` is False and it is nearest. A
    vehicle whose place is None is at the point, as it says.
    """

    point: str
    on_point: bool
    place_mm: tuple[float, float] | None = None
    map_id: str = ""
    """The map that the place is on; points of other maps are not looked at."""


@dataclass(frozen=True, slots=True)
class Footing:
    """What is under a vehicle, and what it needs to come to the point where its ways begin."""

    under: ResourceSet
    entry: ResourceSet | None = None


class Footings:
    """Tells what is under vehicles on one plant.

    On a point that is the point. Beside it, these are the paths, as straight lines, and the points that come
    nearer to the vehicle than it reaches around itself; far from all of them it stands on nothing.
    """

    def __init__(self, plant: PlantModel, resources: Resources) -> None:
        self._plant = plant
        self._resources = resources
        places = plant.points_by_name
        self._points = PlanarIndex((_box(each), each) for each in plant.points)
        self._paths = PlanarIndex(
            (_box(places[each.source], places[each.destination]), each) for each in plant.paths
        )

    def of(self, found: Found, box: BoundingBox) -> Footing:
        """Give the footing of a vehicle of this size."""
        reach_mm = box.length_mm / 2 + abs(box.reference_offset_x_mm)
        members = list(dict.fromkeys(self._under(found, reach_mm)))
        under = self._resources.on(found.point, members)
        if found.on_point or found.place_mm is None:
            return Footing(under)
        point = self._plant.point(found.point)
        way_mm = hypot(point.x_mm - found.place_mm[0], point.y_mm - found.place_mm[1])
        return Footing(under, self._resources.on(found.point, (found.point,), length_mm=round(way_mm)))

    def _under(self, found: Found, reach_mm: float) -> Iterator[str]:
        if found.on_point or found.place_mm is None:
            yield found.point
        if found.place_mm is None:
            return
        x_mm, y_mm = found.place_mm
        for point in self._points.near(x_mm, y_mm, reach_mm):
            near = hypot(point.x_mm - x_mm, point.y_mm - y_mm) < reach_mm
            if near and self._on_map(point.name, found):
                yield point.name
        if not found.on_point:
            yield from self._paths_under(found, (x_mm, y_mm), reach_mm)

    def _paths_under(self, found: Found, place_mm: tuple[float, float], reach_mm: float) -> Iterator[str]:
        points = self._plant.points_by_name
        for path in self._paths.near(*place_mm, reach_mm):
            one, other = points[path.source], points[path.destination]
            ends = ((one.x_mm, one.y_mm), (other.x_mm, other.y_mm))
            if self._on_map(one.name, found) and _distance_mm(place_mm, *ends) < reach_mm:
                yield path.name

    def _on_map(self, point: str, found: Found) -> bool:
        map_id = self._plant.points_by_name[point].map_id
        return not map_id or not found.map_id or map_id == found.map_id


def _box(*points: Point) -> Box:
    xs, ys = [each.x_mm for each in points], [each.y_mm for each in points]
    return Box(min(xs), min(ys), max(xs), max(ys))


def _distance_mm(place: tuple[float, float], one: tuple[float, float], other: tuple[float, float]) -> float:
    """Give the distance of a place from the line between two others."""
    along = (other[0] - one[0], other[1] - one[1])
    apart = (place[0] - one[0], place[1] - one[1])
    square = along[0] ** 2 + along[1] ** 2
    share = min(max((apart[0] * along[0] + apart[1] * along[1]) / square, 0.0), 1.0) if square else 0.0
    return hypot(apart[0] - share * along[0], apart[1] - share * along[1])
