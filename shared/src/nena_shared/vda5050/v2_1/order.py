"""The order message of 2.1 (section 6.6.6)."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import BeforeValidator, Field, PlainSerializer, model_validator

from nena_shared.vda5050.base import Identifier, NotNegative, WireObject
from nena_shared.vda5050.order import (
    AllowedDeviationXY,
    Corridor,
    CorridorReferencePoint,
    Edge,
    Node,
    NodePosition,
    Order,
)
from nena_shared.vda5050.v2_1.action import ActionV21
from nena_shared.vda5050.v2_1.base import Negated, TimestampV2
from nena_shared.vda5050.v2_1.trajectory import TrajectoryV21
from nena_shared.vda5050.wire_names import Absent, reads, writes


def _ellipse(radius: object) -> object:
    return {"a": radius, "b": radius} if isinstance(radius, int | float) else radius


def _radius(deviation: AllowedDeviationXY) -> float:
    return min(deviation.a, deviation.b)


DeviationRadius = Annotated[
    AllowedDeviationXY,
    BeforeValidator(_ellipse),
    PlainSerializer(_radius, return_type=NotNegative, when_used="json"),
]
"""A radius in m; an ellipse is sent as its shorter half axis, which never allows more."""


class NodePositionV21(NodePosition):
    """Where a node is; the deviation is a radius."""

    allowed_deviation_xy: Annotated[DeviationRadius | None, Field(alias="allowedDeviationXY")] = None


class NodeV21(Node):
    """A place that the order passes."""

    node_descriptor: Annotated[str | None, Field(alias="nodeDescription")] = None
    node_position: NodePositionV21 | None = None
    actions: tuple[ActionV21, ...]


class CorridorV21(Corridor):
    """A corridor that may be used without a release, which 2.1 does not know."""

    corridor_reference_point: Annotated[
        Annotated[
            CorridorReferencePoint,
            reads({"KINEMATICCENTER": "KINEMATIC_CENTER"}),
            writes({"KINEMATIC_CENTER": "KINEMATICCENTER"}, CorridorReferencePoint),
        ]
        | None,
        Field(alias="corridorRefPoint"),
    ] = None
    release_required: Absent = None
    release_loss_behavior: Absent = None


def _free_to_use(corridor: object) -> object:
    return None if isinstance(corridor, Corridor) and corridor.release_required else corridor


class EdgeV21(Edge):
    """The way between two nodes, which it names."""

    edge_descriptor: Annotated[str | None, Field(alias="edgeDescription")] = None
    start_node_id: Identifier
    end_node_id: Identifier
    maximum_speed: Annotated[NotNegative | None, Field(alias="maxSpeed")] = None
    maximum_mobile_robot_height: Annotated[NotNegative | None, Field(alias="maxHeight")] = None
    minimum_load_handling_device_height: Annotated[NotNegative | None, Field(alias="minHeight")] = None
    maximum_rotation_speed: Annotated[NotNegative | None, Field(alias="maxRotationSpeed")] = None
    reach_orientation_before_entering: Annotated[Negated, Field(alias="rotationAllowed")] = None
    trajectory: TrajectoryV21 | None = None
    corridor: Annotated[CorridorV21 | None, BeforeValidator(_free_to_use)] = None
    """One that needs a release is left out: the robot then keeps to the trajectory, as without a grant."""
    actions: tuple[ActionV21, ...]


class OrderV21(Order):
    """A graph of nodes and edges to drive."""

    timestamp: TimestampV2
    order_description: Absent = None
    nodes: tuple[NodeV21, ...]
    edges: tuple[EdgeV21, ...]

    @classmethod
    def from_neutral(cls, neutral: WireObject) -> Self:
        """Make the 2.1 form of an order; the edges' ends come from their neighbours."""
        order = Order.model_validate(neutral, by_name=True, by_alias=False)
        edges = tuple(
            EdgeV21.model_validate(
                {**dict(edge), "start_node_id": before.node_id, "end_node_id": after.node_id},
                by_name=True,
                by_alias=False,
            )
            for edge, (before, after) in zip(order.edges, pairwise(order.nodes), strict=True)
        )
        return cls.model_validate(order.model_copy(update={"edges": edges}), by_name=True, by_alias=False)

    @model_validator(mode="after")
    def _edges_join_their_nodes(self) -> Self:
        for edge, (before, after) in zip(self.edges, pairwise(self.nodes), strict=False):
            if (edge.start_node_id, edge.end_node_id) != (before.node_id, after.node_id):
                message = (
                    f"edge {edge.edge_id!r} goes from {edge.start_node_id!r} to {edge.end_node_id!r}, "
                    f"but stands between {before.node_id!r} and {after.node_id!r}"
                )
                raise ValueError(message)
        return self
