"""Content of plant models that a version of LIF cannot represent."""

from collections import Counter
from collections.abc import Iterator
from math import hypot
from typing import Final

from nena_plant_formats.lif.document import LifVersion
from nena_plant_formats.lif.reader import UNLIMITED_SIZE
from nena_shared.plant import property_keys as keys
from nena_shared.plant.errors import ObjectKind, PlantProblem
from nena_shared.plant.model import PlantModel
from nena_shared.plant.track import (
    MM_PER_M,
    BoundingBox,
    ConnectionType,
    Path,
    PlantBlockingType,
    RequirementType,
    RotationAllowed,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
)
from nena_shared.plant_terms import PointType

_Use = VehicleTypeAtPoint | VehicleTypeOnPath
# Positions and lengths are whole millimetres, each rounded on its own.
_SAME_LENGTH_MM: Final = 1.0
_KEPT: Final = ("lif:", keys.VDA5050_MAP_ID)


def export_warnings(model: PlantModel, version: LifVersion = LifVersion.V1_0) -> Iterator[PlantProblem]:
    """Yield a warning for each kind of content that this LIF version cannot represent."""
    of_version = in_1_0(model) if version is LifVersion.V1_0 else in_2_0(model)
    found = Counter[str]()
    for what, times in (*_of_points(model), *_of_paths(model), *_of_the_rest(model), *of_version):
        found[what] += times
    for what, times in found.items():
        if times:
            text = f"{what} ({times} times): not representable in LIF"
            yield PlantProblem("NOT_EXPORTED", ObjectKind.MODEL, model.name, text)


def in_1_0(model: PlantModel) -> Iterator[tuple[str, int]]:
    """Yield content that only LIF 2.0 supports, with its number of occurrences."""
    at_points = [use for point in model.points for use in point.vehicle_types]
    on_paths = [use for path in model.paths for use in path.vehicle_types]
    everywhere: list[_Use] = [*at_points, *on_paths]
    actions = [action for use in everywhere for action in use.actions]
    layers = model.visual_layout.properties
    origins = {value for key, value in layers.items() if key.endswith(".originId")}
    # LIF 1.0 has one global origin for all layouts.
    yield "origins beyond the first, whose layouts then use its frame", max(0, len(origins) - 1)
    yield "bounds of deviations at nodes", sum(use.allowed_deviation_xy is not None for use in at_points)
    yield "load restrictions of nodes", sum(use.load_restriction is not None for use in at_points)
    yield (
        "forbidden actions, which are omitted",
        sum(len(use.forbidden_action_types) for use in everywhere),
    )
    # 0045: parallel edges instead would need IDs that no robot knows.
    yield "orientations beyond the first", sum(len(use.other_orientations) for use in on_paths)
    yield "corridors", sum(use.corridor is not None for use in on_paths)
    yield "properties of line guidance", sum(use.line_guidance is not None for use in on_paths)
    yield (
        "blockingType SINGLE, written as HARD",
        sum(action.blocking_type is PlantBlockingType.SINGLE for action in actions),
    )
    yield (
        "action parameter values other than text, written as JSON",
        sum(parameter.is_json for action in actions for parameter in action.action_parameters),
    )
    yield (
        "types of stations",
        sum(keys.LIF_STATION_TYPE in location.properties for location in model.locations),
    )
    yield (
        # No height means 0 in LIF 1.0 and unknown in 2.0; only files of 2.0 have origins.
        "unknown heights of stations, written as 0",
        sum(
            any(key.endswith(".originId") for key in layers)
            and keys.LIF_STATION_HEIGHT not in location.properties
            for location in model.locations
            if location.links
        ),
    )


def in_2_0(model: PlantModel) -> Iterator[tuple[str, int]]:
    """Yield content that only LIF 1.0 supports, with its number of occurrences."""
    at_points = [use for point in model.points for use in point.vehicle_types]
    uses: list[_Use] = [*at_points, *(use for path in model.paths for use in path.vehicle_types)]
    # 2.0 has required and feasible actions only; CONDITIONAL is what feasible is read as.
    optional = sum(
        action.requirement_type is not RequirementType.CONDITIONAL
        and action.requirement_type is not RequirementType.REQUIRED
        for use in uses
        for action in use.actions
    )
    yield "actions that are OPTIONAL or without a requirementType, written as feasible actions", optional
    both = sum({keys.LIF_NAME, keys.LIF_DESCRIPTION} <= each.properties.keys() for each in model.points)
    # 2.0 has a single text for a node, its descriptor.
    yield "names of nodes, which are put in front of the descriptor", both
    known = {key.removeprefix(keys.LIF_MANUFACTURER) for key in model.properties}
    types = {use.vehicle_type_id for use in uses}
    yield (
        "manufacturers of vehicle types without a dot, written as empty",
        # 0045: an invented manufacturer would look right, but match no robot.
        sum("." not in each and each not in known for each in types),
    )


def _of_points(model: PlantModel) -> Iterator[tuple[str, int]]:
    points = model.points
    sizes = (BoundingBox(), UNLIMITED_SIZE)
    yield "parking positions", sum(point.type is PointType.PARK_POSITION for point in points)
    yield (
        "maximum vehicle sizes at points",
        sum(point.max_vehicle_bounding_box not in sizes for point in points),
    )
    yield "envelopes of points", sum(bool(point.envelopes) for point in points)
    yield "heights (z) of points", sum(point.z_mm != 0 for point in points)


def _of_paths(model: PlantModel) -> Iterator[tuple[str, int]]:
    paths = model.paths
    yield "path locks, which are dropped", sum(path.locked for path in paths)
    yield "envelopes of paths", sum(bool(path.envelopes) for path in paths)
    yield "peripheral operations of paths", sum(len(path.peripheral_operations) for path in paths)
    yield (
        "path lengths other than the distance between the end points",
        sum(_has_length(model, path) for path in paths),
    )
    # 0014: a drawn curve is decoration, and must not become a trajectory that robots follow.
    direct = ConnectionType.DIRECT
    drawn = (
        path for path in paths if not _has_trajectories(path) and path.layout.connection_type is not direct
    )
    yield "drawn shapes of paths, which become straight", sum(1 for _ in drawn)


def _has_length(model: PlantModel, path: Path) -> bool:
    a, b = model.point(path.source), model.point(path.destination)
    guided = next((use.line_guidance.length for use in path.vehicle_types if use.line_guidance), None)
    # The reader makes at least 1 mm of each edge, also between nodes at the same place.
    length_mm = max(guided * MM_PER_M if guided else hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm), 1.0)
    return not _has_trajectories(path) and abs(length_mm - path.length_mm) > _SAME_LENGTH_MM


def _has_trajectories(path: Path) -> bool:
    return any(use.trajectory for use in path.vehicle_types)


def _of_the_rest(model: PlantModel) -> Iterator[tuple[str, int]]:
    locations = model.locations
    yield "locations without a link", sum(not location.links for location in locations)
    yield "location locks, which are dropped", sum(location.locked for location in locations)
    operations = (each.allowed_peripheral_operations for each in model.location_types)
    yield "peripheral operations of location types", sum(map(len, operations))
    yield "blocks", len(model.blocks)
    yield "vehicles", len(model.vehicles)
    objects = (
        *(point.properties for point in model.points),
        *(path.properties for path in model.paths),
        *(each.properties for each in model.location_types),
        *(each.properties for each in locations),
        model.properties,
    )
    yield "properties", sum(not key.startswith(_KEPT) for each in objects for key in each)


def rules_of_types(model: PlantModel) -> Iterator[tuple[str, int]]:
    """Yield rules of vehicle types, except access, with their number of occurrences."""
    at_points = [use for point in model.points for use in point.vehicle_types]
    on_paths = [use for path in model.paths for use in path.vehicle_types]
    everywhere: list[_Use] = [*at_points, *on_paths]
    actions = [
        action.requirement_type is RequirementType.REQUIRED for use in everywhere for action in use.actions
    ]
    yield "required actions", sum(actions)
    yield "other actions and their parameters", len(actions) - sum(actions)
    yield "forbidden actions", sum(len(use.forbidden_action_types) for use in everywhere)
    yield "load restrictions", sum(use.load_restriction is not None for use in everywhere)
    yield "bounds of deviations at nodes", sum(use.allowed_deviation_xy is not None for use in at_points)
    yield "orientations on edges", sum(len(use.orientations) for use in on_paths)
    both = RotationAllowed.BOTH
    yield (
        "rules of rotation",
        sum(
            bool(use.rotation_allowed)
            or use.rotation_at_start_node_allowed is not both
            or use.rotation_at_end_node_allowed is not both
            for use in on_paths
        ),
    )
    yield "maximum speeds of rotation", sum(use.max_rotation_speed is not None for use in on_paths)
    yield "heights", sum(use.min_height is not None or use.max_height is not None for use in on_paths)
    yield "trajectories, which are only drawn", sum(use.trajectory is not None for use in on_paths)
    yield "corridors", sum(use.corridor is not None for use in on_paths)
    yield "properties of line guidance", sum(use.line_guidance is not None for use in on_paths)
    yield "edges without reentry", sum(not use.reentry_allowed for use in on_paths)
