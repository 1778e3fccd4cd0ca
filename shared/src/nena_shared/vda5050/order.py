"""The order message (VDA 5050 3.0 section 7.3)."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import Field

from nena_shared.vda5050.action import Action
from nena_shared.vda5050.base import (
    AllowedTurn,
    Angle,
    CommandHeader,
    Identifier,
    NotNegative,
    UInt32,
    WireObject,
)


class OrientationType(StrEnum):
    """Reference of the orientation on an edge (section 7.3)."""

    GLOBAL = "GLOBAL"
    TANGENTIAL = "TANGENTIAL"


class CorridorReferencePoint(StrEnum):
    """Which part of the robot must stay inside a corridor (section 6.1.5)."""

    KINEMATIC_CENTER = "KINEMATIC_CENTER"
    CONTOUR = "CONTOUR"


class ReleaseLossBehavior(StrEnum):
    """What a robot does when the release of a corridor is revoked (section 6.6.10)."""

    STOP = "STOP"
    RETURN = "RETURN"


class AllowedDeviationXY(WireObject):
    """Ellipse around a node: semi-axes ``a``, ``b`` (m), ``theta`` from x to ``a`` (rad) (section 7.3)."""

    a: NotNegative
    b: NotNegative
    theta: Angle = 0.0


class NodePosition(WireObject):
    """Position of a node, m and rad in the project-wide frame of the map (section 7.3)."""

    x: float
    y: float
    theta: Angle | None = None
    map_id: Identifier
    allowed_deviation_xy: Annotated[AllowedDeviationXY | None, Field(alias="allowedDeviationXY")] = None
    allowed_deviation_theta: AllowedTurn | None = None


class Node(WireObject):
    """A node of the order; sequence IDs are even (section 6.1.1)."""

    node_id: Identifier
    sequence_id: UInt32
    node_descriptor: str | None = None
    released: bool
    node_position: NodePosition | None = None
    actions: tuple[Action, ...]


class ControlPoint(WireObject):
    """A control point of a trajectory, m (section 7.3)."""

    x: float
    y: float
    weight: Annotated[float, Field(ge=0)] | None = None


class Trajectory(WireObject):
    """A NURBS from the start to the end of an edge (section 7.3)."""

    degree: Annotated[int, Field(ge=1)] | None = None
    knot_vector: tuple[Annotated[float, Field(ge=0, le=1)], ...] | None = None
    control_points: tuple[ControlPoint, ...]


class Corridor(WireObject):
    """Allowed deviation from the trajectory to each side, m (section 6.1.5)."""

    left_width: NotNegative
    right_width: NotNegative
    corridor_reference_point: CorridorReferencePoint | None = None
    release_required: bool | None = None
    release_loss_behavior: ReleaseLossBehavior | None = None


class Edge(WireObject):
    """An edge between two nodes: m, m/s, rad, rad/s; sequence IDs are odd (section 6.1.1)."""

    edge_id: Identifier
    sequence_id: UInt32
    edge_descriptor: str | None = None
    released: bool
    maximum_speed: NotNegative | None = None
    maximum_mobile_robot_height: NotNegative | None = None
    minimum_load_handling_device_height: NotNegative | None = None
    orientation: Angle | None = None
    orientation_type: OrientationType | None = None
    direction: str | None = None
    reach_orientation_before_entering: bool | None = None
    maximum_rotation_speed: NotNegative | None = None
    trajectory: Trajectory | None = None
    length: NotNegative | None = None
    corridor: Corridor | None = None
    actions: tuple[Action, ...]
    turns_as_planned: bool | None = None
    """Fleet control's own, never sent: orientation and rotation are for every robot, whatever it lists."""


class Order(CommandHeader):
    """A graph of nodes and edges to drive: the released base, then the horizon (section 6.1.1)."""

    order_id: Identifier
    order_update_id: UInt32
    order_description: str | None = None
    zone_set_id: Identifier | None = None
    """Only 2.x: the zone set to use; a robot that lacks it rejects the order."""
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
