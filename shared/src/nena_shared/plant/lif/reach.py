"""Where vehicles of each type get to, and where not."""

from collections.abc import Iterator

from nena_shared.plant.connectivity import cut_off_points
from nena_shared.plant.errors import ObjectKind, Problem
from nena_shared.plant.model import PlantModel

_NAMES_SHOWN = 10


def reach_warnings(model: PlantModel) -> Iterator[Problem]:
    """Yield the points that a vehicle type may use and cannot reach, where there are several types.

    With one type this is the warning that every plant gets.
    """
    types = sorted({use.vehicle_type_id for point in model.points for use in point.vehicle_types})
    for name in types if len(types) > 1 else ():
        if cut_off := cut_off_points(_part_of(model, name)):
            names = ", ".join(map(repr, cut_off[:_NAMES_SHOWN]))
            more = " ..." if len(cut_off) > _NAMES_SHOWN else ""
            text = f"vehicles of type {name!r} cannot get everywhere and back; cut off: {names}{more}"
            yield Problem("NOT_STRONGLY_CONNECTED", ObjectKind.MODEL, model.name, text)


def _part_of(model: PlantModel, vehicle_type: str) -> PlantModel:
    """Return the points and paths that are open to a vehicle type, whatever its load."""
    points = tuple(point for point in model.points if point.is_open_to(vehicle_type))
    names = {point.name for point in points}
    paths = tuple(
        path
        for path in model.paths
        if path.is_open_to(vehicle_type) and path.source in names and path.destination in names
    )
    return PlantModel(name=model.name, points=points, paths=paths)
