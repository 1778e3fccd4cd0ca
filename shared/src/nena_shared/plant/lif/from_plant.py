"""Makes a LIF file of a plant model."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from math import pi
from typing import Annotated, Final

from pydantic import Field, TypeAdapter, ValidationError

from nena_shared.plant.lif import properties
from nena_shared.plant.lif.document import (
    Edge,
    Layout,
    LifFile,
    MetaInformation,
    Node,
    Position,
    Station,
    StationPosition,
)
from nena_shared.plant.lif.ids import distinct_ids
from nena_shared.plant.lif.to_plant import UNLIMITED_SPEED_MM_S
from nena_shared.plant.location import Location
from nena_shared.plant.model import PlantModel
from nena_shared.plant.operation_names import action_of
from nena_shared.plant.path import DirectedEdge
from nena_shared.plant.point import Point
from nena_shared.plant.vehicle_type import (
    BlockingType,
    RequirementType,
    TypeAction,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
)

LIF_VERSION: Final = "1.0.0"
_CREATOR: Final = "NeNa"
_HEIGHT: Final = TypeAdapter(Annotated[float, Field(ge=0, allow_inf_nan=False)])


@dataclass(frozen=True, slots=True)
class Given:
    """What LIF demands and a plant model may not say."""

    at: datetime
    """Time of the export; aware of its zone."""
    map_id: str
    """Of points that name no map."""
    vehicle_types: tuple[str, ...]
    """To whom what the model does not keep from anybody is open; at least one."""


def from_plant(model: PlantModel, given: Given) -> LifFile:
    """Return the file: a layout for each one that LIF once gave to the model, else one for all of it."""
    numbers = _layout_numbers(model)
    actions = _actions(model)
    nodes, edges, stations = defaultdict(list), defaultdict(list), defaultdict(list)
    home = {point.name: point.layout.layer_id for point in model.points}
    for point in model.points:
        nodes[_among(numbers, home[point.name])].append(_node(point, actions[point.name], given))
    edge_ids = distinct_ids({edge.id: _kept_id(edge) for edge in model.edges()})
    for edge in model.edges():
        edges[_among(numbers, home[edge.source])].append(_edge(edge, edge_ids[edge.id], given))
    linked = tuple(location for location in model.locations if location.links)
    station_ids = distinct_ids({each.name: each.properties.get(properties.ID) for each in linked})
    for location in linked:
        station = _station(location, station_ids[location.name])
        stations[_among(numbers, location.layout.layer_id)].append(station)
    return LifFile(
        meta_information=MetaInformation(
            project_identification=model.name,
            creator=_CREATOR,
            export_timestamp=given.at.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
            lif_version=LIF_VERSION,
        ),
        layouts=tuple(
            _layout(model, number, nodes[number], edges[number], stations[number]) for number in numbers
        ),
    )


def _layout_numbers(model: PlantModel) -> tuple[int, ...]:
    given = model.visual_layout.properties
    layers = (layer.id for layer in model.visual_layout.layers)
    return tuple(number for number in layers if f"{properties.LAYOUT}.{number}.id" in given) or (0,)


def _among(numbers: Sequence[int], number: int) -> int:
    return number if number in numbers else numbers[0]


def _layout(
    model: PlantModel, number: int, nodes: list[Node], edges: list[Edge], stations: list[Station]
) -> Layout:
    def said(what: str) -> str | None:
        return model.visual_layout.properties.get(f"{properties.LAYOUT}.{number}.{what}")

    return Layout(
        layout_id=said("id") or model.name or _CREATOR,
        layout_name=said("name"),
        layout_version=said("version") or "1",
        layout_level_id=said("levelId"),
        layout_description=said("description"),
        nodes=tuple(nodes),
        edges=tuple(edges),
        stations=tuple(stations),
    )


def _actions(model: PlantModel) -> defaultdict[str, tuple[TypeAction, ...]]:
    """Return the actions that locations offer at each point; fleet control sends them as it likes."""
    found: defaultdict[str, tuple[TypeAction, ...]] = defaultdict(tuple)
    for location in model.locations:
        for link in location.links:
            known = {action.action_type for action in found[link.point]}
            types = dict.fromkeys(map(action_of, model.link_operations(location, link)))
            found[link.point] += tuple(_action(each) for each in types if each not in known)
    return found


def _action(action_type: str) -> TypeAction:
    return TypeAction(
        action_type=action_type,
        blocking_type=BlockingType.HARD,
        requirement_type=RequirementType.OPTIONAL,
    )


def _node(point: Point, actions: tuple[TypeAction, ...], given: Given) -> Node:
    made = (
        VehicleTypeAtPoint(vehicle_type_id=each, theta=point.heading_rad, actions=actions)
        for each in given.vehicle_types
    )
    return Node(
        node_id=point.name,
        node_name=point.properties.get(properties.NAME),
        node_description=point.properties.get(properties.DESCRIPTION),
        map_id=point.map_id or given.map_id,
        node_position=Position(x=point.x_m, y=point.y_m),
        vehicle_type_node_properties=point.vehicle_types or tuple(made),
    )


def _kept_id(edge: DirectedEdge) -> str | None:
    return edge.path.properties.get(properties.ID) if edge.is_forward else None


def _edge(edge: DirectedEdge, edge_id: str, given: Given) -> Edge:
    own = edge.path.properties
    return Edge(
        edge_id=edge_id,
        edge_name=own.get(properties.NAME),
        edge_description=own.get(properties.DESCRIPTION),
        start_node_id=edge.source,
        end_node_id=edge.destination,
        vehicle_type_edge_properties=tuple(_uses(edge, given.vehicle_types)),
    )


def _uses(edge: DirectedEdge, vehicle_types: Iterable[str]) -> Iterator[VehicleTypeOnPath]:
    """Yield who may drive here; who drives a path backward has its back first."""
    said = edge.path.vehicle_types
    if said and edge.is_forward:
        yield from said
        return
    unlimited = edge.max_velocity_mm_s >= UNLIMITED_SPEED_MM_S
    for name in (use.vehicle_type_id for use in said) if said else vehicle_types:
        yield VehicleTypeOnPath(
            vehicle_type_id=name,
            rotation_allowed=False,
            vehicle_orientation=0.0 if edge.is_forward else pi,
            max_speed=None if unlimited else edge.max_velocity_m_s,
        )


def _station(location: Location, station_id: str) -> Station:
    said = location.properties
    imported = properties.ID in said
    return Station(
        station_id=station_id,
        interaction_node_ids=tuple(dict.fromkeys(link.point for link in location.links)),
        station_name=said.get(properties.NAME, None if imported else location.name),
        station_description=said.get(properties.DESCRIPTION),
        station_height=_height(said.get(properties.STATION_HEIGHT, "")),
        station_position=_station_position(location, imported=imported),
    )


def _height(text: str) -> float:
    """Return what a property says, which anybody may have changed; 0 m where it is no height."""
    try:
        return _HEIGHT.validate_python(text)
    except ValidationError:
        return 0.0


def _station_position(location: Location, *, imported: bool) -> StationPosition | None:
    """Return where the station is drawn: as the file had it, which may be nowhere, else where it is."""
    try:
        return StationPosition.model_validate_json(location.properties.get(properties.STATION_POSITION, ""))
    except ValidationError:
        return None if imported else StationPosition(x=location.x_m, y=location.y_m)
