"""What vehicles of one type may do at a point and on a path, in LIF 1.0.0's terms (m, rad, m/s, rad/s)."""

from enum import StrEnum
from math import cos
from typing import Annotated, Final

from pydantic import ConfigDict, Field

from nena_shared.plant.record import PlantRecord

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
