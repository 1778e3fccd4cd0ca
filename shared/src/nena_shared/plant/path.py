"""Paths: directed connections of two points, and the one or two directed edges that each gives."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from pydantic import Field

from nena_shared.plant.geometry import FAR_MM, MM_PER_M, Envelope
from nena_shared.plant.record import PlantRecord
from nena_shared.plant.vehicle_type import VehicleTypeOnPath

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
