"""The order message of 3.0 (section 7.3)."""

from __future__ import annotations

from math import pi
from typing import Annotated

from pydantic import AliasChoices, Field, PlainSerializer

from nena_shared.vda5050.base import Angle, NotNegative
from nena_shared.vda5050.order import (
    AllowedDeviationXY,
    ControlPoint,
    Corridor,
    CorridorReferencePoint,
    Edge,
    Node,
    NodePosition,
    Order,
    Trajectory,
)
from nena_shared.vda5050.v3_0.action import ActionV30
from nena_shared.vda5050.wire_names import Absent, reads


def _half_turn(theta: float) -> float:
    """Return the same turn of an ellipse, which looks alike after half a turn, within -π/2 to π/2."""
    if abs(theta) <= pi / 2:
        return theta
    return theta - pi if theta > 0 else theta + pi


class AllowedDeviationXYV30(AllowedDeviationXY):
    """An ellipse around a node; its turn is sent within the bounds of the schema."""

    theta: Annotated[Angle, PlainSerializer(_half_turn, return_type=float, when_used="json")] = 0.0


class NodePositionV30(NodePosition):
    """Where a node is."""

    allowed_deviation_xy: Annotated[AllowedDeviationXYV30 | None, Field(alias="allowedDeviationXY")] = None


class NodeV30(Node):
    """A place that the order passes."""

    node_position: NodePositionV30 | None = None
    actions: tuple[ActionV30, ...]


class ControlPointV30(ControlPoint):
    """A point that shapes a trajectory; one without weight would not."""

    weight: Annotated[float, Field(gt=0)] | None = None


class TrajectoryV30(Trajectory):
    """A NURBS from the start to the end of an edge."""

    control_points: tuple[ControlPointV30, ...]


class CorridorV30(Corridor):
    """How far a robot may leave a trajectory."""

    corridor_reference_point: (
        Annotated[CorridorReferencePoint, reads({"KINEMATICCENTER": "KINEMATIC_CENTER"})] | None
    ) = None


class EdgeV30(Edge):
    """The way between two nodes; the schema has another name for the speed of rotation."""

    maximum_rotation_speed: Annotated[
        NotNegative | None, Field(validation_alias=AliasChoices("maximumRotationSpeed", "maxRotationSpeed"))
    ] = None
    trajectory: TrajectoryV30 | None = None
    corridor: CorridorV30 | None = None
    actions: tuple[ActionV30, ...]


class OrderV30(Order):
    """A graph of nodes and edges to drive."""

    zone_set_id: Absent = None
    nodes: tuple[NodeV30, ...]
    edges: tuple[EdgeV30, ...]
