"""Read LIF 1.0.0 and 2.0.0 into a plant model: strictly, or leniently with warnings."""

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain, count
from math import degrees, hypot
from typing import Any, Final, TypeVar

from pydantic import ValidationError

from nena_plant_formats.exchange import (
    JSON_LIMITS,
    ImportReport,
    JsonLimits,
    parse_json,
    refusal,
)
from nena_plant_formats.lif import checks, mobile_robots
from nena_plant_formats.lif.checks import format_problems, reachability_warnings, repair
from nena_plant_formats.lif.document import (
    DRAFT_VERSION,
    Layout,
    LifEdge,
    LifFile,
    LifNode,
    LifVersion,
    Station,
    StationPosition,
    without_none,
)
from nena_shared.findings import letters_of
from nena_shared.plant import curve
from nena_shared.plant import property_keys as keys
from nena_shared.plant.checks import find_errors, find_warnings
from nena_shared.plant.errors import ObjectKind, PlantModelError, PlantProblem
from nena_shared.plant.model import (
    NO_OPERATION,
    Layer,
    LayerGroup,
    Link,
    Location,
    LocationLayout,
    LocationType,
    PlantModel,
    VisualLayout,
    operation_of,
)
from nena_shared.plant.track import (
    MM_PER_M,
    BoundingBox,
    ConnectionType,
    LabelLayout,
    LayoutPoint,
    Path,
    PathLayout,
    PathTrajectory,
    Point,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
)


def read(data: bytes, *, strict: bool = False, limits: JsonLimits = JSON_LIMITS) -> ImportReport:
    """Read a LIF file into a plant model, in mm, with LIF's rules for each vehicle type.

    Common deviations are repaired with a warning; with `strict` they are errors. Raises PlantModelError with
    all problems if the file is not LIF, has another version, exceeds a limit or is inconsistent.
    """
    raw = parse_json(data, limits)
    version = _version_of(raw)
    file, findings = _read_layouts(data, raw, version)
    if problems := tuple(checks.errors(file)):
        raise PlantModelError(problems)
    findings = (*findings, *checks.deviations(file, version))
    # Content without effect is valid LIF, so it is no finding in strict mode.
    if strict and findings:
        raise PlantModelError(findings)
    names = Names(node.node_id for layout in file.layouts for node in layout.nodes)
    model = to_plant(file, names)
    if problems := find_errors(model):
        raise PlantModelError(problems)
    others: chain[PlantProblem] = chain(
        names.renamed, checks.unsupported_features(file), reachability_warnings(model), find_warnings(model)
    )
    return ImportReport(model, (*findings, *others))


def _read_layouts(
    data: bytes,
    raw: Any,  # noqa: ANN401 - whatever the JSON holds
    version: LifVersion,
) -> tuple[LifFile, tuple[PlantProblem, ...]]:
    """Return the file and its deviations from the format of its version."""
    if version is LifVersion.V1_0:
        # The text is checked first, because repair() changes what was parsed.
        findings = (*_format_deviations(data, LifFile), *repair(raw, LifFile))
        return _validate_form(raw, LifFile), findings
    form = mobile_robots.OriginsFile
    findings = (*_format_deviations(data, form), *repair(raw, form))
    file = _validate_form(raw, form)
    return mobile_robots.to_layouts(file), (*findings, *checks.origin_findings(file))


def _version_of(raw: Any) -> LifVersion:  # noqa: ANN401 - whatever the JSON holds
    """Return the version of a file from lifVersion, or from its structure if that names none."""
    content = {letters_of(key): value for key, value in raw.items()} if isinstance(raw, dict) else {}
    meta = content.get("metainformation")
    fields = {letters_of(key): value for key, value in meta.items()} if isinstance(meta, dict) else {}
    stated = str(fields.get("lifversion") or "").strip()
    # 0045: minor versions only add fields, and each unknown field is a warning.
    major = re.match(r"[vV]?(\d+)", stated, re.ASCII)
    if major is None:
        return LifVersion.V2_0 if "origins" in content else LifVersion.V1_0
    if stated != DRAFT_VERSION and int(major[1]) not in {1, 2}:
        shown = repr(stated[: checks.SHOWN])
        text = f"lifVersion {shown} is not supported; save the file as {LifVersion.V1_0} or {LifVersion.V2_0}"
        raise refusal("UNSUPPORTED_VERSION", text)
    version = LifVersion.V2_0 if int(major[1]) == 2 else LifVersion.V1_0  # noqa: PLR2004 - the major version
    own, other = ("layouts", "origins") if version is LifVersion.V1_0 else ("origins", "layouts")
    if own not in content and other in content:
        text = f"{own}: is missing, but the file has {other!r}, as LIF of another version: correct lifVersion"
        raise refusal("NOT_LIF", f"{text}, which is {stated!r}")
    return version


F = TypeVar("F", LifFile, mobile_robots.OriginsFile)


def _validate_form(raw: Any, form: type[F]) -> F:  # noqa: ANN401 - whatever the JSON holds
    try:
        return form.model_validate(raw)
    except ValidationError as error:
        raise PlantModelError(format_problems(error)) from error


def _format_deviations(data: bytes, form: type[F]) -> tuple[PlantProblem, ...]:
    """Return the deviations of types and fields from the schema."""
    try:
        form.model_validate_json(data, strict=True)
    except ValidationError as error:
        return format_problems(error)
    return ()


class Names:
    """Allocate names that are unique over all kinds of objects; `renamed` reports changed ones."""

    def __init__(self, taken: Iterable[str]) -> None:
        self._taken = set(taken)
        self.renamed: list[PlantProblem] = []

    def allocate(self, kind: ObjectKind, wanted: str, prefix: str) -> str:
        """Return and reserve the wanted name if it is free, else one with the prefix."""
        name = wanted
        # openTCS: a name is unique over all kinds of object. In LIF, an ID is so within its kind.
        if name in self._taken:
            tries = (f"{prefix}{'' if number == 1 else number}:{wanted}" for number in count(1))
            name = next(each for each in tries if each not in self._taken)
            text = f"another object has this id; it is renamed to {name!r}"
            self.renamed.append(PlantProblem("RENAMED", kind, wanted, text))
        self._taken.add(name)
        return name


class StationMaker:
    """Create locations of stations; stations with the same operations share a location type."""

    def __init__(self, points: Mapping[str, Point], names: Names) -> None:
        self._points = points
        self._names = names
        self._types: dict[tuple[str, ...], LocationType] = {}

    @property
    def types(self) -> tuple[LocationType, ...]:
        """Location types of the locations created so far."""
        return tuple(self._types.values())

    def location(self, station: Station, layer_id: int) -> Location:
        """Return the location of a station."""
        points = [self._points[node] for node in dict.fromkeys(station.interaction_node_ids)]
        # LIF: what a station is for follows from the actions at its nodes.
        operations = tuple(sorted({each for point in points for each in _operations_at(point)}))
        x_mm, y_mm = _position_mm(station.station_position, points)
        return Location(
            name=self._names.allocate(ObjectKind.LOCATION, station.station_id, "station"),
            type=self._location_type(operations).name,
            x_mm=x_mm,
            y_mm=y_mm,
            # A link without operations would allow all of the type's.
            links=tuple(
                Link(point=point.name, allowed_operations=_operations_at(point) or (NO_OPERATION,))
                for point in points
            ),
            properties=_station_properties(station),
            layout=LocationLayout(layer_id=layer_id),
        )

    def _location_type(self, operations: tuple[str, ...]) -> LocationType:
        if operations not in self._types:
            wanted = ", ".join(("Station", *operations))
            name = self._names.allocate(ObjectKind.LOCATION_TYPE, wanted, "type")
            self._types[operations] = LocationType(name=name, allowed_operations=operations)
        return self._types[operations]


def _operations_at(point: Point) -> tuple[str, ...]:
    """Return the operations that at least one vehicle type can perform at a point."""
    actions = (
        action.action_type
        for use in point.vehicle_types
        for action in use.actions
        if action.action_type not in use.forbidden_action_types
    )
    return tuple(dict.fromkeys(map(operation_of, actions)))


def _position_mm(position: StationPosition | None, points: Sequence[Point]) -> tuple[int, int]:
    if position is not None:
        return round(position.x * MM_PER_M), round(position.y * MM_PER_M)
    if not points:
        return 0, 0
    return (
        round(sum(point.x_mm for point in points) / len(points)),
        round(sum(point.y_mm for point in points) / len(points)),
    )


def _station_properties(station: Station) -> dict[str, str]:
    position = station.station_position
    height = station.station_height
    values = {
        keys.LIF_ID: station.station_id,
        keys.LIF_NAME: station.station_name,
        keys.LIF_STATION_TYPE: station.station_type,
        keys.LIF_DESCRIPTION: station.station_description,
        keys.LIF_STATION_HEIGHT: None if height is None else str(height),
        keys.LIF_STATION_POSITION: position.model_dump_json(exclude_none=True) if position else None,
    }
    return {key: value for key, value in values.items() if value is not None}


UNLIMITED_SPEED_MM_S: Final = 100_000
"""Maximum speed of a path that is unlimited for at least one vehicle type."""

UNLIMITED_SIZE: Final = BoundingBox(length_mm=1_000_000, width_mm=1_000_000, height_mm=1_000_000)
"""Maximum vehicle size at points: LIF has no limit."""

Use = TypeVar("Use", VehicleTypeAtPoint, VehicleTypeOnPath)

_PIECES: Final = 16
"""Number of line segments that draw a curve other than a cubic Bezier curve."""


def to_plant(file: LifFile, names: Names) -> PlantModel:
    """Convert a file to a plant model. Node IDs become point names, because robots use them."""
    meta = file.meta_information
    points = {
        node.node_id: _read_point(node, layer)
        for layer, layout in enumerate(file.layouts)
        for node in layout.nodes
    }
    paths = [
        _read_path(edge, layer, points, names)
        for layer, layout in enumerate(file.layouts)
        for edge in layout.edges
    ]
    maker = StationMaker(points, names)
    locations = [
        maker.location(station, layer)
        for layer, layout in enumerate(file.layouts)
        for station in layout.stations
    ]
    return PlantModel(
        name=meta.project_identification,
        points=tuple(points.values()),
        paths=tuple(paths),
        location_types=maker.types,
        locations=tuple(locations),
        visual_layout=_visual_layout(file.layouts),
        properties={
            **({keys.LIF_CREATOR: meta.creator} if meta.creator else {}),
            **({keys.LIF_EXPORT_TIMESTAMP: meta.export_timestamp} if meta.export_timestamp else {}),
            **{f"{keys.LIF_MANUFACTURER}{name}": maker for name, maker in file.manufacturers.items()},
        },
    )


def _read_point(node: LifNode, layer: int) -> Point:
    types = _first_of_each(node.vehicle_type_node_properties)
    headings = {use.theta for use in types}
    # The heading of a point applies to all vehicles; others stay in the rule of their type.
    theta = headings.pop() if len(headings) == 1 else None
    return Point(
        name=node.node_id,
        x_mm=round(node.node_position.x * MM_PER_M),
        y_mm=round(node.node_position.y * MM_PER_M),
        orientation_deg=None if theta is None else degrees(theta),
        max_vehicle_bounding_box=UNLIMITED_SIZE,
        properties=without_none(
            {
                keys.VDA5050_MAP_ID: node.map_id,
                keys.LIF_NAME: node.node_name,
                keys.LIF_DESCRIPTION: node.node_description,
            }
        ),
        layout=LabelLayout(layer_id=layer),
        vehicle_types=types,
    )


def _read_path(edge: LifEdge, layer: int, points: dict[str, Point], names: Names) -> Path:
    types = tuple(map(_with_usable_trajectory, _first_of_each(edge.vehicle_type_edge_properties)))
    trajectory = next((use.trajectory for use in types if use.trajectory), None)
    a, b = points[edge.start_node_id], points[edge.end_node_id]
    guided = next((use.line_guidance.length for use in types if use.line_guidance), None)
    # 0014: robots follow a LIF trajectory, so it determines the length.
    length_m = curve.length(trajectory) if trajectory else guided or hypot(a.x_m - b.x_m, a.y_m - b.y_m)
    name = names.allocate(ObjectKind.PATH, edge.edge_id, "edge")
    return Path(
        name=name,
        source=edge.start_node_id,
        destination=edge.end_node_id,
        # openTCS: at least 1 mm. Levels of a rack are nodes at the same place.
        length_mm=max(1, round(length_m * MM_PER_M)),
        max_velocity_mm_s=_speed_mm_s(types),
        properties=without_none(
            {
                keys.LIF_ID: edge.edge_id if name != edge.edge_id else None,
                keys.LIF_NAME: edge.edge_name,
                keys.LIF_DESCRIPTION: edge.edge_description,
            }
        ),
        layout=_path_layout(trajectory, layer),
        vehicle_types=types,
    )


def _first_of_each(uses: Sequence[Use]) -> tuple[Use, ...]:
    """Return the first rule for each vehicle type."""
    found: dict[str, Use] = {}
    for use in uses:
        found.setdefault(use.vehicle_type_id, use)
    return tuple(found.values())


def _with_usable_trajectory(use: VehicleTypeOnPath) -> VehicleTypeOnPath:
    """Drop an invalid trajectory, and scale one with knots outside 0 to 1."""
    if use.trajectory is None:
        return use
    usable = None if curve.fault(use.trajectory) else curve.scaled(use.trajectory)
    return use.model_copy(update={"trajectory": usable})


def _speed_mm_s(uses: Sequence[VehicleTypeOnPath]) -> int:
    """Return the highest speed of any vehicle type; the router uses that of each type."""
    speeds = [UNLIMITED_SPEED_MM_S if use.max_speed is None else use.max_speed * MM_PER_M for use in uses]
    return round(max(speeds))


def _path_layout(trajectory: PathTrajectory | None, layer: int) -> PathLayout:
    if trajectory is None:
        return PathLayout(layer_id=layer)
    # openTCS's BEZIER is exactly one cubic curve with two control points.
    if curve.is_cubic_bezier(trajectory):
        kind, places = ConnectionType.BEZIER, [(point.x, point.y) for point in trajectory.control_points]
    else:
        kind, places = ConnectionType.POLYPATH, list(curve.places(trajectory, _PIECES))
    return PathLayout(
        connection_type=kind,
        control_points=tuple(LayoutPoint(x_mm=x * MM_PER_M, y_mm=y * MM_PER_M) for x, y in places[1:-1]),
        layer_id=layer,
    )


def _visual_layout(layouts: Sequence[Layout]) -> VisualLayout:
    """Return a layer for each layout; properties keep the other LIF fields."""
    return VisualLayout(
        layers=tuple(
            Layer(id=number, ordinal=number, name=layout.layout_name or layout.layout_id)
            for number, layout in enumerate(layouts)
        ),
        layer_groups=(LayerGroup(id=0, name="Layouts"),),
        properties=without_none(
            {
                f"{keys.LIF_LAYOUT}.{number}.{key}": value
                for number, layout in enumerate(layouts)
                for key, value in (
                    ("id", layout.layout_id),
                    ("name", layout.layout_name),
                    ("version", layout.layout_version),
                    ("levelId", layout.layout_level_id),
                    ("description", layout.layout_description),
                    ("originId", layout.origin_id),
                    ("originDescriptor", layout.origin_descriptor),
                )
            }
        ),
    )
