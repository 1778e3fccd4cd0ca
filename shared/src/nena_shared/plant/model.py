"""The plant model in openTCS's terms: locations, blocks, vehicles, drawing, and the whole model."""

from collections.abc import Iterator, Mapping
from enum import StrEnum
from functools import cached_property
from math import radians
from types import MappingProxyType
from typing import Final, Self, TypeVar

from pydantic import Field, model_validator

from nena_shared.plant import driver_properties as driver
from nena_shared.plant import property_keys as keys
from nena_shared.plant.errors import ObjectKind, UnknownObjectError
from nena_shared.plant.geometry import Box, MapTransform, PlanarIndex, parse_transform
from nena_shared.plant.track import (
    FAR_MM,
    MM_PER_M,
    BoundingBox,
    DirectedEdge,
    LabelLayout,
    Millimetres,
    Path,
    PlantRecord,
    PlantVertex,
    Point,
    deviation_of,
)


class LocationType(PlantRecord):
    """A location type: allowed operations of vehicles and peripheral devices."""

    name: str = Field(min_length=1)
    allowed_operations: tuple[str, ...] = ()
    allowed_peripheral_operations: tuple[str, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
    representation: str | None = None


class Link(PlantRecord):
    """A link to a point that serves a location; without operations, it allows all of the location type's."""

    point: str
    allowed_operations: tuple[str, ...] = ()


class LocationLayout(LabelLayout):
    """Drawing of a location; `position` is set only if it is drawn away from its model position."""

    representation: str | None = None
    position: PlantVertex | None = None


class Location(PlantRecord):
    """A location; `type` names its location type. A peripheral's location may have no link."""

    name: str = Field(min_length=1)
    type: str
    x_mm: Millimetres = 0
    y_mm: Millimetres = 0
    z_mm: Millimetres = 0
    locked: bool = False
    links: tuple[Link, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
    layout: LocationLayout = LocationLayout()

    @property
    def x_m(self) -> float:
        """X coordinate in the plant frame, metres."""
        return self.x_mm / MM_PER_M

    @property
    def y_m(self) -> float:
        """Y coordinate in the plant frame, metres."""
        return self.y_mm / MM_PER_M


class BlockType(StrEnum):
    """Rule of a block."""

    SINGLE_VEHICLE_ONLY = "SINGLE_VEHICLE_ONLY"
    SAME_DIRECTION_ONLY = "SAME_DIRECTION_ONLY"


class Block(PlantRecord):
    """A block; its members are names of points, paths and locations."""

    name: str = Field(min_length=1)
    type: BlockType = BlockType.SINGLE_VEHICLE_ONLY
    members: tuple[str, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
    color: str | None = None


class EnergyThresholds(PlantRecord):
    """Charge levels in percent; critical <= good, sufficiently <= fully recharged."""

    # openTCS's own defaults for objects without these values; files of its old formats lack them
    critical: int = Field(default=30, ge=0, le=100)
    good: int = Field(default=90, ge=0, le=100)
    sufficiently_recharged: int = Field(default=30, ge=0, le=100)
    fully_recharged: int = Field(default=90, ge=0, le=100)

    @model_validator(mode="after")
    def _not_crossed(self) -> Self:
        if self.critical > self.good or self.sufficiently_recharged > self.fully_recharged:
            raise ValueError(
                "crossed energy thresholds: critical <= good and sufficiently <= fully recharged must hold"
            )
        return self


class Vehicle(PlantRecord):
    """A vehicle; properties hold its VDA 5050 parameters."""

    name: str = Field(min_length=1)
    bounding_box: BoundingBox = BoundingBox()
    energy_thresholds: EnergyThresholds = EnergyThresholds()
    max_velocity_mm_s: int = Field(default=1000, ge=0, le=FAR_MM)
    max_reverse_velocity_mm_s: int = Field(default=1000, ge=0, le=FAR_MM)
    envelope_key: str | None = None
    properties: Mapping[str, str] = Field(default_factory=dict)
    color: str | None = None

    @property
    def max_velocity_m_s(self) -> float:
        """Maximum forward speed, m/s."""
        return self.max_velocity_mm_s / MM_PER_M

    @property
    def routing_group(self) -> str:
        """Routing group (property `tcs:routingGroup`); empty: the default group."""
        return self.properties.get(keys.ROUTING_GROUP, "")

    @property
    def manufacturer(self) -> str | None:
        """Manufacturer in the robot's VDA 5050 topics, if set."""
        return self.properties.get(keys.VDA5050_MANUFACTURER)

    @property
    def serial_number(self) -> str | None:
        """Serial number in the robot's VDA 5050 topics, if set."""
        return self.properties.get(keys.VDA5050_SERIAL_NUMBER)

    @property
    def interface_name(self) -> str | None:
        """InterfaceName of the robot's VDA 5050 topics, if set."""
        return self.properties.get(keys.VDA5050_INTERFACE_NAME)

    @property
    def topic_prefix(self) -> str | None:
        """What the robot's topics begin with instead of its interface name, version and robot, if set."""
        return self.properties.get(driver.TOPIC_PREFIX)

    @property
    def omitted_fields(self) -> tuple[str, ...]:
        """Fields that orders for the robot must not have, by their names in VDA 5050 2.x."""
        prefix = driver.OPTIONAL_PARAMETERS
        fields = (
            key.removeprefix(prefix)
            for key, value in self.properties.items()
            if key.startswith(prefix) and value == driver.NOT_SUPPORTED
        )
        return tuple(field for field in fields if field in driver.OPTIONAL_FIELDS)

    def length_mm(self, *, loaded: bool) -> int:
        """Length with or without a load, mm."""
        key = driver.LENGTH_LOADED if loaded else driver.LENGTH_UNLOADED
        return driver.read_count(self.properties.get(key, "")) or self.bounding_box.length_mm

    @property
    def base_limits(self) -> tuple[int | None, int | None]:
        """Steps that the robot takes in its base, and mm after which it takes no further one; None: any."""
        texts = (self.properties.get(key, "") for key in (driver.MAX_STEPS_BASE, driver.MAX_DISTANCE_BASE))
        steps, length_mm = map(driver.read_count, texts)
        return steps, length_mm

    @property
    def protocol_version(self) -> str | None:
        """VDA 5050 version of the robot, if set."""
        return self.properties.get(keys.VDA5050_VERSION)

    @property
    def parameters_as_text(self) -> bool:
        """Whether the robot reads action parameters as text only."""
        return self._is_set(keys.VDA5050_PARAMETERS_AS_TEXT)

    @property
    def instant_actions_key(self) -> str | None:
        """Key of the instant actions array in messages to the robot, if it is not the standard one."""
        return self.properties.get(keys.VDA5050_INSTANT_ACTIONS_KEY)

    @property
    def keeps_last_node_states(self) -> bool:
        """Whether the robot keeps nodeStates at the order's last node."""
        return self._is_set(keys.VDA5050_KEEPS_LAST_NODE_STATES)

    @property
    def map_id(self) -> str | None:
        """MapId of the robot's map, if set."""
        return self.properties.get(keys.VDA5050_MAP_ID)

    @property
    def vehicle_type(self) -> str | None:
        """LIF vehicle type of the robot, if set."""
        return self.properties.get(keys.VEHICLE_TYPE)

    @property
    def allowed_maps(self) -> frozenset[str] | None:
        """Maps on which the robot may drive; None: all."""
        if not (value := self.properties.get(keys.ALLOWED_MAPS)):
            return None
        return frozenset(name.strip() for name in value.split(","))

    @property
    def acceptable_order_types(self) -> tuple[str, ...] | None:
        """Accepted order types in order of preference; None: any."""
        if not (value := self.properties.get(keys.ACCEPTABLE_ORDER_TYPES)):
            return None
        return tuple(name for part in value.split(",") if (name := part.strip()))

    @property
    def deviation_xy_m(self) -> float | None:
        """Allowed deviation from node positions, metres; None if unset or invalid."""
        return deviation_of(self.properties, keys.VDA5050_DEVIATION_XY)

    @property
    def deviation_theta_rad(self) -> float | None:
        """Allowed deviation from node headings, radians (property: degrees); None if unset or invalid."""
        degrees = deviation_of(self.properties, keys.VDA5050_DEVIATION_THETA)
        return None if degrees is None else radians(degrees)

    @property
    def corridor_width_m(self) -> float | None:
        """Maximum corridor width, metres to each side; None if unset or invalid."""
        return deviation_of(self.properties, keys.VDA5050_CORRIDOR_WIDTH)

    def _is_set(self, key: str) -> bool:
        return self.properties.get(key, "").strip().lower() == "true"


class Layer(PlantRecord):
    """A layer of the drawing; higher ordinals are drawn above lower ones."""

    id: int
    ordinal: int
    name: str
    visible: bool = True
    group_id: int = 0


class LayerGroup(PlantRecord):
    """A group of layers that is shown or hidden as a whole."""

    id: int
    name: str
    visible: bool = True


class VisualLayout(PlantRecord):
    """Drawing of a plant; scales are mm per pixel of the model editor."""

    name: str = "VLayout"
    scale_x_mm_per_px: float = Field(default=50.0, gt=0)
    scale_y_mm_per_px: float = Field(default=50.0, gt=0)
    layers: tuple[Layer, ...] = ()
    layer_groups: tuple[LayerGroup, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)


NO_OPERATION = "NOP"
"""Operation that every link of every location allows."""

RECHARGE_OPERATION = "Charge"
"""Operation that charges a vehicle at a location."""

T = TypeVar("T")


class PlantModel(PlantRecord):
    """An immutable plant model. Positions and lengths are whole millimetres; `..._m` properties are metres.

    References between objects are not checked here, but by importers with `nena_shared.plant.checks`.
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
        """Parse the output of `to_json`. Raises pydantic's ValidationError."""
        return cls.model_validate_json(text)

    def to_json(self) -> str:
        """Return the whole model as JSON with camelCase names, which `from_json` reads back unchanged.

        Defaults are included, so that readers need not know them; only None is omitted.
        """
        return self.model_dump_json(by_alias=True, exclude_none=True)

    @cached_property
    def points_by_name(self) -> Mapping[str, Point]:
        """Points by name."""
        return {point.name: point for point in self.points}

    def only_map(self, default: str = "") -> str:
        """Return the plant's map, ``default`` for what names none; empty if there is none or several."""
        maps = (*(point.map_id for point in self.points), *(vehicle.map_id for vehicle in self.vehicles))
        names = {name or default for name in maps} - {""}
        return names.pop() if len(names) == 1 else ""

    @cached_property
    def points_by_map(self) -> Mapping[str | None, PlanarIndex[Point]]:
        """Spatial index of the points (m) for each mapId; None: points without one."""
        maps: dict[str | None, list[Point]] = {}
        for point in self.points:
            # an empty property is no map
            maps.setdefault(point.map_id or None, []).append(point)
        return {
            map_id: PlanarIndex((Box(point.x_m, point.y_m, point.x_m, point.y_m), point) for point in points)
            for map_id, points in maps.items()
        }

    @cached_property
    def paths_by_name(self) -> Mapping[str, Path]:
        """Paths by name."""
        return {path.name: path for path in self.paths}

    @cached_property
    def location_types_by_name(self) -> Mapping[str, LocationType]:
        """Location types by name."""
        return {location_type.name: location_type for location_type in self.location_types}

    @cached_property
    def locations_by_name(self) -> Mapping[str, Location]:
        """Locations by name."""
        return {location.name: location for location in self.locations}

    @cached_property
    def blocks_by_name(self) -> Mapping[str, Block]:
        """Blocks by name."""
        return {block.name: block for block in self.blocks}

    @cached_property
    def vehicles_by_name(self) -> Mapping[str, Vehicle]:
        """Vehicles by name."""
        return {vehicle.name: vehicle for vehicle in self.vehicles}

    @cached_property
    def vehicle_types(self) -> frozenset[str]:
        """Vehicle types used by points and paths; empty if none."""
        at_points = (use.vehicle_type_id for point in self.points for use in point.vehicle_types)
        on_paths = (use.vehicle_type_id for path in self.paths for use in path.vehicle_types)
        return frozenset((*at_points, *on_paths))

    def point(self, name: str) -> Point:
        """Return the point of this name. Raises UnknownObjectError."""
        return _known_object(self.points_by_name, ObjectKind.POINT, name)

    def path(self, name: str) -> Path:
        """Return the path of this name. Raises UnknownObjectError."""
        return _known_object(self.paths_by_name, ObjectKind.PATH, name)

    def location(self, name: str) -> Location:
        """Return the location of this name. Raises UnknownObjectError."""
        return _known_object(self.locations_by_name, ObjectKind.LOCATION, name)

    def location_type(self, name: str) -> LocationType:
        """Return the location type of this name. Raises UnknownObjectError."""
        return _known_object(self.location_types_by_name, ObjectKind.LOCATION_TYPE, name)

    def vehicle(self, name: str) -> Vehicle:
        """Return the vehicle of this name. Raises UnknownObjectError."""
        return _known_object(self.vehicles_by_name, ObjectKind.VEHICLE, name)

    def edges(self) -> Iterator[DirectedEdge]:
        """Yield every drivable direction of every path, including locked ones, in the order of the paths."""
        for path in self.paths:
            yield from path.edges()

    def link_operations(self, location: Location, link: Link) -> tuple[str, ...]:
        """Return the vehicle operations of a link: those of the location type, if the link allows them."""
        allowed = self.location_type(location.type).allowed_operations
        if not link.allowed_operations:
            return allowed
        return tuple(operation for operation in allowed if operation in link.allowed_operations)

    def access_points(self, location_name: str, operation: str) -> tuple[str, ...]:
        """Return the points at which a location allows `operation`. Raises UnknownObjectError.

        Every link allows NO_OPERATION. The result is empty if no link allows the operation.
        """
        location = self.location(location_name)
        return tuple(
            link.point
            for link in location.links
            if operation == NO_OPERATION or operation in self.link_operations(location, link)
        )


def _known_object(objects: Mapping[str, T], kind: ObjectKind, name: str) -> T:
    try:
        return objects[name]
    except KeyError:
        raise UnknownObjectError(kind, name, objects) from None


def map_transforms(model: PlantModel) -> Mapping[str, MapTransform]:
    """Return the transform for each map that has one; on other maps plant and map frame are identical.

    Raises ValueError if a property is not a valid transform; importers reject such models.
    """
    return {map_id: parse_transform(text) for map_id, text in transform_texts(model)}


def transform_texts(model: PlantModel) -> Iterator[tuple[str, str]]:
    """Yield mapId and text of each transform property."""
    for key, text in model.properties.items():
        if key.startswith(keys.MAP_TRANSFORM):
            yield key.removeprefix(keys.MAP_TRANSFORM), text


ACTION_TYPES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "Load cargo": "pick",
        "Load": "pick",
        "Unload cargo": "drop",
        "Unload": "drop",
        RECHARGE_OPERATION: "startCharging",
        "CHARGE": "startCharging",
    }
)
"""Operations without an entry map to the action of the same name."""


def action_of(operation: str) -> str:
    """Return the VDA 5050 action for an operation."""
    return ACTION_TYPES.get(operation, operation)


def operation_of(action_type: str) -> str:
    """Return the operation for an action; only charging has a standard name."""
    return RECHARGE_OPERATION if action_type == ACTION_TYPES[RECHARGE_OPERATION] else action_type
