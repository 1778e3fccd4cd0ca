"""Actions, orders and instant actions of VDA 5050 2.1 (sections 6.6 to 6.9)."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, Final, Self

from pydantic import (
    AfterValidator,
    AliasChoices,
    BeforeValidator,
    Field,
    JsonValue,
    PlainSerializer,
    ValidationInfo,
    field_serializer,
    model_validator,
)

from nena_shared.vda5050.action import (
    Action,
    ActionParameter,
    ActionState,
    ActionStatus,
    BlockingType,
    InstantActions,
)
from nena_shared.vda5050.base import Identifier, NotNegative, WireObject
from nena_shared.vda5050.order import (
    AllowedDeviationXY,
    Corridor,
    CorridorReferencePoint,
    Edge,
    Node,
    NodePosition,
    Order,
    Trajectory,
)
from nena_shared.vda5050.v2_1.base import Negated, TimestampV2
from nena_shared.vda5050.wire_names import Absent, reads, writes

ActionTypeV21 = Annotated[
    Identifier,
    reads({"initPosition": "initializePosition"}),
    writes({"initializePosition": "initPosition"}),
]

BlockingTypeV21 = Annotated[BlockingType, writes({"SINGLE": "HARD"}, BlockingType)]
"""2.1 lacks SINGLE; HARD also excludes other actions and is stricter."""


INSTANT_ACTIONS_OF_1_1: Final = "instantActions"
"""Name of the instant actions array in 1.1."""

TRIGGER: Final = ("waitForTrigger", "triggerType")
"""A list of triggers in 3.0, a single one in 2.x."""

CANCELLED_ORDER: Final = ("cancelOrder", "orderId")
"""Not in 2.x, where it is always the current order."""


class ActionV21(Action):
    """An action; 2.1 has no retries, and other formats for some parameters."""

    action_type: ActionTypeV21
    action_descriptor: Annotated[str | None, Field(alias="actionDescription")] = None
    blocking_type: BlockingTypeV21
    retriable: Absent = None

    @model_validator(mode="after")
    def _read_trigger(self, info: ValidationInfo) -> Self:
        action_type, key = TRIGGER
        # info.mode: only JSON has 2.x's values; a neutral action that is converted has 3.0's
        if self.action_type != action_type or info.mode != "json":
            return self
        parameters = tuple(
            parameter.model_copy(update={"value": [parameter.value]})
            if parameter.key == key and isinstance(parameter.value, str)
            else parameter
            for parameter in self.action_parameters
        )
        return self.model_copy(update={"action_parameters": parameters})

    @field_serializer("action_parameters", when_used="json")
    def _written_parameters(self, parameters: tuple[ActionParameter, ...]) -> tuple[ActionParameter, ...]:
        if self.action_type not in (TRIGGER[0], CANCELLED_ORDER[0]):
            return parameters
        return tuple(
            parameter.model_copy(update={"value": _first_value(parameter.value)})
            if (self.action_type, parameter.key) == TRIGGER
            else parameter
            for parameter in parameters
            if (self.action_type, parameter.key) != CANCELLED_ORDER
        )


def _first_value(value: JsonValue) -> JsonValue:
    return value[0] if isinstance(value, list) and value else value


class ActionStateV21(ActionState):
    """State of an action; RETRIABLE is reported as RUNNING (2.1 section 6.11)."""

    action_type: ActionTypeV21 | None = None
    action_descriptor: Annotated[str | None, Field(alias="actionDescription")] = None
    action_status: Annotated[ActionStatus, writes({"RETRIABLE": "RUNNING"}, ActionStatus)]
    action_result: Annotated[str | None, Field(alias="resultDescription")] = None


DEFAULT_DEGREE = 1  # as in 3.0, 7.3


class TrajectoryV21(Trajectory):
    """A NURBS from the start to the end of an edge (2.1 section 6.6.6); omitted fields get 3.0's defaults.

    Knots are not added if there are too few control points for the degree.
    """

    degree: Annotated[
        Annotated[int, Field(ge=1)] | None, AfterValidator(lambda degree: degree or DEFAULT_DEGREE)
    ] = DEFAULT_DEGREE

    @staticmethod
    def finish_record(record: Any) -> Mapping[str, object]:  # noqa: ANN401 - it has the fields of the form
        """Reject trajectories without degree or knots, which only the codec adds."""
        if record.degree is None or record.knot_vector is None:
            raise ValueError("degree and knots are filled in by the codec")
        return {}

    @model_validator(mode="after")
    def _with_knots(self) -> Self:
        points, degree = len(self.control_points), self.degree or DEFAULT_DEGREE
        if self.knot_vector is not None or points <= degree:
            return self
        return self.model_copy(update={"knot_vector": uniform_knots(points, degree)})


def uniform_knots(control_points: int, degree: int) -> tuple[float, ...]:
    """Return clamped uniform knots from 0 to 1; requires more control points than ``degree``."""
    spans = control_points - degree
    inner = tuple(index / spans for index in range(1, spans))
    return (0.0,) * (degree + 1) + inner + (1.0,) * (degree + 1)


def _as_ellipse(radius: object) -> object:
    return {"a": radius, "b": radius} if isinstance(radius, int | float) else radius


def _as_radius(deviation: AllowedDeviationXY) -> float:
    return min(deviation.a, deviation.b)


DeviationRadius = Annotated[
    AllowedDeviationXY,
    BeforeValidator(_as_ellipse),
    PlainSerializer(_as_radius, return_type=NotNegative, when_used="json"),
]
"""Radius, m. An ellipse is sent as its shorter semi-axis, the stricter value."""


class NodePositionV21(NodePosition):
    """Position of a node (2.1 section 6.6.6); the deviation is a radius."""

    allowed_deviation_xy: Annotated[DeviationRadius | None, Field(alias="allowedDeviationXY")] = None


class NodeV21(Node):
    """A node of an order (2.1 section 6.6.6)."""

    node_descriptor: Annotated[str | None, Field(alias="nodeDescription")] = None
    node_position: NodePositionV21 | None = None
    actions: tuple[ActionV21, ...]


class CorridorV21(Corridor):
    """A corridor (2.1 section 6.6.5); 2.1 has no corridors that need a release."""

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
    """An edge, with the IDs of its nodes (2.1 section 6.6.6)."""

    edge_descriptor: Annotated[str | None, Field(alias="edgeDescription")] = None
    start_node_id: Identifier
    end_node_id: Identifier
    maximum_speed: Annotated[NotNegative | None, Field(alias="maxSpeed")] = None
    maximum_mobile_robot_height: Annotated[NotNegative | None, Field(alias="maxHeight")] = None
    minimum_load_handling_device_height: Annotated[NotNegative | None, Field(alias="minHeight")] = None
    maximum_rotation_speed: Annotated[NotNegative | None, Field(alias="maxRotationSpeed")] = None
    reach_orientation_before_entering: Annotated[Negated, Field(alias="rotationAllowed")] = None
    trajectory: TrajectoryV21 | None = None
    # 2.1, 6.6.5: a corridor in an order may be used at once, without the request of 3.0, 6.6.10
    corridor: Annotated[CorridorV21 | None, BeforeValidator(_free_to_use)] = None
    """Omitted if it needs a release: the robot then stays on the trajectory, as without a grant."""
    actions: tuple[ActionV21, ...]


class OrderV21(Order):
    """A graph of nodes and edges to drive (2.1 section 6.6.6)."""

    timestamp: TimestampV2
    order_description: Absent = None
    nodes: tuple[NodeV21, ...]
    edges: tuple[EdgeV21, ...]

    @classmethod
    def from_neutral(cls, neutral: WireObject) -> Self:
        """Convert an order to its 2.1 form (2.1 section 6.6.6); add the node IDs to its edges."""
        order = Order.from_neutral(neutral)
        edges = tuple(
            EdgeV21.model_validate(
                {**vars(edge), "start_node_id": start.node_id, "end_node_id": end.node_id},
                by_name=True,
                by_alias=False,
            )
            for edge, (start, end) in zip(order.edges, pairwise(order.nodes), strict=True)
        )
        return super().from_neutral(order.model_copy(update={"edges": edges}))

    @model_validator(mode="after")
    def _edges_join_their_nodes(self) -> Self:
        # not strict: the graph rules report a wrong number of edges
        for edge, (start, end) in zip(self.edges, pairwise(self.nodes), strict=False):
            if (edge.start_node_id, edge.end_node_id) != (start.node_id, end.node_id):
                raise ValueError(
                    f"edge {edge.edge_id!r} goes from {edge.start_node_id!r} to {edge.end_node_id!r}, "
                    f"but is between {start.node_id!r} and {end.node_id!r}"
                )
        return self


class InstantActionsV21(InstantActions):
    """Actions to execute immediately (2.1 section 6.9); some fleet controls use the array name of 1.1."""

    timestamp: TimestampV2
    actions: Annotated[
        tuple[ActionV21, ...], Field(validation_alias=AliasChoices("actions", INSTANT_ACTIONS_OF_1_1))
    ]
