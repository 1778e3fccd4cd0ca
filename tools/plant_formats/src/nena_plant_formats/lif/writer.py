"""Write plant models as LIF 1.0.0 or 2.0.0."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from math import pi
from typing import Annotated, Any, Final

from pydantic import Field, TypeAdapter, ValidationError
from pydantic_core import to_json

from nena_plant_formats.exchange import ExportReport
from nena_plant_formats.lif import mobile_robots
from nena_plant_formats.lif.document import (
    FIELDS_OF_2_0,
    Layout,
    LifEdge,
    LifFile,
    LifNode,
    LifVersion,
    MetaInformation,
    Position,
    Station,
    StationPosition,
)
from nena_plant_formats.lif.losses import export_warnings
from nena_plant_formats.lif.reader import UNLIMITED_SPEED_MM_S
from nena_shared.plant import property_keys as keys
from nena_shared.plant.model import Location, PlantModel, action_of
from nena_shared.plant.track import (
    DirectedEdge,
    PlantBlockingType,
    Point,
    RequirementType,
    TypeAction,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
)

_CREATOR: Final = "NeNa"
_HEIGHT: Final = TypeAdapter(Annotated[float, Field(ge=0, allow_inf_nan=False)])
DEFAULT_VEHICLE_TYPE: Final = "vehicle"
"""Default vehicle type, with access to everything, if neither model nor caller names one."""

DEFAULT_MAP_ID: Final = "map"


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """Values that LIF requires but a plant model may lack."""

    at: datetime
    """Export time, timezone-aware."""
    map_id: str
    """MapId for points without one."""
    vehicle_types: tuple[str, ...]
    """Vehicle types that may use everything the model does not restrict; at least one."""


def write(
    model: PlantModel,
    version: LifVersion = LifVersion.V1_0,
    *,
    at: datetime,
    map_id: str | None = None,
    vehicle_types: Sequence[str] = (),
) -> ExportReport:
    """Write a plant model as LIF, with warnings about lost content.

    `at` is the export time (timezone-aware). `map_id` is used for points without a mapId; default: the map of
    all vehicles. `vehicle_types` may use everything the model does not restrict; default: the types of its
    vehicles.
    """
    maps = {vehicle.map_id for vehicle in model.vehicles if vehicle.map_id}
    types = {vehicle.vehicle_type for vehicle in model.vehicles if vehicle.vehicle_type}
    options = ExportOptions(
        at=at,
        map_id=map_id or (maps.pop() if len(maps) == 1 else DEFAULT_MAP_ID),
        vehicle_types=tuple(vehicle_types) or tuple(sorted(types)) or (DEFAULT_VEHICLE_TYPE,),
    )
    file = from_plant(model, options)
    if version is LifVersion.V2_0:
        origins = mobile_robots.from_layouts(file)
        # 0045: 2.0 has a default for most fields; what a file omitted is omitted again.
        content = origins.model_dump(mode="json", by_alias=True, exclude_none=True, exclude_unset=True)
    else:
        content = file.model_dump(mode="json", by_alias=True, exclude_none=True, exclude_defaults=True)
        content = _as_1_0(content)
    return ExportReport(to_json(content, indent=2) + b"\n", tuple(export_warnings(model, version)))


def _as_1_0(part: Any) -> Any:  # noqa: ANN401 - a value of JSON
    """Remove everything that LIF 1.0 does not have from a part of a file."""
    if isinstance(part, list):
        return [_as_1_0(each) for each in part]
    if not isinstance(part, dict):
        return part
    kept = {key: _as_1_0(value) for key, value in part.items() if key not in FIELDS_OF_2_0}
    # HARD excludes other actions like SINGLE does; it also stops the robot.
    if kept.get("blockingType") == PlantBlockingType.SINGLE:
        kept["blockingType"] = PlantBlockingType.HARD
    for use in kept.get("vehicleTypeNodeProperties", ()):
        # Not in FIELDS_OF_2_0, because edges of 1.0 have it.
        use.pop("loadRestriction", None)
    for use in kept.get("vehicleTypeEdgeProperties", ()):
        # Required in 1.0. False is the inverse of the default in 2.0.
        use.setdefault("rotationAllowed", False)
    return kept


def from_plant(model: PlantModel, options: ExportOptions) -> LifFile:
    """Convert a plant model to a file: with the layouts of its imported LIF file, else with one layout."""
    numbers = _layout_numbers(model)
    actions = _actions_by_point(model)
    nodes, edges, stations = defaultdict(list), defaultdict(list), defaultdict(list)
    home = {point.name: point.layout.layer_id for point in model.points}
    for point in model.points:
        nodes[_number_among(numbers, home[point.name])].append(
            _write_node(point, actions[point.name], options)
        )
    edge_ids = distinct_ids({edge.id: _kept_id(edge) for edge in model.edges()})
    for edge in model.edges():
        # LIF: an edge is in the layout of its start node.
        edges[_number_among(numbers, home[edge.source])].append(_write_edge(edge, edge_ids[edge.id], options))
    # LIF: a station has at least one interaction node.
    linked = tuple(location for location in model.locations if location.links)
    station_ids = distinct_ids({each.name: each.properties.get(keys.LIF_ID) for each in linked})
    for location in linked:
        station = _write_station(location, station_ids[location.name])
        stations[_number_among(numbers, location.layout.layer_id)].append(station)
    return LifFile(
        meta_information=MetaInformation(
            project_identification=model.name,
            creator=_CREATOR,
            export_timestamp=_timestamp_of(options.at),
            lif_version=LifVersion.V1_0,
        ),
        layouts=tuple(
            _write_layout(model, number, nodes[number], edges[number], stations[number]) for number in numbers
        ),
        manufacturers={
            key.removeprefix(keys.LIF_MANUFACTURER): value
            for key, value in model.properties.items()
            if key.startswith(keys.LIF_MANUFACTURER)
        },
    )


def _timestamp_of(at: datetime) -> str:
    # LIF 2.0's text wants milliseconds; 1.0 takes any ISO 8601 time.
    return at.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def distinct_ids(wanted: Mapping[str, str | None]) -> dict[str, str]:
    """Return a unique ID for each object, by name: the wanted ID if it is unique, else the name.

    Wanted IDs may be empty or duplicate, because copied objects keep their properties.
    """
    ids = {name: own or name for name, own in wanted.items()}
    # Each round uses up a wanted ID, and names are distinct.
    while duplicates := {each for each, times in Counter(ids.values()).items() if times > 1}:
        ids = {name: name if own in duplicates else own for name, own in ids.items()}
    return ids


def _layout_numbers(model: PlantModel) -> tuple[int, ...]:
    properties = model.visual_layout.properties
    layers = (layer.id for layer in model.visual_layout.layers)
    return tuple(number for number in layers if f"{keys.LIF_LAYOUT}.{number}.id" in properties) or (0,)


def _number_among(numbers: Sequence[int], number: int) -> int:
    return number if number in numbers else numbers[0]


def _write_layout(
    model: PlantModel, number: int, nodes: list[LifNode], edges: list[LifEdge], stations: list[Station]
) -> Layout:
    def kept(what: str) -> str | None:
        return model.visual_layout.properties.get(f"{keys.LIF_LAYOUT}.{number}.{what}")

    return Layout(
        origin_id=kept("originId"),
        origin_descriptor=kept("originDescriptor"),
        layout_id=kept("id") or model.name or _CREATOR,
        layout_name=kept("name"),
        # LIF suggests to count versions from 1.
        layout_version=kept("version") or "1",
        layout_level_id=kept("levelId"),
        layout_description=kept("description"),
        nodes=tuple(nodes),
        edges=tuple(edges),
        stations=tuple(stations),
    )


def _actions_by_point(model: PlantModel) -> defaultdict[str, tuple[TypeAction, ...]]:
    """Return the operations that locations allow at each point, as optional actions."""
    found: defaultdict[str, tuple[TypeAction, ...]] = defaultdict(tuple)
    for location in model.locations:
        for link in location.links:
            known = {action.action_type for action in found[link.point]}
            types = dict.fromkeys(map(action_of, model.link_operations(location, link)))
            found[link.point] += tuple(_write_action(each) for each in types if each not in known)
    return found


def _write_action(action_type: str) -> TypeAction:
    return TypeAction(
        action_type=action_type,
        blocking_type=PlantBlockingType.HARD,
        # The operation is executed only if an order asks for it.
        requirement_type=RequirementType.OPTIONAL,
    )


def _write_node(point: Point, actions: tuple[TypeAction, ...], options: ExportOptions) -> LifNode:
    made = (
        VehicleTypeAtPoint(vehicle_type_id=each, theta=point.heading_rad, actions=actions)
        for each in options.vehicle_types
    )
    return LifNode(
        node_id=point.name,
        node_name=point.properties.get(keys.LIF_NAME),
        node_description=point.properties.get(keys.LIF_DESCRIPTION),
        map_id=point.map_id or options.map_id,
        node_position=Position(x=point.x_m, y=point.y_m),
        vehicle_type_node_properties=point.vehicle_types or tuple(made),
    )


def _kept_id(edge: DirectedEdge) -> str | None:
    return edge.path.properties.get(keys.LIF_ID) if edge.is_forward else None


def _write_edge(edge: DirectedEdge, edge_id: str, options: ExportOptions) -> LifEdge:
    own = edge.path.properties
    return LifEdge(
        edge_id=edge_id,
        edge_name=own.get(keys.LIF_NAME),
        edge_description=own.get(keys.LIF_DESCRIPTION),
        start_node_id=edge.source,
        end_node_id=edge.destination,
        vehicle_type_edge_properties=tuple(_vehicle_type_rules(edge, options.vehicle_types)),
    )


def _vehicle_type_rules(edge: DirectedEdge, vehicle_types: Iterable[str]) -> Iterator[VehicleTypeOnPath]:
    """Yield the rule of each vehicle type; vehicles drive backward edges in reverse."""
    rules = edge.path.vehicle_types
    # LIF's rules apply to one direction: backwards, only the vehicle types remain.
    if rules and edge.is_forward:
        yield from rules
        return
    unlimited = edge.max_velocity_mm_s >= UNLIMITED_SPEED_MM_S
    for name in (use.vehicle_type_id for use in rules) if rules else vehicle_types:
        yield VehicleTypeOnPath(
            vehicle_type_id=name,
            rotation_allowed=False,
            # LIF: relative to the edge, because its orientationType is TANGENTIAL by default.
            vehicle_orientation=0.0 if edge.is_forward else pi,
            max_speed=None if unlimited else edge.max_velocity_m_s,
        )


def _write_station(location: Location, station_id: str) -> Station:
    properties = location.properties
    imported = keys.LIF_ID in properties
    return Station(
        station_id=station_id,
        interaction_node_ids=tuple(dict.fromkeys(link.point for link in location.links)),
        station_name=properties.get(keys.LIF_NAME, None if imported else location.name),
        station_type=properties.get(keys.LIF_STATION_TYPE),
        station_description=properties.get(keys.LIF_DESCRIPTION),
        station_height=_height_of(properties.get(keys.LIF_STATION_HEIGHT, "")),
        station_position=_station_position(location, imported=imported),
    )


def _height_of(text: str) -> float | None:
    """Return the height in a property, m; None if it is not a valid height."""
    try:
        return _HEIGHT.validate_python(text)
    except ValidationError:
        return None


def _station_position(location: Location, *, imported: bool) -> StationPosition | None:
    """Return the imported position of a station (may be None), else the position of the location."""
    try:
        return StationPosition.model_validate_json(location.properties.get(keys.LIF_STATION_POSITION, ""))
    except ValidationError:
        return None if imported else StationPosition(x=location.x_m, y=location.y_m)
