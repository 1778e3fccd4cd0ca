"""Points and paths of a plant model, and what vehicles of each type may do there."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import cos, radians
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_camel

from nena_shared.plant import property_keys as keys
from nena_shared.plant.geometry import normalized


class PlantRecord(BaseModel):
    """An immutable record; its JSON names are camelCase, and names from a newer writer are passed over."""

    model_config = ConfigDict(
        frozen=True,
        alias_generator=to_camel,
        populate_by_name=True,
        extra="ignore",
        allow_inf_nan=False,
    )


MM_PER_M = 1000

FAR_MM: Final = 10**18
"""Farther and longer than anything on earth; keeps what is computed from a file finite."""

Millimetres = Annotated[int, Field(ge=-FAR_MM, le=FAR_MM)]


class Vertex(PlantRecord):
    """A corner of an envelope, or a drawn position, in mm of the plant frame."""

    x_mm: Millimetres
    y_mm: Millimetres


class Envelope(PlantRecord):
    """The area that vehicles with this envelope key cover; closed: the last vertex is the first."""

    key: str
    vertices: tuple[Vertex, ...]


class BoundingBox(PlantRecord):
    """Size of a vehicle in mm; the reference offset leads from the box's centre to the vehicle's origin."""

    length_mm: int = Field(default=1000, ge=1, le=FAR_MM)
    width_mm: int = Field(default=1000, ge=1, le=FAR_MM)
    height_mm: int = Field(default=1000, ge=1, le=FAR_MM)
    reference_offset_x_mm: Millimetres = 0
    reference_offset_y_mm: Millimetres = 0

    def holds(self, other: "BoundingBox") -> bool:
        """Whether another box lies within this one when their reference points lie on each other."""
        x_mm = abs(self.reference_offset_x_mm - other.reference_offset_x_mm)
        y_mm = abs(self.reference_offset_y_mm - other.reference_offset_y_mm)
        return (
            other.length_mm + 2 * x_mm <= self.length_mm
            and other.width_mm + 2 * y_mm <= self.width_mm
            and other.height_mm <= self.height_mm
        )


class LabelLayout(PlantRecord):
    """Where the label of a drawn object stands, in pixels from it, and the layer that shows it."""

    label_offset_x_px: int = -10
    label_offset_y_px: int = -20
    layer_id: int = 0


MOST: Final = 1e9
"""More metres, and more metres a second, than anything on earth; keeps what is computed finite."""

Coordinate = Annotated[float, Field(ge=-MOST, le=MOST)]
"""m"""
Speed = Annotated[float, Field(ge=0, le=MOST)]
"""m/s or rad/s"""

MAX_DEGREE: Final = 16
"""Of a trajectory; the work for a place on it grows with the square."""


class BlockingType(StrEnum):
    """What may go on beside an action, as in VDA 5050."""

    NONE = "NONE"
    SOFT = "SOFT"
    HARD = "HARD"


class RequirementType(StrEnum):
    """Whether fleet control sends an action: always, by agreement, or as it likes."""

    REQUIRED = "REQUIRED"
    CONDITIONAL = "CONDITIONAL"
    OPTIONAL = "OPTIONAL"


class OrientationType(StrEnum):
    """To what the orientation on a path refers: to its direction, or to the plant's frame."""

    TANGENTIAL = "TANGENTIAL"
    GLOBAL = "GLOBAL"


class RotationAllowed(StrEnum):
    """In which directions a vehicle may turn at an end of a path."""

    NONE = "NONE"
    CCW = "CCW"
    CW = "CW"
    BOTH = "BOTH"


class ActionParameter(PlantRecord):
    """A fixed parameter that must be sent along with an action; a number is taken for its text."""

    model_config = ConfigDict(coerce_numbers_to_str=True)

    key: str
    value: str


class TypeAction(PlantRecord):
    """An action that is possible or demanded at a point or on a path."""

    action_type: str
    blocking_type: BlockingType
    requirement_type: RequirementType | None = None
    action_description: str | None = None
    action_parameters: tuple[ActionParameter, ...] = ()


class LoadRestriction(PlantRecord):
    """With which loads a path may be driven; without names of load sets, with each of them."""

    unloaded: bool
    loaded: bool
    load_set_names: tuple[str, ...] = ()

    def allows(self, *, loaded: bool) -> bool:
        """Whether a vehicle with (some) load, or without one, may drive here."""
        return self.loaded if loaded else self.unloaded


class TrajectoryPoint(PlantRecord):
    """A control point of a trajectory, m of the plant frame."""

    x: Coordinate
    y: Coordinate
    weight: float = Field(default=1.0, ge=1 / MOST, le=MOST)


class Trajectory(PlantRecord):
    """A NURBS from the path's source to its destination."""

    degree: int = Field(default=1, ge=1, le=MAX_DEGREE)
    knot_vector: tuple[Coordinate, ...]
    control_points: tuple[TrajectoryPoint, ...]


class VehicleTypeAtPoint(PlantRecord):
    """How vehicles of a type may use a point (LIF: vehicleTypeNodeProperty)."""

    vehicle_type_id: str
    theta: float | None = None
    """Heading that they must have here; rad of the plant frame."""
    actions: tuple[TypeAction, ...] = ()


class VehicleTypeOnPath(PlantRecord):
    """How vehicles of a type may use a path (LIF: vehicleTypeEdgeProperty)."""

    vehicle_type_id: str
    rotation_allowed: bool
    vehicle_orientation: float | None = None
    orientation_type: OrientationType = OrientationType.TANGENTIAL
    rotation_at_start_node_allowed: RotationAllowed = RotationAllowed.BOTH
    rotation_at_end_node_allowed: RotationAllowed = RotationAllowed.BOTH
    max_speed: Speed | None = None
    max_rotation_speed: Speed | None = None
    min_height: Coordinate | None = None
    max_height: Coordinate | None = None
    load_restriction: LoadRestriction | None = None
    actions: tuple[TypeAction, ...] = ()
    trajectory: Trajectory | None = None
    reentry_allowed: bool = True

    @property
    def is_backward(self) -> bool:
        """Whether they drive here with their back first."""
        tangential = self.orientation_type is OrientationType.TANGENTIAL
        return tangential and self.vehicle_orientation is not None and cos(self.vehicle_orientation) < 0

    def allows(self, *, loaded: bool | None) -> bool:
        """Whether the load lets them drive here; None: nobody knows whether there is one."""
        if loaded is None or self.load_restriction is None:
            return True
        return self.load_restriction.allows(loaded=loaded)


class PointType(StrEnum):
    """What a vehicle may do at a point."""

    HALT_POSITION = "HALT_POSITION"
    PARK_POSITION = "PARK_POSITION"


class Point(PlantRecord):
    """A point of the plant; `orientation_deg` is None where any heading will do."""

    name: str = Field(min_length=1)
    x_mm: Millimetres
    y_mm: Millimetres
    z_mm: Millimetres = 0
    orientation_deg: float | None = None
    type: PointType = PointType.HALT_POSITION
    max_vehicle_bounding_box: BoundingBox = BoundingBox()
    envelopes: tuple[Envelope, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
    layout: LabelLayout = LabelLayout()
    vehicle_types: tuple[VehicleTypeAtPoint, ...] = ()
    """The vehicle types that may be here, where the plant tells them apart; empty: all."""

    @property
    def map_id(self) -> str | None:
        """The map that the point is on (property `vda5050:mapId`); None: that of each vehicle."""
        return self.properties.get(keys.VDA5050_MAP_ID)

    @property
    def x_m(self) -> float:
        """The x coordinate in metres of the plant frame."""
        return self.x_mm / MM_PER_M

    @property
    def y_m(self) -> float:
        """The y coordinate in metres of the plant frame."""
        return self.y_mm / MM_PER_M

    @property
    def heading_rad(self) -> float | None:
        """The wanted heading in radians, -pi to pi, counter-clockwise from +x; None where any will do."""
        return None if self.orientation_deg is None else normalized(radians(self.orientation_deg))

    def is_open_to(self, vehicle_type: str) -> bool:
        """Whether vehicles of a type may be here."""
        return not self.vehicle_types or any(
            use.vehicle_type_id == vehicle_type for use in self.vehicle_types
        )


BACKWARD_SUFFIX: Final = ":backward"
"""The backward edge of path `A --- B` has the id `A --- B:backward`; the forward edge has the path's name."""


class Orientation(StrEnum):
    """How a vehicle drives along a path: with its front first, or backwards against the path's direction."""

    FORWARD = "FORWARD"
    BACKWARD = "BACKWARD"


class ExecutionTrigger(StrEnum):
    """When a peripheral operation of a path starts."""

    AFTER_ALLOCATION = "AFTER_ALLOCATION"
    AFTER_MOVEMENT = "AFTER_MOVEMENT"


class ConnectionType(StrEnum):
    """How a path is drawn."""

    DIRECT = "DIRECT"
    ELBOW = "ELBOW"
    SLANTED = "SLANTED"
    POLYPATH = "POLYPATH"
    BEZIER = "BEZIER"
    BEZIER_3 = "BEZIER_3"


class ControlPoint(PlantRecord):
    """A control point of a drawn path, in mm of the plant frame (pixels times the layout's scale)."""

    x_mm: float
    y_mm: float


class PathLayout(PlantRecord):
    """The drawn course of a path. It is no measure of the way: that is the path's length.

    BEZIER has 2 control points, BEZIER_3 has 5 (two cubics that meet in the third), POLYPATH has its corners.
    """

    connection_type: ConnectionType = ConnectionType.DIRECT
    control_points: tuple[ControlPoint, ...] = ()
    layer_id: int = 0


class PeripheralOperation(PlantRecord):
    """What a peripheral device, such as a door, does for a vehicle on this path."""

    name: str
    location: str
    execution_trigger: ExecutionTrigger = ExecutionTrigger.AFTER_ALLOCATION
    completion_required: bool = False


class Path(PlantRecord):
    """A path from one point to another; a speed of 0 mm/s means that nobody drives it in that direction."""

    name: str = Field(min_length=1)
    source: str
    destination: str
    length_mm: int = Field(ge=1, le=FAR_MM)
    max_velocity_mm_s: int = Field(default=1000, ge=0, le=FAR_MM)
    max_reverse_velocity_mm_s: int = Field(default=0, ge=0, le=FAR_MM)
    locked: bool = False
    peripheral_operations: tuple[PeripheralOperation, ...] = ()
    envelopes: tuple[Envelope, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
    layout: PathLayout = PathLayout()
    vehicle_types: tuple[VehicleTypeOnPath, ...] = ()
    """The vehicle types that may drive here, where the plant tells them apart; empty: all."""

    @property
    def length_m(self) -> float:
        """The length in metres: the truth for costs, also where the drawn curve says otherwise."""
        return self.length_mm / MM_PER_M

    def use_by(self, vehicle_type: str) -> VehicleTypeOnPath | None:
        """Return how vehicles of a type may drive here, if the plant says so for them."""
        return next((use for use in self.vehicle_types if use.vehicle_type_id == vehicle_type), None)

    def is_open_to(self, vehicle_type: str) -> bool:
        """Whether vehicles of a type may drive here."""
        return not self.vehicle_types or self.use_by(vehicle_type) is not None

    def edges(self) -> Iterator["DirectedEdge"]:
        """Yield the directions in which the path can be driven; whether it is locked makes no difference."""
        if self.max_velocity_mm_s:
            yield DirectedEdge(self, Orientation.FORWARD)
        if self.max_reverse_velocity_mm_s:
            yield DirectedEdge(self, Orientation.BACKWARD)


@dataclass(frozen=True, slots=True)
class DirectedEdge:
    """One direction of a path. A VDA 5050 edge is made from each."""

    path: Path
    orientation: Orientation

    @property
    def id(self) -> str:
        """The edge's id: the path's name, with BACKWARD_SUFFIX for the backward direction."""
        return self.path.name if self.is_forward else self.path.name + BACKWARD_SUFFIX

    @property
    def is_forward(self) -> bool:
        """Whether the edge leads from the path's source to its destination."""
        return self.orientation is Orientation.FORWARD

    @property
    def source(self) -> str:
        """The name of the point where this edge begins."""
        return self.path.source if self.is_forward else self.path.destination

    @property
    def destination(self) -> str:
        """The name of the point where this edge ends."""
        return self.path.destination if self.is_forward else self.path.source

    @property
    def max_velocity_mm_s(self) -> int:
        """The highest speed allowed in this direction, in mm/s."""
        return self.path.max_velocity_mm_s if self.is_forward else self.path.max_reverse_velocity_mm_s

    @property
    def max_velocity_m_s(self) -> float:
        """The highest speed allowed in this direction, in m/s."""
        return self.max_velocity_mm_s / MM_PER_M
