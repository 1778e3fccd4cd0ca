"""What a LIF file says that its own rules do not allow, beyond the form of its fields."""

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from math import hypot, pi, radians
from typing import Any, Final

from pydantic import ValidationError

from nena_shared.misfits import path_of, words_of
from nena_shared.plant.checks import cut_off_points
from nena_shared.plant.errors import ObjectKind, Problem
from nena_shared.plant.lif import curve
from nena_shared.plant.lif.document import (
    Edge,
    Layout,
    LifFile,
    MetaInformation,
    Node,
    Station,
    StationPosition,
)
from nena_shared.plant.model import PlantModel
from nena_shared.plant.track import (
    ActionParameter,
    LoadRestriction,
    PlantRecord,
    RequirementType,
    RotationAllowed,
    Trajectory,
    TrajectoryPoint,
    TypeAction,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
)

_RECORDS: Final[tuple[type[PlantRecord], ...]] = (
    LifFile,
    MetaInformation,
    Layout,
    Node,
    Edge,
    Station,
    StationPosition,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
    TypeAction,
    ActionParameter,
    LoadRestriction,
    Trajectory,
    TrajectoryPoint,
)
_KNOWN: Final = frozenset(field.alias for record in _RECORDS for field in record.model_fields.values())
_HEADINGS: Final = ("theta", "vehicleOrientation")


def faults(error: ValidationError) -> tuple[Problem, ...]:
    """Return what does not keep to the format; thousands of equal faults make one problem."""
    found: dict[tuple[str, str], list[str]] = {}
    for detail in error.errors(include_url=False, include_context=False, include_input=False):
        field = ".".join("*" if isinstance(part, int) else part for part in detail["loc"])
        found.setdefault((field, words_of(detail)), []).append(path_of(detail["loc"]))
    return tuple(
        warning("NOT_LIF", f"{field}: {message} (found {len(places)} times, first at {places[0]})")
        for (field, message), places in found.items()
    )


def put_right(raw: Any) -> tuple[Problem, ...]:  # noqa: ANN401 - whatever the JSON holds
    """Put known faults of the content right in place, and return those that validation would not show.

    Missing stations count as none; `required` of an action becomes its requirementType; where any heading is
    beyond 2 pi, all are taken for degrees.
    """
    objects = tuple(_objects(raw))
    found = Counter(_put_each_right(objects))
    headings = [(each, key, heading) for each in objects for key, heading in _headings(each)]
    if any(abs(heading) > 2 * pi for _, _, heading in headings):
        found["HEADINGS_IN_DEGREES", "headings beyond 2 pi: all of the file are read as degrees"] = 1
        for each, key, heading in headings:
            each[key] = radians(heading)
    return tuple(
        warning(code, f"{text} (found {times} times)") for (code, text), times in sorted(found.items())
    )


def _put_each_right(objects: Iterable[dict[str, Any]]) -> Iterator[tuple[str, str]]:
    """Put right what is not of this format, and yield the code and text of each fault."""
    for each in objects:
        if "nodes" in each and "edges" in each:
            each.setdefault("stations", [])
        if isinstance(required := each.get("required"), bool):
            del each["required"]
            each.setdefault("requirementType", "REQUIRED" if required else "OPTIONAL")
            yield "NOT_LIF", "'required' of actions is read as their requirementType"
        for key in each.keys() - _KNOWN:
            yield "IGNORED", f"field {key!r} is not known"


def warning(code: str, text: str) -> Problem:
    """Return a problem of the file as a whole."""
    return Problem(code, ObjectKind.MODEL, "", text)


def _objects(raw: Any) -> Iterator[dict[str, Any]]:  # noqa: ANN401 - whatever the JSON holds
    waiting = [raw]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            yield value
            waiting.extend(value.values())
        elif isinstance(value, list):
            waiting.extend(value)


def _headings(each: dict[str, Any]) -> Iterator[tuple[str, float]]:
    """Yield the headings of an object, also those written as texts, and leave what is no number as it is."""
    for key in _HEADINGS:
        with suppress(KeyError, OverflowError, TypeError, ValueError):
            yield key, float(each[key])


_SAME_PLACE_M: Final = 0.01
_HEADING_MARGIN: Final = 1e-6
_DRAFT_VERSION: Final = "0.11.0"
"""Of the guideline's own examples; the content is that of 1.0.0."""


def errors(file: LifFile) -> Iterator[Problem]:
    """Yield what makes the file unusable even for a lenient reader."""
    version = file.meta_information.lif_version
    if version != _DRAFT_VERSION and not version.startswith("1."):
        yield warning(
            "UNSUPPORTED_VERSION", f"lifVersion {version!r} cannot be read; write the file as 1.0.0"
        )
    nodes = [node for layout in file.layouts for node in layout.nodes]
    edges = [edge for layout in file.layouts for edge in layout.edges]
    stations = [station for layout in file.layouts for station in layout.stations]
    yield from _twice(ObjectKind.POINT, (node.node_id for node in nodes))
    yield from _twice(ObjectKind.PATH, (edge.edge_id for edge in edges))
    yield from _twice(ObjectKind.LOCATION, (station.station_id for station in stations))
    known = {node.node_id for node in nodes}
    yield from _leading_nowhere(known, edges, stations)
    yield from _for_nobody(nodes, edges)


def departures(file: LifFile) -> Iterator[Problem]:
    """Yield what a strict reader refuses and a lenient one can live with."""
    if file.meta_information.lif_version == _DRAFT_VERSION:
        yield warning("NOT_LIF", f"lifVersion {_DRAFT_VERSION} was never published; leniently it is 1.0.0")
    nodes = {node.node_id: node for layout in file.layouts for node in layout.nodes}
    for layout in file.layouts:
        yield from _of_nodes(layout)
        own_nodes = {node.node_id for node in layout.nodes}
        for edge in layout.edges:
            yield from _of_edge(edge, own_nodes, nodes)
        for station in layout.stations:
            if not station.interaction_node_ids:
                text = "the station has no interaction node"
                yield Problem("NOT_LIF", ObjectKind.LOCATION, station.station_id, text)


def remarks(file: LifFile) -> Iterator[Problem]:
    """Yield what is right and is kept, but not acted on by itself; one warning for each kind of thing."""
    nodes = [
        use for layout in file.layouts for node in layout.nodes for use in node.vehicle_type_node_properties
    ]
    edges = [
        use for layout in file.layouts for edge in layout.edges for use in edge.vehicle_type_edge_properties
    ]
    found = Counter(_unheeded_at_node(nodes))
    found.update(_unheeded_on_edge(edges))
    for what, times in sorted(found.items()):
        yield warning("NOT_HEEDED", f"{what} (found {times} times): kept, and not acted on")


def _unheeded_at_node(uses: list[VehicleTypeAtPoint]) -> Iterator[str]:
    for use in uses:
        required = sum(action.requirement_type is RequirementType.REQUIRED for action in use.actions)
        if required:
            yield "REQUIRED actions at nodes"
        if required > 1:
            yield "several REQUIRED actions at one node"


def _unheeded_on_edge(uses: list[VehicleTypeOnPath]) -> Iterator[str]:
    both = RotationAllowed.BOTH
    for use in uses:
        unheeded = {
            "actions on edges": bool(use.actions),
            "maxRotationSpeed": use.max_rotation_speed is not None,
            "minHeight": use.min_height is not None,
            "names of load sets": bool(use.load_restriction and use.load_restriction.load_set_names),
            "reentryAllowed false": not use.reentry_allowed,
            "rotationAtStartNodeAllowed": use.rotation_at_start_node_allowed is not both,
            "rotationAtEndNodeAllowed": use.rotation_at_end_node_allowed is not both,
        }
        yield from (what for what, there in unheeded.items() if there)


def _twice(kind: ObjectKind, ids: Iterable[str]) -> Iterator[Problem]:
    for name, times in Counter(ids).items():
        if times > 1:
            yield Problem("DUPLICATE_NAME", kind, name, f"{times} of them have this id")


def _leading_nowhere(known: set[str], edges: list[Edge], stations: list[Station]) -> Iterator[Problem]:
    for edge in edges:
        for end in (edge.start_node_id, edge.end_node_id):
            if end not in known:
                yield _dangling(ObjectKind.PATH, edge.edge_id, end)
    for station in stations:
        for node in station.interaction_node_ids:
            if node not in known:
                yield _dangling(ObjectKind.LOCATION, station.station_id, node)


def _dangling(kind: ObjectKind, name: str, node: str) -> Problem:
    return Problem("UNKNOWN_REFERENCE", kind, name, f"it refers to node {node!r}, which is not there")


def _for_nobody(nodes: list[Node], edges: list[Edge]) -> Iterator[Problem]:
    text = "it says for no vehicle type that it may be used; give each at least one"
    for node in nodes:
        if not node.vehicle_type_node_properties:
            yield Problem("NO_VEHICLE_TYPE", ObjectKind.POINT, node.node_id, text)
    for edge in edges:
        if not edge.vehicle_type_edge_properties:
            yield Problem("NO_VEHICLE_TYPE", ObjectKind.PATH, edge.edge_id, text)


def _of_nodes(layout: Layout) -> Iterator[Problem]:
    for node in layout.nodes:
        uses = node.vehicle_type_node_properties
        texts = [
            *_repeated(use.vehicle_type_id for use in uses),
            *(text for use in uses for text in _heading(use.theta)),
            *(text for use in uses for text in _actions(use.actions)),
            *([] if node.map_id else ["the node names no map"]),
        ]
        yield from (Problem("NOT_LIF", ObjectKind.POINT, node.node_id, text) for text in texts)


def _of_edge(edge: Edge, own_nodes: set[str], nodes: dict[str, Node]) -> Iterator[Problem]:
    uses = edge.vehicle_type_edge_properties
    ends = (nodes[edge.start_node_id], nodes[edge.end_node_id])
    texts = [
        *_repeated(use.vehicle_type_id for use in uses),
        *_closed_ends(edge, ends),
        *(text for use in uses for text in _heading(use.vehicle_orientation)),
        *(text for use in uses for text in _actions(use.actions)),
        *(text for use in uses for text in _load(use.load_restriction)),
        *(text for use in uses if use.trajectory for text in _trajectory(use.trajectory, ends)),
    ]
    if edge.start_node_id not in own_nodes:
        texts.append(f"its start node {edge.start_node_id!r} is in another layout")
    yield from (Problem("NOT_LIF", ObjectKind.PATH, edge.edge_id, text) for text in texts)


def _repeated(types: Iterable[str]) -> Iterator[str]:
    for name, times in Counter(types).items():
        if times > 1:
            yield f"vehicle type {name!r} is there {times} times; the first counts"


def _closed_ends(edge: Edge, ends: tuple[Node, Node]) -> Iterator[str]:
    for node in ends:
        open_to = {use.vehicle_type_id for use in node.vehicle_type_node_properties}
        for use in edge.vehicle_type_edge_properties:
            if use.vehicle_type_id not in open_to:
                yield f"vehicle type {use.vehicle_type_id!r} may not be at its node {node.node_id!r}"


def _heading(heading: float | None) -> Iterator[str]:
    if heading is not None and abs(heading) > pi + _HEADING_MARGIN:
        yield f"heading {heading} is not between -pi and pi"


def _actions(actions: tuple[TypeAction, ...]) -> Iterator[str]:
    for action in actions:
        if action.requirement_type is None:
            yield f"action {action.action_type!r} has no requirementType"


def _load(restriction: LoadRestriction | None) -> Iterator[str]:
    if restriction and restriction.load_set_names and not restriction.loaded:
        yield "it names load sets and forbids loads"


def _trajectory(trajectory: Trajectory, ends: tuple[Node, Node]) -> Iterator[str]:
    if fault := curve.fault(trajectory):
        yield f"its trajectory {fault}; it is left out"
        return
    if trajectory.knot_vector[0] < 0 or trajectory.knot_vector[-1] > 1:
        yield "its trajectory has knots outside of 0 to 1; they are scaled"
    for point, node in zip((trajectory.control_points[0], trajectory.control_points[-1]), ends, strict=True):
        if hypot(point.x - node.node_position.x, point.y - node.node_position.y) > _SAME_PLACE_M:
            yield f"its trajectory does not end at node {node.node_id!r}; the node's position counts"


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
