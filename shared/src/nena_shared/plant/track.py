"""Points and paths of a plant model, and their rules for each vehicle type."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import cos, isfinite, radians
from typing import Annotated, Final

from pydantic import BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_camel

from nena_shared import model_building
from nena_shared.plant import property_keys as keys
from nena_shared.plant.geometry import normalized
from nena_shared.plant_terms import ExecutionTrigger, PointType


class PlantRecord(BaseModel):
    """An immutable record with camelCase JSON names; unknown names are ignored."""

    model_config = ConfigDict(
        frozen=True,
        alias_generator=to_camel,
        populate_by_name=True,
        # models of newer releases stay readable
        extra="ignore",
        allow_inf_nan=False,
        defer_build=model_building.deferred,
    )


MM_PER_M = 1000

FAR_MM: Final = 10**18
"""Limit of positions and lengths; keeps computed values finite."""

Millimetres = Annotated[int, Field(ge=-FAR_MM, le=FAR_MM)]


class PlantVertex(PlantRecord):
    """A vertex of an envelope or a drawn position, mm in the plant frame."""

    x_mm: Millimetres
    y_mm: Millimetres


class Envelope(PlantRecord):
    """Area covered by vehicles with this envelope key; a closed polygon: the last vertex is the first."""

    key: str
    vertices: tuple[PlantVertex, ...]


class BoundingBox(PlantRecord):
    """Vehicle size in mm; the reference offset points from the box centre to the vehicle origin."""

    length_mm: int = Field(default=1000, ge=1, le=FAR_MM)
    width_mm: int = Field(default=1000, ge=1, le=FAR_MM)
    height_mm: int = Field(default=1000, ge=1, le=FAR_MM)
    reference_offset_x_mm: Millimetres = 0
    reference_offset_y_mm: Millimetres = 0

    def contains(self, other: "BoundingBox") -> bool:
        """Return whether this box contains another one at the same reference point."""
        x_mm = abs(self.reference_offset_x_mm - other.reference_offset_x_mm)
        y_mm = abs(self.reference_offset_y_mm - other.reference_offset_y_mm)
        return (
            other.length_mm + 2 * x_mm <= self.length_mm
            and other.width_mm + 2 * y_mm <= self.width_mm
            and other.height_mm <= self.height_mm
        )


class LabelLayout(PlantRecord):
    """Label offset of a drawn object, pixels, and its layer."""

    label_offset_x_px: int = -10
    label_offset_y_px: int = -20
    layer_id: int = 0


MOST: Final = 1e9
"""Limit of coordinates and speeds; keeps computed values finite."""

Coordinate = Annotated[float, Field(ge=-MOST, le=MOST)]
"""m"""
Speed = Annotated[float, Field(ge=0, le=MOST)]
"""m/s or rad/s"""

MAX_DEGREE: Final = 16
"""Maximum degree of a trajectory: computing a position costs its square."""


class PlantBlockingType(StrEnum):
    """Blocking type of an action, as in VDA 5050 (3.0 section 6.2.2)."""

    NONE = "NONE"
    SOFT = "SOFT"
    SINGLE = "SINGLE"
    """Since LIF 2.0."""
    HARD = "HARD"


class RequirementType(StrEnum):
    """Whether fleet control sends an action: always, by agreement, or optionally."""

    REQUIRED = "REQUIRED"
    CONDITIONAL = "CONDITIONAL"
    OPTIONAL = "OPTIONAL"


class PathOrientationType(StrEnum):
    """Reference of the orientation on a path: its direction or the plant frame."""

    TANGENTIAL = "TANGENTIAL"
    GLOBAL = "GLOBAL"


class RotationAllowed(StrEnum):
    """Allowed directions of rotation at an end of a path."""

    NONE = "NONE"
    CCW = "CCW"
    CW = "CW"
    BOTH = "BOTH"


class TypeActionParameter(PlantRecord):
    """A fixed parameter of an action; numbers are converted to strings."""

    model_config = ConfigDict(coerce_numbers_to_str=True)

    key: str
    value: str
    is_json: bool = False
    """Whether the text is JSON that contains the actual value (since LIF 2.0)."""


class TypeAction(PlantRecord):
    """An action that is possible or required at a point or on a path."""

    action_type: str
    blocking_type: PlantBlockingType
    requirement_type: RequirementType | None = None
    action_description: str | None = None
    action_parameters: tuple[TypeActionParameter, ...] = ()


class LoadRestriction(PlantRecord):
    """Loads with which a point or path may be used; no names: any. Routing ignores it."""

    unloaded: bool
    loaded: bool
    load_set_names: tuple[str, ...] = ()


class TrajectoryPoint(PlantRecord):
    """A control point of a trajectory, metres in the plant frame."""

    x: Coordinate
    y: Coordinate
    weight: float = Field(default=1.0, ge=1 / MOST, le=MOST)


class PathTrajectory(PlantRecord):
    """A NURBS curve from the path's source to its destination."""

    degree: int = Field(default=1, ge=1, le=MAX_DEGREE)
    knot_vector: tuple[Coordinate, ...]
    control_points: tuple[TrajectoryPoint, ...]


HalfAxis = Annotated[float, Field(ge=0, le=MOST)]
"""m"""


class DeviationBounds(PlantRecord):
    """Bounds of the ellipse of allowed deviation at a point, m (since LIF 2.0)."""

    a_minimum: HalfAxis | None = None
    a_maximum: HalfAxis | None = None
    b_minimum: HalfAxis | None = None
    b_maximum: HalfAxis | None = None
    theta: float | None = None
    """Angle from x to the longer axis a, radians in the plant frame."""

    def ellipse(self, wanted: float) -> tuple[float, float]:
        """Return the semi-axes a and b, m: the values within the bounds that are closest to ``wanted``."""
        # LIF 2.0: a is the longer semi-axis, so it gives way to b's lower bound
        b = _limit_to(wanted, self.b_minimum, self.b_maximum)
        a = _limit_to(max(wanted, b), self.a_minimum, self.a_maximum)
        return a, min(a, b)


def _limit_to(value: float, least: float | None, most: float | None) -> float:
    return max(least or 0.0, value if most is None else min(value, most))


class CorridorReference(StrEnum):
    """Which part of a vehicle must stay inside a corridor."""

    KINEMATIC_CENTER = "KINEMATIC_CENTER"
    CONTOUR = "CONTOUR"


class PathCorridor(PlantRecord):
    """Allowed deviation from a path, metres to each side (since LIF 2.0)."""

    maximum_left_width: HalfAxis
    maximum_right_width: HalfAxis
    corridor_reference_point: CorridorReference | None = None


class LineGuidance(PlantRecord):
    """Data for line-guided vehicles: direction at a junction, length of the path (since LIF 2.0)."""

    direction: str | None = None
    length: HalfAxis | None = None


class VehicleTypeAtPoint(PlantRecord):
    """How vehicles of a type may use a point (LIF: vehicleTypeNodeProperty)."""

    vehicle_type_id: str = Field(coerce_numbers_to_str=True)
    theta: float | None = None
    """Required heading, radians in the plant frame."""
    allowed_deviation_xy: Annotated[DeviationBounds | None, Field(alias="allowedDeviationXY")] = None
    load_restriction: LoadRestriction | None = None
    actions: tuple[TypeAction, ...] = ()
    forbidden_action_types: tuple[str, ...] = ()


class VehicleTypeOnPath(PlantRecord):
    """How vehicles of a type may use a path (LIF: vehicleTypeEdgeProperty)."""

    vehicle_type_id: str = Field(coerce_numbers_to_str=True)
    rotation_allowed: bool | None = None
    """Whether vehicles may turn on the path; None (since LIF 2.0): not specified, treated as not allowed."""
    vehicle_orientation: float | None = None
    other_orientations: tuple[float, ...] = ()
    """Alternative orientations (since LIF 2.0)."""
    # this and the next two: the defaults of LIF
    orientation_type: PathOrientationType = PathOrientationType.TANGENTIAL
    rotation_at_start_node_allowed: RotationAllowed = RotationAllowed.BOTH
    rotation_at_end_node_allowed: RotationAllowed = RotationAllowed.BOTH
    max_speed: Speed | None = None
    max_rotation_speed: Speed | None = None
    min_height: Coordinate | None = None
    max_height: Coordinate | None = None
    load_restriction: LoadRestriction | None = None
    actions: tuple[TypeAction, ...] = ()
    forbidden_action_types: tuple[str, ...] = ()
    trajectory: PathTrajectory | None = None
    line_guidance: LineGuidance | None = None
    corridor: PathCorridor | None = None
    # LIF's default
    reentry_allowed: bool = True

    @property
    def orientations(self) -> tuple[float, ...]:
        """All allowed orientations; empty: any."""
        return (
            () if self.vehicle_orientation is None else (self.vehicle_orientation, *self.other_orientations)
        )

    @property
    def is_backward(self) -> bool:
        """Whether vehicles must drive backwards on this path."""
        return bool(self.orientations) and all(map(self.leads_backward, self.orientations))

    def leads_backward(self, orientation: float) -> bool:
        """Return whether vehicles with this orientation drive backwards on this path."""
        # LIF: 0 is forwards and pi backwards, relative to the path; GLOBAL is relative to the plant
        return self.orientation_type is PathOrientationType.TANGENTIAL and cos(orientation) < 0


def deviation_of(properties: Mapping[str, str], key: str) -> float | None:
    """Return a property's value; None if it is unset or no finite number of at least 0."""
    try:
        value = float(properties[key])
    except (KeyError, ValueError):
        return None
    return value if isfinite(value) and value >= 0 else None


class Point(PlantRecord):
    """A point of the plant; `orientation_deg` None: any heading."""

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
    """Vehicle types that may use the point; empty: all."""

    @property
    def map_id(self) -> str | None:
        """MapId of the point (property `vda5050:mapId`); None: the map of each vehicle."""
        return self.properties.get(keys.VDA5050_MAP_ID)

    @property
    def deviation_xy_m(self) -> float | None:
        """Allowed deviation from the position, metres; None: that of each vehicle."""
        return deviation_of(self.properties, keys.VDA5050_DEVIATION_XY)

    @property
    def deviation_theta_rad(self) -> float | None:
        """Allowed deviation from the heading, radians (property: degrees); None: that of each vehicle."""
        degrees = deviation_of(self.properties, keys.VDA5050_DEVIATION_THETA)
        return None if degrees is None else radians(degrees)

    @property
    def x_m(self) -> float:
        """X coordinate in the plant frame, metres."""
        return self.x_mm / MM_PER_M

    @property
    def y_m(self) -> float:
        """Y coordinate in the plant frame, metres."""
        return self.y_mm / MM_PER_M

    @property
    def heading_rad(self) -> float | None:
        """Required heading in radians, -pi to pi, counter-clockwise from +x; None: any."""
        return None if self.orientation_deg is None else normalized(radians(self.orientation_deg))

    def forbids(self, action_type: str, vehicle_types: Collection[str]) -> bool:
        """Return whether an action is forbidden here for one of the vehicle types."""
        uses = (use for use in self.vehicle_types if use.vehicle_type_id in vehicle_types)
        return any(action_type in use.forbidden_action_types for use in uses)

    def is_open_to(self, vehicle_type: str) -> bool:
        """Return whether vehicles of a type may use the point."""
        return not self.vehicle_types or any(
            use.vehicle_type_id == vehicle_type for use in self.vehicle_types
        )


BACKWARD_SUFFIX: Final = ":backward"
"""Suffix of backward edge ids: `A --- B:backward`; the forward edge has the path's name."""


class Orientation(StrEnum):
    """Driving direction on a path: forward, or backward against the path's direction."""

    FORWARD = "FORWARD"
    BACKWARD = "BACKWARD"


class ConnectionType(StrEnum):
    """Shape of a drawn path."""

    DIRECT = "DIRECT"
    ELBOW = "ELBOW"
    SLANTED = "SLANTED"
    POLYPATH = "POLYPATH"
    BEZIER = "BEZIER"
    BEZIER_3 = "BEZIER_3"


class LayoutPoint(PlantRecord):
    """A control point of a drawn path, mm in the plant frame (pixels times the layout's scale)."""

    x_mm: float
    y_mm: float


class PathLayout(PlantRecord):
    """Drawing of a path. It does not define the path's length.

    BEZIER has 2 control points, BEZIER_3 has 5 (two cubics that meet in the third), POLYPATH has its corners.
    """

    connection_type: ConnectionType = ConnectionType.DIRECT
    control_points: tuple[LayoutPoint, ...] = ()
    layer_id: int = 0


class PeripheralOperation(PlantRecord):
    """Operation of a peripheral device, such as a door, for vehicles on this path."""

    name: str
    location: str
    execution_trigger: ExecutionTrigger = ExecutionTrigger.AFTER_ALLOCATION
    completion_required: bool = False


class Path(PlantRecord):
    """A path between two points; a maximum speed of 0 mm/s closes that direction."""

    name: str = Field(min_length=1)
    source: str
    destination: str
    # openTCS, too, has no paths without a length
    length_mm: int = Field(ge=1, le=FAR_MM)
    max_velocity_mm_s: int = Field(default=1000, ge=0, le=FAR_MM)
    max_reverse_velocity_mm_s: int = Field(default=0, ge=0, le=FAR_MM)
    locked: bool = False
    peripheral_operations: tuple[PeripheralOperation, ...] = ()
    envelopes: tuple[Envelope, ...] = ()
    properties: Mapping[str, str] = Field(default_factory=dict)
    layout: PathLayout = PathLayout()
    vehicle_types: tuple[VehicleTypeOnPath, ...] = ()
    """Vehicle types that may use the path; empty: all."""

    @property
    def length_m(self) -> float:
        """Length in metres, used for routing costs; independent of the drawing."""
        return self.length_mm / MM_PER_M

    def use_by(self, vehicle_type: str) -> VehicleTypeOnPath | None:
        """Return the rules for vehicles of a type, if any."""
        return next((use for use in self.vehicle_types if use.vehicle_type_id == vehicle_type), None)

    def is_open_to(self, vehicle_type: str) -> bool:
        """Return whether vehicles of a type may use the path."""
        # LIF: an element is closed to types without an entry; openTCS's models have no entries at all
        return not self.vehicle_types or self.use_by(vehicle_type) is not None

    def edges(self) -> Iterator["DirectedEdge"]:
        """Yield the drivable directions of the path, locked or not."""
        # openTCS: a maximum speed of 0 closes a direction
        if self.max_velocity_mm_s:
            yield DirectedEdge(self, Orientation.FORWARD)
        if self.max_reverse_velocity_mm_s:
            yield DirectedEdge(self, Orientation.BACKWARD)


@dataclass(frozen=True, slots=True)
class DirectedEdge:
    """One direction of a path; corresponds to a VDA 5050 edge."""

    path: Path
    orientation: Orientation

    @property
    def id(self) -> str:
        """Edge id: the path's name, with BACKWARD_SUFFIX for the backward direction."""
        return self.path.name if self.is_forward else self.path.name + BACKWARD_SUFFIX

    @property
    def is_forward(self) -> bool:
        """Whether the edge leads from the path's source to its destination."""
        return self.orientation is Orientation.FORWARD

    @property
    def source(self) -> str:
        """Name of the point at which the edge starts."""
        return self.path.source if self.is_forward else self.path.destination

    @property
    def destination(self) -> str:
        """Name of the point at which the edge ends."""
        return self.path.destination if self.is_forward else self.path.source

    @property
    def max_velocity_mm_s(self) -> int:
        """Maximum speed in this direction, mm/s."""
        return self.path.max_velocity_mm_s if self.is_forward else self.path.max_reverse_velocity_mm_s

    @property
    def max_velocity_m_s(self) -> float:
        """Maximum speed in this direction, m/s."""
        return self.max_velocity_mm_s / MM_PER_M
