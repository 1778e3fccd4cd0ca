"""Makes locations and their types of stations: what can be done there follows from the nodes' actions."""

from collections.abc import Mapping, Sequence

from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.geometry import MM_PER_M
from nena_shared.plant.lif import properties
from nena_shared.plant.lif.document import Station, StationPosition
from nena_shared.plant.lif.names import Names
from nena_shared.plant.location import Link, Location, LocationLayout, LocationType
from nena_shared.plant.model import NO_OPERATION
from nena_shared.plant.operation_names import operation_of
from nena_shared.plant.point import Point


class StationMaker:
    """Makes the locations one by one; stations with the same operations share a location type."""

    def __init__(self, points: Mapping[str, Point], names: Names) -> None:
        self._points = points
        self._names = names
        self._types: dict[tuple[str, ...], LocationType] = {}

    @property
    def types(self) -> tuple[LocationType, ...]:
        """The location types of the locations made so far."""
        return tuple(self._types.values())

    def location(self, station: Station, layer_id: int) -> Location:
        """Return the location of a station."""
        points = [self._points[node] for node in dict.fromkeys(station.interaction_node_ids)]
        operations = tuple(sorted({each for point in points for each in _operations(point)}))
        x_mm, y_mm = _position_mm(station.station_position, points)
        return Location(
            name=self._names.take(ObjectKind.LOCATION, station.station_id, "station"),
            type=self._type(operations).name,
            x_mm=x_mm,
            y_mm=y_mm,
            # A link without operations would allow all of the type's.
            links=tuple(
                Link(point=point.name, allowed_operations=_operations(point) or (NO_OPERATION,))
                for point in points
            ),
            properties=_properties(station),
            layout=LocationLayout(layer_id=layer_id),
        )

    def _type(self, operations: tuple[str, ...]) -> LocationType:
        if operations not in self._types:
            wanted = ", ".join(("Station", *operations))
            name = self._names.take(ObjectKind.LOCATION_TYPE, wanted, "type")
            self._types[operations] = LocationType(name=name, allowed_operations=operations)
        return self._types[operations]


def _operations(point: Point) -> tuple[str, ...]:
    """Return what can be done at a point by at least one vehicle type."""
    actions = (action for use in point.vehicle_types for action in use.actions)
    return tuple(dict.fromkeys(operation_of(action.action_type) for action in actions))


def _position_mm(position: StationPosition | None, points: Sequence[Point]) -> tuple[int, int]:
    if position is not None:
        return round(position.x * MM_PER_M), round(position.y * MM_PER_M)
    if not points:
        return 0, 0
    return (
        round(sum(point.x_mm for point in points) / len(points)),
        round(sum(point.y_mm for point in points) / len(points)),
    )


def _properties(station: Station) -> dict[str, str]:
    position = station.station_position
    values = {
        properties.ID: station.station_id,
        properties.NAME: station.station_name,
        properties.DESCRIPTION: station.station_description,
        properties.STATION_HEIGHT: str(station.station_height) if station.station_height else None,
        properties.STATION_POSITION: position.model_dump_json(exclude_none=True) if position else None,
    }
    return {key: value for key, value in values.items() if value is not None}
