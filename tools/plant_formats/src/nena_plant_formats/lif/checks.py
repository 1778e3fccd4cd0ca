"""Check LIF files: format deviations and their repair, rules beyond the schema, reachability."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from enum import StrEnum
from functools import cache
from math import hypot, pi, radians
from typing import Any, Final

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from nena_plant_formats.exchange import parts_of, records_in, with_received
from nena_plant_formats.lif import mobile_robots
from nena_plant_formats.lif.document import (
    DRAFT_VERSION,
    FIELDS_OF_2_0,
    Layout,
    LifEdge,
    LifFile,
    LifNode,
    LifVersion,
    Station,
)
from nena_shared.findings import letters_of, path_of, words_of
from nena_shared.plant import curve
from nena_shared.plant.checks import disconnected_points
from nena_shared.plant.errors import ObjectKind, PlantProblem
from nena_shared.plant.model import PlantModel
from nena_shared.plant.track import (
    DeviationBounds,
    LoadRestriction,
    PathTrajectory,
    PlantBlockingType,
    PlantRecord,
    RequirementType,
    RotationAllowed,
    TypeAction,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
)

SHOWN: Final = 40
"""Maximum length of a quoted version, characters."""
_HEADINGS: Final = ("theta", "vehicleOrientation", "mobileRobotOrientations")


def format_problems(error: ValidationError) -> tuple[PlantProblem, ...]:
    """Return deviations from the format; equal ones are combined into one problem."""
    found: dict[tuple[str, str], list[str]] = {}
    for detail in error.errors(include_url=False, include_context=False):
        # Without indices, so that a deviation of a thousand nodes is one warning (0014).
        field = ".".join("*" if isinstance(part, int) else part for part in detail["loc"])
        found.setdefault((field, words_of(detail)), []).append(with_received(path_of(detail["loc"]), detail))
    return tuple(
        warning("NOT_LIF", f"{field}: {message} (found {len(places)} times, first at {places[0]})")
        for (field, message), places in found.items()
    )


def repair(raw: Any, form: type[PlantRecord]) -> tuple[PlantProblem, ...]:  # noqa: ANN401 - whatever the JSON holds
    """Repair what has one certain meaning in place, and return what validation would not report.

    Spells fields and enumerations as LIF does, adds missing stations and texts that nothing depends on,
    removes null, and converts all headings from degrees if one is beyond 2 pi.
    """
    found = Counter[tuple[str, str]]()
    headings: list[tuple[Any, Any, float]] = []
    for each, record in records_in(raw, form):
        fields = _fields_of(record, form)
        found.update(_repair_names(each, fields))
        found.update(_repair_values(each, fields))
        headings += _headings_of(each)
    # A published sample has degrees. All are converted, because 3 degrees would pass as radians.
    if any(abs(heading) > 2 * pi for _, _, heading in headings):
        found["HEADINGS_IN_DEGREES", "headings beyond 2 pi: all headings in the file are read as degrees"] = 1
        for place, key, heading in headings:
            place[key] = radians(heading)
    return tuple(
        warning(code, f"{text} (found {times} times)") for (code, text), times in sorted(found.items())
    )


_Fields = Mapping[str, tuple[FieldInfo, tuple[Any, ...]]]
"""Fields of a record with the parts of their annotations, by name in the file."""


@cache
def _fields_of(record: type[BaseModel], form: type[PlantRecord]) -> _Fields:
    return {
        field.alias or "": (field, parts_of(field.annotation))
        for field in record.model_fields.values()
        # Both versions share the records (0045): left in, a field of 2.0 would count in a file of 1.0.
        if form is not LifFile or field.alias not in FIELDS_OF_2_0
    }


def _repair_names(each: dict[str, Any], fields: _Fields) -> Iterator[tuple[str, str]]:
    """Rename fields that are spelled or placed otherwise, remove unknown ones; yield each deviation."""
    # So in 8.4 of LIF's guideline, while its examples have requirementType.
    if "requirementType" in fields and isinstance(required := each.get("required"), bool):
        del each["required"]
        each.setdefault("requirementType", "REQUIRED" if required else "OPTIONAL")
        yield "NOT_LIF", "'required' of actions is read as their requirementType"
    # As in VDA 5050.
    place = each.get("nodePosition") if "mapId" in fields and not each.get("mapId") else None
    if isinstance(place, dict) and (map_id := place.pop("mapId", None)):
        each["mapId"] = map_id
        yield "NOT_LIF", "mapId in nodePosition is read as that of the node"
    by_letters = {letters_of(name): name for name in fields}
    for key in each.keys() - fields.keys():
        value, name = each.pop(key), by_letters.get(letters_of(key))
        if name is None or name in each:
            yield "IGNORED", f"unknown field {key!r}"
        else:
            each[name] = value
            yield "NOT_LIF", f"field {key!r} is read as {name!r}"


_IF_MISSING: Final[Mapping[str, Callable[[], Any]]] = {
    # 11 of the 19 examples in LIF's guideline have no stations, which its schema requires.
    "stations": list,
    "metaInformation": dict,
    # The blocking type that never allows more than the author wanted.
    "blockingType": lambda: "HARD",
    # Texts that nothing depends on.
    **dict.fromkeys(
        ("creator", "exportTimestamp", "layoutVersion", "lifId", "lifVersion", "projectIdentification"), str
    ),
}
"""Makes the value of a required field that is missing."""


def _repair_values(each: dict[str, Any], fields: _Fields) -> Iterator[tuple[str, str]]:
    """Repair missing, null and misspelled values; yield what validation would accept."""
    for key, (field, parts) in fields.items():
        value = each.get(key)
        if value is None and key in _IF_MISSING:
            each[key] = _IF_MISSING[key]()
        elif key not in each or not (value is None or isinstance(value, str)):
            continue
        elif not field.is_required() and (value is None or (value == "" and str not in parts)):
            del each[key]
            if value is None and field.default is None:
                yield "NOT_LIF", f"{key!r} is null; read as missing"
        elif value:
            enumerations = [part for part in parts if isinstance(part, type) and issubclass(part, StrEnum)]
            words = {letters_of(word): word.value for enumeration in enumerations for word in enumeration}
            each[key] = words.get(letters_of(value), value)


def warning(code: str, text: str) -> PlantProblem:
    """Return a problem of the whole file."""
    return PlantProblem(code, ObjectKind.MODEL, "", text)


def _headings_of(each: dict[str, Any]) -> Iterator[tuple[Any, Any, float]]:
    """Yield the headings of an object with their places, including numbers written as text."""
    for key in _HEADINGS:
        value: Any = each.get(key)
        spots: list[tuple[Any, Any]] = [(each, key)]
        if isinstance(value, list):
            spots = [(value, number) for number in range(len(value))]
        for place, spot in spots:
            with suppress(KeyError, OverflowError, TypeError, ValueError):
                yield place, spot, float(place[spot])


SAME_PLACE_M: Final = 0.01
"""Maximum distance between a trajectory's end and its node, m."""
_HEADING_MARGIN: Final = 8e-6
"""Largest accepted angle, rad: LIF 2.0 allows 3.1416."""


def errors(file: LifFile) -> Iterator[PlantProblem]:
    """Yield errors that make the file unusable even for a lenient reader."""
    nodes = [node for layout in file.layouts for node in layout.nodes]
    edges = [edge for layout in file.layouts for edge in layout.edges]
    stations = [station for layout in file.layouts for station in layout.stations]
    # 0014: never repaired, as each of these could send a robot to a wrong place.
    # Per kind: LIF lets a station have the ID of its node, and real files do.
    yield from _check_duplicates(ObjectKind.POINT, (node.node_id for node in nodes))
    yield from _check_duplicates(ObjectKind.PATH, (edge.edge_id for edge in edges))
    yield from _check_duplicates(ObjectKind.LOCATION, (station.station_id for station in stations))
    # Of the whole file: LIF lets edges and stations lead to nodes of other layouts.
    known = {node.node_id for node in nodes}
    yield from _dangling_references(known, edges, stations)
    yield from _without_vehicle_type(nodes, edges)
    for node in nodes:
        yield from _check_contradictions(ObjectKind.POINT, node.node_id, node.vehicle_type_node_properties)
    for edge in edges:
        yield from _check_contradictions(ObjectKind.PATH, edge.edge_id, edge.vehicle_type_edge_properties)


def _check_contradictions(
    kind: ObjectKind, name: str, uses: Iterable[VehicleTypeAtPoint | VehicleTypeOnPath]
) -> Iterator[PlantProblem]:
    """Yield actions that are both required and forbidden."""
    for use in uses:
        for action in use.actions:
            required = action.requirement_type is RequirementType.REQUIRED
            # LIF 2.0 makes this an error. A feasible one is only left out of the operations.
            if required and action.action_type in use.forbidden_action_types:
                text = f"action {action.action_type!r} is both required and forbidden"
                yield PlantProblem("NOT_LIF", kind, name, text)


def deviations(file: LifFile, version: LifVersion = LifVersion.V1_0) -> Iterator[PlantProblem]:
    """Yield deviations that a strict reader rejects and a lenient one accepts."""
    stated = file.meta_information.lif_version
    if stated == DRAFT_VERSION:
        yield warning("NOT_LIF", f"lifVersion {DRAFT_VERSION} was never published; read as 1.0.0")
    elif not _VERSION.fullmatch(stated):
        text = f"lifVersion {stated[:SHOWN]!r} does not state major.minor.patch; read as {version}"
        yield warning("NOT_LIF", text)
    nodes = {node.node_id: node for layout in file.layouts for node in layout.nodes}
    for layout in file.layouts:
        yield from _of_nodes(layout)
        own_nodes = {node.node_id for node in layout.nodes}
        for edge in layout.edges:
            yield from _of_edge(edge, own_nodes, nodes)
        yield from _missing_in_1_0(layout) if version is LifVersion.V1_0 else ()
        for station in layout.stations:
            # LIF's text demands at least one, but its schema accepts an empty array.
            if not station.interaction_node_ids:
                text = "the station has no interaction node"
                yield PlantProblem("NOT_LIF", ObjectKind.LOCATION, station.station_id, text)


_VERSION: Final = re.compile(r"\d+\.\d+\.\d+", re.ASCII)


def _missing_in_1_0(layout: Layout) -> Iterator[PlantProblem]:
    """Yield what only 2.0 allows: SINGLE, and an edge without the inverse of its rotationAllowed."""
    for edge in layout.edges:
        if any(use.rotation_allowed is None for use in edge.vehicle_type_edge_properties):
            text = "rotationAllowed is missing; read as false"
            yield PlantProblem("NOT_LIF", ObjectKind.PATH, edge.edge_id, text)
    elements: list[tuple[ObjectKind, str, Iterable[VehicleTypeAtPoint | VehicleTypeOnPath]]] = [
        *((ObjectKind.POINT, node.node_id, node.vehicle_type_node_properties) for node in layout.nodes),
        *((ObjectKind.PATH, edge.edge_id, edge.vehicle_type_edge_properties) for edge in layout.edges),
    ]
    for kind, name, uses in elements:
        if any(each.blocking_type is PlantBlockingType.SINGLE for use in uses for each in use.actions):
            yield PlantProblem("NOT_LIF", kind, name, "LIF 1.0 has no blockingType SINGLE")


def unsupported_features(file: LifFile) -> Iterator[PlantProblem]:
    """Yield one warning for each kind of valid content that is kept but has no effect."""
    nodes = [
        use for layout in file.layouts for node in layout.nodes for use in node.vehicle_type_node_properties
    ]
    edges = [
        use for layout in file.layouts for edge in layout.edges for use in edge.vehicle_type_edge_properties
    ]
    found = Counter(_unsupported_at_node(nodes))
    found.update(_unsupported_on_edge(edges))
    # LIF 2.0 does not define where origins lie relative to each other (0045).
    found["several origins, whose frames are treated as one"] = max(
        0, len({layout.origin_id for layout in file.layouts}) - 1
    )
    for what, times in sorted((+found).items()):
        yield warning("NOT_HEEDED", f"{what} (found {times} times): kept, without effect")


def _unsupported_at_node(uses: list[VehicleTypeAtPoint]) -> Iterator[str]:
    for use in uses:
        yield from _of_load(use.load_restriction)


def _of_load(restriction: LoadRestriction | None) -> Iterator[str]:
    if restriction and not (restriction.loaded and restriction.unloaded):
        yield "loadRestriction"
    if restriction and restriction.load_set_names:
        yield "names of load sets"


def origin_findings(file: mobile_robots.OriginsFile) -> Iterator[PlantProblem]:
    """Yield deviations of origins and types, which are lost when a 2.0 file is converted."""
    stated = file.meta_information.lif_version
    if re.match(r"[vV]?2\.0*[1-9]", stated):
        text = f"lifVersion {stated[:SHOWN]} is newer than 2.0.0; what it adds is ignored"
        yield warning("NOT_LIF", text)
    for name, times in Counter(origin.origin_id for origin in file.origins).items():
        if times > 1:
            yield warning("NOT_LIF", f"{times} origins have the id {name!r}; they are read as one")
    series = {(each.manufacturer, each.series_name) for each in mobile_robots.robot_types(file)}
    ids = Counter(
        mobile_robots.type_id(mobile_robots.MobileRobotType(manufacturer=maker, series_name=name))
        for maker, name in series
    )
    # In the form of LIF 1.0, the series `b.c` of `a` and `c` of `a.b` have the same ID.
    for name, times in ids.items():
        if times > 1:
            yield warning("NOT_LIF", f"{times} types of mobile robots are called {name!r}; read as one")


def _unsupported_on_edge(uses: list[VehicleTypeOnPath]) -> Iterator[str]:
    both, required = RotationAllowed.BOTH, RequirementType.REQUIRED
    for use in uses:
        unsupported = {
            "feasible actions on edges": any(
                action.requirement_type is not required for action in use.actions
            ),
            "reentryAllowed false": not use.reentry_allowed,
            "rotationAtStartNodeAllowed": use.rotation_at_start_node_allowed is not both,
            "rotationAtEndNodeAllowed": use.rotation_at_end_node_allowed is not both,
        }
        yield from (what for what, there in unsupported.items() if there)
        yield from _of_load(use.load_restriction)


def _check_duplicates(kind: ObjectKind, ids: Iterable[str]) -> Iterator[PlantProblem]:
    for name, times in Counter(ids).items():
        if times > 1:
            yield PlantProblem("DUPLICATE_NAME", kind, name, f"{times} objects have this id")


def _dangling_references(
    known: set[str], edges: list[LifEdge], stations: list[Station]
) -> Iterator[PlantProblem]:
    for edge in edges:
        for end in (edge.start_node_id, edge.end_node_id):
            if end not in known:
                yield _dangling_reference(ObjectKind.PATH, edge.edge_id, end)
    for station in stations:
        for node in station.interaction_node_ids:
            if node not in known:
                yield _dangling_reference(ObjectKind.LOCATION, station.station_id, node)


def _dangling_reference(kind: ObjectKind, name: str, node: str) -> PlantProblem:
    return PlantProblem("UNKNOWN_REFERENCE", kind, name, f"refers to unknown node {node!r}")


def _without_vehicle_type(nodes: list[LifNode], edges: list[LifEdge]) -> Iterator[PlantProblem]:
    # LIF: an element without an entry for a vehicle type is closed to it.
    text = "no vehicle type may use it; add at least one"
    for node in nodes:
        if not node.vehicle_type_node_properties:
            yield PlantProblem("NO_VEHICLE_TYPE", ObjectKind.POINT, node.node_id, text)
    for edge in edges:
        if not edge.vehicle_type_edge_properties:
            yield PlantProblem("NO_VEHICLE_TYPE", ObjectKind.PATH, edge.edge_id, text)


def _of_nodes(layout: Layout) -> Iterator[PlantProblem]:
    for node in layout.nodes:
        uses = node.vehicle_type_node_properties
        texts = [
            *_check_repeated_types(use.vehicle_type_id for use in uses),
            *(text for use in uses for text in _check_heading(use.theta)),
            *(text for use in uses for text in _check_bounds(use.allowed_deviation_xy)),
            *(text for use in uses for text in _check_load(use.load_restriction)),
            *(text for use in uses for text in _check_actions(use.actions)),
            *([] if node.map_id else ["the node has no mapId"]),
        ]
        yield from (PlantProblem("NOT_LIF", ObjectKind.POINT, node.node_id, text) for text in texts)


def _of_edge(edge: LifEdge, own_nodes: set[str], nodes: dict[str, LifNode]) -> Iterator[PlantProblem]:
    uses = edge.vehicle_type_edge_properties
    ends = (nodes[edge.start_node_id], nodes[edge.end_node_id])
    texts = [
        *_check_repeated_types(use.vehicle_type_id for use in uses),
        *_closed_ends(edge, ends),
        *(text for use in uses for each in use.orientations for text in _check_heading(each)),
        *(text for use in uses for text in _check_actions(use.actions)),
        *(text for use in uses for text in _check_load(use.load_restriction)),
        *(text for use in uses if use.trajectory for text in _check_trajectory(use.trajectory, ends)),
    ]
    # LIF 2.0 allows one of the two, not both.
    if any(use.trajectory and use.line_guidance for use in uses):
        texts.append("it has a trajectory and a physicalLineGuidedProperty; the trajectory's length is used")
    # LIF: only the end of an edge may be in another layout.
    if edge.start_node_id not in own_nodes:
        texts.append(f"start node {edge.start_node_id!r} is in another layout")
    yield from (PlantProblem("NOT_LIF", ObjectKind.PATH, edge.edge_id, text) for text in texts)


def _check_repeated_types(types: Iterable[str]) -> Iterator[str]:
    for name, times in Counter(types).items():
        if times > 1:
            yield f"vehicle type {name!r} occurs {times} times; the first one is used"


def _closed_ends(edge: LifEdge, ends: tuple[LifNode, LifNode]) -> Iterator[str]:
    for node in ends:
        open_to = {use.vehicle_type_id for use in node.vehicle_type_node_properties}
        for use in edge.vehicle_type_edge_properties:
            if use.vehicle_type_id not in open_to:
                yield f"vehicle type {use.vehicle_type_id!r} is not allowed on its node {node.node_id!r}"


def _check_heading(heading: float | None) -> Iterator[str]:
    if heading is not None and abs(heading) > pi + _HEADING_MARGIN:
        yield f"heading {heading} is not between -pi and pi"


_ELLIPSE_MARGIN: Final = 1e-6


def _check_bounds(bounds: DeviationBounds | None) -> Iterator[str]:
    """Yield bounds that no ellipse satisfies, or that are out of range."""
    if bounds is None:
        return
    for axis, least, most in (
        ("a", bounds.a_minimum, bounds.a_maximum),
        ("b", bounds.b_minimum, bounds.b_maximum),
        # An ellipse has b <= a, so a must reach the minimum of b as well.
        ("the shorter semi-axis", bounds.b_minimum, bounds.a_maximum),
    ):
        if least is not None and most is not None and least > most:
            yield f"allowedDeviationXY allows no ellipse: {axis} is at least {least} and at most {most}"
    if bounds.theta is not None and abs(bounds.theta) > pi / 2 + _ELLIPSE_MARGIN:
        yield f"allowedDeviationXY has the rotation {bounds.theta}, which is not between -pi/2 and pi/2"


def _check_actions(actions: tuple[TypeAction, ...]) -> Iterator[str]:
    for action in actions:
        if action.requirement_type is None:
            yield f"action {action.action_type!r} has no requirementType"


def _check_load(restriction: LoadRestriction | None) -> Iterator[str]:
    if restriction and restriction.load_set_names and not restriction.loaded:
        yield "it lists load sets, but forbids loads"


def _check_trajectory(trajectory: PathTrajectory, ends: tuple[LifNode, LifNode]) -> Iterator[str]:
    if fault := curve.fault(trajectory):
        yield f"the trajectory {fault}; it is ignored"
        return
    # As in a published sample; LIF has knots from 0 to 1.
    if trajectory.knot_vector[0] < 0 or trajectory.knot_vector[-1] > 1:
        yield "the trajectory has knots outside 0 to 1; they are scaled"
    for point, node in zip((trajectory.control_points[0], trajectory.control_points[-1]), ends, strict=True):
        # The trajectory of the guideline's own example does not end at its nodes.
        if hypot(point.x - node.node_position.x, point.y - node.node_position.y) > SAME_PLACE_M:
            yield f"the trajectory does not end at node {node.node_id!r}; the node's position is used"


_NAMES_SHOWN = 10


def reachability_warnings(model: PlantModel) -> Iterator[PlantProblem]:
    """Yield a warning for points that a vehicle type may use but cannot reach, if there are several types.

    For a single type, the general reachability warning covers this.
    """
    types = sorted({use.vehicle_type_id for point in model.points for use in point.vehicle_types})
    for name in types if len(types) > 1 else ():
        if cut_off := disconnected_points(_part_of(model, name)):
            names = ", ".join(map(repr, cut_off[:_NAMES_SHOWN]))
            more = " ..." if len(cut_off) > _NAMES_SHOWN else ""
            text = f"vehicles of type {name!r} cannot reach every point and return: {names}{more}"
            yield PlantProblem("NOT_STRONGLY_CONNECTED", ObjectKind.MODEL, model.name, text)


def _part_of(model: PlantModel, vehicle_type: str) -> PlantModel:
    """Return the part of a model that a vehicle type may use, with any load."""
    points = tuple(point for point in model.points if point.is_open_to(vehicle_type))
    names = {point.name for point in points}
    paths = tuple(
        path
        for path in model.paths
        if path.is_open_to(vehicle_type) and path.source in names and path.destination in names
    )
    return PlantModel(name=model.name, points=points, paths=paths)
