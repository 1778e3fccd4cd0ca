"""What is wrong (errors) or suspicious (warnings) in a plant model, whatever file it came from."""

from collections import Counter
from collections.abc import Iterator

from nena_shared.plant.connectivity import cut_off_points
from nena_shared.plant.errors import ObjectKind, Problem
from nena_shared.plant.map_transforms import transform_errors
from nena_shared.plant.model import NO_OPERATION, PlantModel
from nena_shared.plant.path import BACKWARD_SUFFIX
from nena_shared.plant.point import PointType
from nena_shared.plant.property_checks import find_property_warnings

_NAMES_SHOWN = 10


def find_errors(model: PlantModel) -> tuple[Problem, ...]:
    """Return everything that makes the model unusable, such as references that lead nowhere."""
    return (
        *_name_errors(model),
        *_reference_errors(model),
        *_member_errors(model),
        *transform_errors(model),
    )


def find_warnings(model: PlantModel) -> tuple[Problem, ...]:
    """Return everything that an author probably did not intend."""
    return (
        *_name_warnings(model),
        *_track_warnings(model),
        *_location_warnings(model),
        *find_property_warnings(model),
    )


def _names(model: PlantModel) -> Iterator[tuple[ObjectKind, str]]:
    yield from ((ObjectKind.POINT, point.name) for point in model.points)
    yield from ((ObjectKind.PATH, path.name) for path in model.paths)
    yield from ((ObjectKind.LOCATION_TYPE, location_type.name) for location_type in model.location_types)
    yield from ((ObjectKind.LOCATION, location.name) for location in model.locations)
    yield from ((ObjectKind.BLOCK, block.name) for block in model.blocks)
    yield from ((ObjectKind.VEHICLE, vehicle.name) for vehicle in model.vehicles)


def _name_errors(model: PlantModel) -> Iterator[Problem]:
    times = Counter(name for _, name in _names(model))
    for kind, name in dict.fromkeys(_names(model)):
        if times[name] > 1:
            text = f"{times[name]} objects have this name; names are unique over all kinds of object"
            yield Problem("DUPLICATE_NAME", kind, name, text)
    for path in model.paths:
        if path.max_reverse_velocity_mm_s and path.name + BACKWARD_SUFFIX in times:
            text = f"another object has the id of its backward edge, {path.name + BACKWARD_SUFFIX!r}"
            yield Problem("DUPLICATE_NAME", ObjectKind.PATH, path.name, text)


def _reference_errors(model: PlantModel) -> Iterator[Problem]:
    for path in model.paths:
        for end in (path.source, path.destination):
            if end not in model.points_by_name:
                yield _dangling(ObjectKind.PATH, path.name, ObjectKind.POINT, end)
        for operation in path.peripheral_operations:
            if operation.location not in model.locations_by_name:
                yield _dangling(ObjectKind.PATH, path.name, ObjectKind.LOCATION, operation.location)
    for location in model.locations:
        if location.type not in model.location_types_by_name:
            yield _dangling(ObjectKind.LOCATION, location.name, ObjectKind.LOCATION_TYPE, location.type)
        for link in location.links:
            if link.point not in model.points_by_name:
                yield _dangling(ObjectKind.LOCATION, location.name, ObjectKind.POINT, link.point)


def _member_errors(model: PlantModel) -> Iterator[Problem]:
    resources = {*model.points_by_name, *model.paths_by_name, *model.locations_by_name}
    for block in model.blocks:
        for member in block.members:
            if member not in resources:
                text = f"its member {member!r} is neither a point nor a path nor a location"
                yield Problem("UNKNOWN_REFERENCE", ObjectKind.BLOCK, block.name, text)


def _dangling(kind: ObjectKind, name: str, wanted: ObjectKind, reference: str) -> Problem:
    return Problem(
        "UNKNOWN_REFERENCE", kind, name, f"it refers to {wanted} {reference!r}, which is not there"
    )


def _name_warnings(model: PlantModel) -> Iterator[Problem]:
    for kind, name in _names(model):
        if name != name.strip() or not name.isprintable():
            text = "the name has blanks at its ends or invisible characters; it is kept exactly so"
            yield Problem("SUSPICIOUS_NAME", kind, name, text)


def _track_warnings(model: PlantModel) -> Iterator[Problem]:
    used = {end for path in model.paths for end in (path.source, path.destination)}
    for point in model.points:
        if point.name not in used:
            yield Problem("POINT_WITHOUT_PATH", ObjectKind.POINT, point.name, "no path begins or ends here")
    for path in model.paths:
        if path.locked:
            yield Problem(
                "PATH_LOCKED", ObjectKind.PATH, path.name, "it is locked, so nobody is routed over it"
            )
        if not any(path.edges()):
            text = "both of its speeds are 0, so nobody can drive it"
            yield Problem("PATH_NOT_DRIVABLE", ObjectKind.PATH, path.name, text)
    if not any(point.type is PointType.PARK_POSITION for point in model.points):
        text = "there is no PARK_POSITION, so idle vehicles stay where they are"
        yield Problem("NO_PARK_POSITION", ObjectKind.MODEL, model.name, text)
    if cut_off := cut_off_points(model):
        names = ", ".join(map(repr, cut_off[:_NAMES_SHOWN])) + (" ..." if len(cut_off) > _NAMES_SHOWN else "")
        text = f"not every point can be reached from every other; cut off from the rest: {names}"
        yield Problem("NOT_STRONGLY_CONNECTED", ObjectKind.MODEL, model.name, text)


def _location_warnings(model: PlantModel) -> Iterator[Problem]:
    for location in model.locations:
        kind, name = ObjectKind.LOCATION, location.name
        if not location.links:
            text = "it has no link, so no vehicle can be sent there (a peripheral device needs none)"
            yield Problem("LOCATION_WITHOUT_LINK", kind, name, text)
        if location.locked:
            yield Problem("LOCATION_LOCKED", kind, name, "it is locked")
        allowed = model.location_type(location.type).allowed_operations
        for link in location.links:
            if unknown := set(link.allowed_operations) - {*allowed, NO_OPERATION}:
                text = f"its link to {link.point!r} allows {sorted(unknown)}, which its type does not"
                yield Problem("OPERATION_NOT_OF_TYPE", kind, name, text)
        if len({link.point for link in location.links}) < len(location.links):
            yield Problem("DUPLICATE_LINK", kind, name, "it has two links to one point")
