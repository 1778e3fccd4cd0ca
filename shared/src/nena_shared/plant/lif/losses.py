"""What of a plant model LIF cannot hold; one warning for each kind of thing."""

from collections.abc import Iterator
from math import hypot
from typing import Final

from nena_shared.plant import property_keys as keys
from nena_shared.plant.errors import ObjectKind, Problem
from nena_shared.plant.geometry import BoundingBox
from nena_shared.plant.lif.to_plant import UNLIMITED_SIZE
from nena_shared.plant.model import PlantModel
from nena_shared.plant.path import ConnectionType, Path
from nena_shared.plant.point import PointType

_SAME_LENGTH_MM: Final = 1.0
_KEPT: Final = ("lif:", keys.VDA5050_MAP_ID)


def losses(model: PlantModel) -> Iterator[Problem]:
    """Yield what an export to LIF leaves out."""
    for what, times in (*_of_points(model), *_of_paths(model), *_of_the_rest(model)):
        if times:
            text = f"{what} ({times} times): LIF has nothing for this"
            yield Problem("NOT_EXPORTED", ObjectKind.MODEL, model.name, text)


def _of_points(model: PlantModel) -> Iterator[tuple[str, int]]:
    points = model.points
    sizes = (BoundingBox(), UNLIMITED_SIZE)
    yield "parking positions", sum(point.type is PointType.PARK_POSITION for point in points)
    yield "largest vehicles at points", sum(point.max_vehicle_bounding_box not in sizes for point in points)
    yield "envelopes of points", sum(bool(point.envelopes) for point in points)
    yield "heights (z) of points", sum(point.z_mm != 0 for point in points)


def _of_paths(model: PlantModel) -> Iterator[tuple[str, int]]:
    paths = model.paths
    yield "locks of paths, which will be open", sum(path.locked for path in paths)
    yield "envelopes of paths", sum(bool(path.envelopes) for path in paths)
    yield "peripheral operations of paths", sum(len(path.peripheral_operations) for path in paths)
    yield "lengths that are not the distance of the ends", sum(_has_length(model, path) for path in paths)
    direct = ConnectionType.DIRECT
    drawn = (path for path in paths if not _trajectories(path) and path.layout.connection_type is not direct)
    yield "drawn courses of paths, which will be straight", sum(1 for _ in drawn)


def _has_length(model: PlantModel, path: Path) -> bool:
    a, b = model.point(path.source), model.point(path.destination)
    distance = hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm)
    return not _trajectories(path) and abs(max(distance, 1.0) - path.length_mm) > _SAME_LENGTH_MM


def _trajectories(path: Path) -> bool:
    return any(use.trajectory for use in path.vehicle_types)


def _of_the_rest(model: PlantModel) -> Iterator[tuple[str, int]]:
    locations = model.locations
    yield "locations without a link", sum(not location.links for location in locations)
    yield "locks of locations, which will be open", sum(location.locked for location in locations)
    operations = (each.allowed_peripheral_operations for each in model.location_types)
    yield "peripheral operations of location types", sum(map(len, operations))
    yield "blocks", len(model.blocks)
    yield "vehicles", len(model.vehicles)
    objects = (
        *(each.properties for each in model.points),
        *(each.properties for each in model.paths),
        *(each.properties for each in model.location_types),
        *(each.properties for each in locations),
        model.properties,
    )
    yield "properties", sum(not key.startswith(_KEPT) for each in objects for key in each)
