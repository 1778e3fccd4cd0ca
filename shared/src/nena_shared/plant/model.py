"""The plant model: everything that is drawn, routed on and dispatched to, in openTCS's vocabulary."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Self, TypeVar

from pydantic import Field

from nena_shared.plant.block import Block
from nena_shared.plant.errors import ObjectKind, UnknownObjectError
from nena_shared.plant.location import Link, Location, LocationType
from nena_shared.plant.path import DirectedEdge, Path
from nena_shared.plant.planar_index import Box, PlanarIndex
from nena_shared.plant.point import Point
from nena_shared.plant.record import PlantRecord
from nena_shared.plant.vehicle import Vehicle
from nena_shared.plant.visual_layout import VisualLayout

NO_OPERATION = "NOP"
"""The operation that is allowed at each link of each location."""

RECHARGE_OPERATION = "Charge"
"""The operation by which a vehicle charges at a location."""

T = TypeVar("T")


class PlantModel(PlantRecord):
    """An immutable plant model. Positions and lengths are whole millimetres, `..._m` properties give metres.

    Building one does not check references between objects: importers do, with `nena_shared.plant.checks`.
    """

    name: str
    points: tuple[Point, ...] = ()
    paths: tuple[Path, ...] = ()
    location_types: tuple[LocationType, ...] = ()
    locations: tuple[Location, ...] = ()
    blocks: tuple[Block, ...] = ()
    vehicles: tuple[Vehicle, ...] = ()
    visual_layout: VisualLayout = VisualLayout()
    properties: Mapping[str, str] = Field(default_factory=dict)

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """Read what `to_json` wrote. Raises pydantic's ValidationError for anything else."""
        return cls.model_validate_json(text)

    def to_json(self) -> str:
        """Return the whole model as JSON with camelCase names; `from_json` gives an equal model.

        Defaults are written out, so that readers in other languages need to know none; only None is left out.
        """
        return self.model_dump_json(by_alias=True, exclude_none=True)

    @cached_property
    def points_by_name(self) -> Mapping[str, Point]:
        """The points by their names."""
        return {point.name: point for point in self.points}

    @cached_property
    def points_by_map(self) -> Mapping[str | None, PlanarIndex[Point]]:
        """The points by the maps that they name, None for those that name none, to be found by place (m)."""
        maps: dict[str | None, list[Point]] = {}
        for point in self.points:
            maps.setdefault(point.map_id or None, []).append(point)
        return {
            map_id: PlanarIndex((Box(each.x_m, each.y_m, each.x_m, each.y_m), each) for each in points)
            for map_id, points in maps.items()
        }

    @cached_property
    def paths_by_name(self) -> Mapping[str, Path]:
        """The paths by their names."""
        return {path.name: path for path in self.paths}

    @cached_property
    def location_types_by_name(self) -> Mapping[str, LocationType]:
        """The location types by their names."""
        return {location_type.name: location_type for location_type in self.location_types}

    @cached_property
    def locations_by_name(self) -> Mapping[str, Location]:
        """The locations by their names."""
        return {location.name: location for location in self.locations}

    @cached_property
    def blocks_by_name(self) -> Mapping[str, Block]:
        """The blocks by their names."""
        return {block.name: block for block in self.blocks}

    @cached_property
    def vehicles_by_name(self) -> Mapping[str, Vehicle]:
        """The vehicles by their names."""
        return {vehicle.name: vehicle for vehicle in self.vehicles}

    @cached_property
    def edges_by_id(self) -> Mapping[str, DirectedEdge]:
        """The directed edges by their ids."""
        return {edge.id: edge for edge in self.edges()}

    @cached_property
    def vehicle_types(self) -> frozenset[str]:
        """The vehicle types that the plant tells apart; empty where it tells none."""
        at_points = (use.vehicle_type_id for point in self.points for use in point.vehicle_types)
        on_paths = (use.vehicle_type_id for path in self.paths for use in path.vehicle_types)
        return frozenset((*at_points, *on_paths))

    def point(self, name: str) -> Point:
        """Return the point of this name; raises UnknownObjectError."""
        return _known(self.points_by_name, ObjectKind.POINT, name)

    def path(self, name: str) -> Path:
        """Return the path of this name; raises UnknownObjectError."""
        return _known(self.paths_by_name, ObjectKind.PATH, name)

    def location(self, name: str) -> Location:
        """Return the location of this name; raises UnknownObjectError."""
        return _known(self.locations_by_name, ObjectKind.LOCATION, name)

    def location_type(self, name: str) -> LocationType:
        """Return the location type of this name; raises UnknownObjectError."""
        return _known(self.location_types_by_name, ObjectKind.LOCATION_TYPE, name)

    def vehicle(self, name: str) -> Vehicle:
        """Return the vehicle of this name; raises UnknownObjectError."""
        return _known(self.vehicles_by_name, ObjectKind.VEHICLE, name)

    def edges(self) -> Iterator[DirectedEdge]:
        """Yield every drivable direction of every path, also of locked ones, in the order of the paths."""
        for path in self.paths:
            yield from path.edges()

    def link_operations(self, location: Location, link: Link) -> tuple[str, ...]:
        """Return what a vehicle may do at this link: what the type allows and the link does not exclude."""
        allowed = self.location_type(location.type).allowed_operations
        if not link.allowed_operations:
            return allowed
        return tuple(operation for operation in allowed if operation in link.allowed_operations)

    def access_points(self, location_name: str, operation: str) -> tuple[str, ...]:
        """Return the points at which `operation` can be done for a location; raises UnknownObjectError.

        Every link allows NO_OPERATION. An empty result means that the operation is not possible there at all.
        """
        location = self.location(location_name)
        return tuple(
            link.point
            for link in location.links
            if operation == NO_OPERATION or operation in self.link_operations(location, link)
        )


def _known(objects: Mapping[str, T], kind: ObjectKind, name: str) -> T:
    try:
        return objects[name]
    except KeyError:
        raise UnknownObjectError(kind, name, objects) from None
