"""VDA 5050 3.0: the neutral messages, which also accept misspelt and older names."""

from __future__ import annotations

from math import ceil, pi
from typing import Annotated, Self

from pydantic import (
    AfterValidator,
    AliasChoices,
    BeforeValidator,
    Field,
    PlainSerializer,
    ValidationInfo,
    model_validator,
)

from nena_shared.vda5050.action import Action, ActionState, BlockingType, InstantActions
from nena_shared.vda5050.base import Angle, Identifier, NotNegative
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.factsheet import (
    ActionParameterDescription,
    BatteryCharging,
    Factsheet,
    MobileRobotAction,
    MobileRobotConfiguration,
    OptionalParameter,
    ProtocolFeatures,
    TypeSpecification,
    ValueDataType,
)
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
from nena_shared.vda5050.request import EdgeRequest, RequestStatus, ZoneRequest
from nena_shared.vda5050.responses import GrantType, Response, Responses
from nena_shared.vda5050.state import EdgeState, NodeState, OperatingMode, PlannedPath, State
from nena_shared.vda5050.visualization import Visualization
from nena_shared.vda5050.wire_names import Absent, reads, writes
from nena_shared.vda5050.zone_set import (
    BidirectedLimitation,
    DirectedLimitation,
    Factor,
    Zone,
    ZoneAction,
    ZoneReleaseLossBehavior,
    ZoneSet,
    ZoneSetTransfer,
    ZoneType,
)

ActionTypeV30 = Annotated[Identifier, reads({"initPosition": "initializePosition"})]


class ActionV30(Action):
    """An action (section 7.3)."""

    action_type: ActionTypeV30


def _half_turn(theta: float) -> float:
    """Normalise the rotation of an ellipse to [-π/2, π/2]; half a turn changes nothing."""
    if abs(theta) <= pi / 2:
        return theta
    return theta - pi if theta > 0 else theta + pi


class AllowedDeviationXYV30(AllowedDeviationXY):
    """An ellipse around a node (section 7.3); theta is normalised to the schema's range."""

    theta: Annotated[Angle, PlainSerializer(_half_turn, return_type=float, when_used="json")] = 0.0


class NodePositionV30(NodePosition):
    """Position of a node (section 7.3)."""

    allowed_deviation_xy: Annotated[AllowedDeviationXYV30 | None, Field(alias="allowedDeviationXY")] = None


class NodeV30(Node):
    """A node of an order (section 7.3)."""

    node_position: NodePositionV30 | None = None
    actions: tuple[ActionV30, ...]


class ControlPointV30(ControlPoint):
    """A control point of a trajectory (section 7.3); a weight of 0 has no effect."""

    weight: Annotated[float, Field(gt=0)] | None = None


class TrajectoryV30(Trajectory):
    """A NURBS from the start to the end of an edge (section 7.3)."""

    control_points: tuple[ControlPointV30, ...]


class CorridorV30(Corridor):
    """Allowed deviation from a trajectory (section 7.3)."""

    # 2.x has no underscore
    corridor_reference_point: (
        Annotated[CorridorReferencePoint, reads({"KINEMATICCENTER": "KINEMATIC_CENTER"})] | None
    ) = None


class EdgeV30(Edge):
    """An edge (section 7.3); the schema has another name for the maximum rotation speed."""

    maximum_rotation_speed: Annotated[
        NotNegative | None, Field(validation_alias=AliasChoices("maximumRotationSpeed", "maxRotationSpeed"))
    ] = None
    trajectory: TrajectoryV30 | None = None
    corridor: CorridorV30 | None = None
    actions: tuple[ActionV30, ...]


class OrderV30(Order):
    """A graph of nodes and edges to drive (section 7.3)."""

    zone_set_id: Absent = None
    nodes: tuple[NodeV30, ...]
    edges: tuple[EdgeV30, ...]


class InstantActionV30(ActionV30):
    """An instant action; its blocking type is always NONE (section 6.2.1)."""

    blocking_type: Annotated[
        BlockingType,
        AfterValidator(lambda _: BlockingType.NONE),
        writes(dict.fromkeys(BlockingType, BlockingType.NONE), BlockingType),
    ]


class InstantActionsV30(InstantActions):
    """Actions to execute immediately (section 7.4)."""

    actions: tuple[InstantActionV30, ...]


RequestStatusV30 = Annotated[RequestStatus, writes({"QUEUED": "REQUESTED"}, RequestStatus)]
"""Section 6.9 has QUEUED, table and schema do not: accepted, but not sent to 3.0.0 fleet controls."""


class PositionOfNodeStateV30(NodePosition):
    """Position of a node (section 7.8); without the allowed deviation, which only orders contain."""

    allowed_deviation_xy: Absent = None
    allowed_deviation_theta: Absent = None


class NodeStateV30(NodeState):
    """A node that the robot has not traversed yet (section 7.8)."""

    node_position: PositionOfNodeStateV30 | None = None


class EdgeStateV30(EdgeState):
    """An edge that the robot has not left yet (section 7.8)."""

    trajectory: TrajectoryV30 | None = None


class PlannedPathV30(PlannedPath):
    """The robot's planned path, at least to the end of the base (section 7.8)."""

    trajectory: TrajectoryV30


class ActionStateV30(ActionState):
    """State of one action (section 6.6.9)."""

    action_type: ActionTypeV30 | None = None


class ZoneRequestV30(ZoneRequest):
    """A request about a zone (section 6.9)."""

    request_status: RequestStatusV30
    trajectory: TrajectoryV30 | None = None


class EdgeRequestV30(EdgeRequest):
    """A request about an edge of the order (section 6.9)."""

    request_status: RequestStatusV30


class ErrorEntryV30(ErrorEntry):
    """An active error (section 6.6.5); two types also have older names."""

    # 3.0.0 calls one type INVALID_ORDER in its text; drafts of 3.0.1 have HANDLING_RELEASE_LOSS
    error_type: Annotated[
        str,
        reads({"INVALID_ORDER": "INVALID_ORDER_ACTION", "HANDLING_RELEASE_LOSS": "RELEASE_LOSS_HANDLING"}),
    ]


class StateV30(State):
    """The complete state of the robot (section 7.8)."""

    zone_set_id: Absent = None
    node_states: tuple[NodeStateV30, ...]
    edge_states: tuple[EdgeStateV30, ...]
    planned_path: PlannedPathV30 | None = None
    zone_requests: tuple[ZoneRequestV30, ...] | None = None
    edge_requests: tuple[EdgeRequestV30, ...] | None = None
    action_states: tuple[ActionStateV30, ...]
    instant_action_states: tuple[ActionStateV30, ...]
    zone_action_states: tuple[ActionStateV30, ...] | None = None
    operating_mode: Annotated[OperatingMode, reads({"TEACHIN": "TEACH_IN"})]
    errors: tuple[ErrorEntryV30, ...]


class VisualizationV30(Visualization):
    """Position and planned path at a higher rate than the state (section 7.9)."""

    planned_path: PlannedPathV30 | None = None


class ConnectionV30(Connection):
    """State of a robot's MQTT connection (section 7.7); also accepts CONNECTIONBROKEN of 2.x."""

    connection_state: Annotated[ConnectionState, reads({"CONNECTIONBROKEN": "CONNECTION_BROKEN"})]


KINEMATICS = {"DIFF": "DIFFERENTIAL", "OMNI": "OMNIDIRECTIONAL", "THREEWHEEL": "THREE_WHEEL"}


class TypeSpecificationV30(TypeSpecification):
    """Class and navigation types (section 7.10); the schema of 3.0.0 requires a misspelt name."""

    mobile_robot_kinematics: Annotated[
        str,
        reads(KINEMATICS),
        Field(validation_alias=AliasChoices("mobileRobotKinematics", "mobileRobotKinematic")),
    ]
    navigation_types: tuple[Annotated[str, reads({"AUTONOMOUS": "FREELY_NAVIGATING"})], ...]


class ActionParameterDescriptionV30(ActionParameterDescription):
    """A parameter of an action (section 7.10)."""

    value_data_type: Annotated[ValueDataType, reads({"FLOAT": "NUMBER"})]


class MobileRobotActionV30(MobileRobotAction):
    """A supported action (section 7.10)."""

    action_type: ActionTypeV30
    action_parameters: tuple[ActionParameterDescriptionV30, ...] | None = None


def _right_name(path: str) -> str:
    """Replace a field name of the order's schema with that of the standard's text."""
    return path.replace("maxRotationSpeed", "maximumRotationSpeed")


class OptionalParameterV30(OptionalParameter):
    """An optional field of the order (section 7.10)."""

    parameter: Annotated[str, AfterValidator(_right_name)]


class ProtocolFeaturesV30(ProtocolFeatures):
    """Optional fields and actions (section 7.10)."""

    optional_parameters: tuple[OptionalParameterV30, ...]
    mobile_robot_actions: tuple[MobileRobotActionV30, ...]


def _whole_seconds(seconds: float) -> float:
    return float(ceil(seconds))  # up: a shorter charge would not reach the threshold


class BatteryChargingV30(BatteryCharging):
    """Charging thresholds (section 7.10); times are written in whole seconds, as 3.0.1 requires."""

    minimum_charging_time: (
        Annotated[NotNegative, PlainSerializer(_whole_seconds, return_type=float, when_used="json")] | None
    ) = None


class MobileRobotConfigurationV30(MobileRobotConfiguration):
    """Configuration of this robot (section 7.10); the schema of 3.0.0 has a name with a trailing space."""

    battery_charging: Annotated[
        BatteryChargingV30 | None,
        Field(validation_alias=AliasChoices("batteryCharging", "batteryCharging ")),
    ] = None


class FactsheetV30(Factsheet):
    """The factsheet (section 7.10)."""

    type_specification: TypeSpecificationV30
    protocol_features: ProtocolFeaturesV30
    mobile_robot_configuration: MobileRobotConfigurationV30 | None = None


def _of_zone_type(zone_type: ZoneType) -> BeforeValidator:
    """Accept a value only in zones of this type, because ``limitation`` can mean either of two fields."""

    def read(value: object, info: ValidationInfo) -> object:
        return value if info.data.get("zone_type") is zone_type else None

    return BeforeValidator(read)


class ZoneActionV30(ZoneAction):
    """An action that a zone triggers (section 7.6)."""

    action_type: ActionTypeV30


class ZoneV30(Zone):
    """An area of a map; RELEASE zones always contain releaseLossBehavior (section 7.5)."""

    entry_actions: tuple[ZoneActionV30, ...] | None = None
    during_actions: tuple[ZoneActionV30, ...] | None = None
    exit_actions: tuple[ZoneActionV30, ...] | None = None
    # the schema of 3.0.0 has keys with a blank at the end, and "limitation" for both limitations
    priority_factor: Annotated[
        Factor | None, Field(validation_alias=AliasChoices("priorityFactor", "priorityFactor "))
    ] = None
    penalty_factor: Annotated[
        Factor | None, Field(validation_alias=AliasChoices("penaltyFactor", "penaltyFactor "))
    ] = None

    directed_limitation: Annotated[
        DirectedLimitation | None,
        _of_zone_type(ZoneType.DIRECTED),
        Field(validation_alias=AliasChoices("directedLimitation", "limitation")),
    ] = None
    bidirected_limitation: Annotated[
        BidirectedLimitation | None,
        _of_zone_type(ZoneType.BIDIRECTED),
        Field(validation_alias=AliasChoices("bidirectedLimitation", "limitation")),
    ] = None

    @model_validator(mode="after")
    def _stops_without_release(self) -> Self:
        if self.zone_type is not ZoneType.RELEASE or self.release_loss_behavior:
            return self
        return self.model_copy(update={"release_loss_behavior": ZoneReleaseLossBehavior.STOP})


class ZoneSetV30(ZoneSet):
    """Zones of one map (section 7.6)."""

    zones: tuple[ZoneV30, ...]


class ZoneSetTransferV30(ZoneSetTransfer):
    """Transfer of a zone set to a robot (section 7.6)."""

    zone_set: ZoneSetV30


class ResponseV30(Response):
    """The answer to one request; section 6.4.3 calls its field by another name."""

    grant_type: Annotated[GrantType, Field(validation_alias=AliasChoices("grantType", "responseType"))]


class ResponsesV30(Responses):
    """Answers to the requests in a robot's state (section 7.5)."""

    responses: tuple[ResponseV30, ...]
