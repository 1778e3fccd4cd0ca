"""State, errors, visualization and connection of VDA 5050 2.1 (sections 6.10, 6.13 and 6.14)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Self

from pydantic import Field, ValidationInfo, field_serializer, model_validator
from pydantic.alias_generators import to_camel

from nena_shared.vda5050.base import Identifier, NotNegative, Percent, UInt32, Version, WireObject
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference, ErrorType
from nena_shared.vda5050.order import NodePosition
from nena_shared.vda5050.state import (
    EdgeState,
    EmergencyStop,
    Information,
    Map,
    MobileRobotPosition,
    NodeState,
    OperatingMode,
    PowerSupply,
    SafetyState,
    State,
)
from nena_shared.vda5050.v2_1.base import TimestampOrNow, TimestampV2
from nena_shared.vda5050.v2_1.order import ActionStateV21, TrajectoryV21
from nena_shared.vda5050.v2_1.parameter import neutral_path, written_path
from nena_shared.vda5050.visualization import Visualization
from nena_shared.vda5050.wire_names import Absent, always, reads, writes

REJECTIONS: Final[Mapping[str, str]] = {
    ErrorType.VALIDATION_FAILURE: "validationError",
    ErrorType.MOBILE_ROBOT_NOT_AVAILABLE: "orderError",
    ErrorType.INSUFFICIENT_MEMORY: "orderError",
    ErrorType.UNSUPPORTED_PARAMETER: "orderError",
    ErrorType.INVALID_ORDER_ACTION: "orderError",
    ErrorType.UNKNOWN_MAP_ID: "orderError",
    ErrorType.OTHER_ORDER_ACTIVE: "orderUpdateError",
    ErrorType.OUTDATED_ORDER_UPDATE: "orderUpdateError",
    ErrorType.ORDER_UPDATE_FOLLOWING_CANCEL: "orderUpdateError",
    ErrorType.SAME_ORDER_UPDATE_ID: "orderUpdateError",
    ErrorType.START_NODE_OUT_OF_RANGE: "noRouteError",
    ErrorType.NO_ROUTE_TO_TARGET: "noRouteError",
    ErrorType.NO_ORDER_TO_CANCEL: "noOrderToCancel",
    ErrorType.INVALID_INSTANT_ACTION: "instantActionError",
}
"""Errors that reject a message without affecting the robot, always WARNING in 2.x, by their names there."""

WRITTEN: Final[Mapping[str, str]] = {**{each: to_camel(each.lower()) for each in ErrorType}, **REJECTIONS}
"""Error types of 2.x by neutral error type."""


PARAMETER: Final = "parameter"
"""Reference key whose value is a parameter path."""


class ErrorReferenceV21(ErrorReference):
    """The subject of an error, with 2.x names of order parameters in key and value (2.1 section 7.1)."""

    @staticmethod
    def finish_record(record: Any) -> Mapping[str, object]:  # noqa: ANN401 - it has the fields of the form
        """Return the neutral names."""
        key, value = neutral_path(record.reference_key), record.reference_value
        return {"reference_key": key, "reference_value": neutral_path(value) if key == PARAMETER else value}

    @model_validator(mode="after")
    def _finish_reading(self, info: ValidationInfo) -> Self:
        return self.model_copy(update=self.finish_record(self)) if info.mode == "json" else self

    @field_serializer("reference_key", when_used="json")
    def _written_key(self, key: str) -> str:
        return written_path(key)

    @field_serializer("reference_value", when_used="json")
    def _written_value(self, value: str) -> str:
        return written_path(value) if self.reference_key == PARAMETER else value


class ErrorEntryV21(ErrorEntry):
    """An error (2.1 section 6.10.5); 2.1 has the levels WARNING and FATAL, and its own names."""

    error_level: Annotated[ErrorLevel, writes({"URGENT": "WARNING", "CRITICAL": "FATAL"}, ErrorLevel)]
    error_references: tuple[ErrorReferenceV21, ...] = ()
    error_description_translations: Absent = None
    error_hint_translations: Absent = None

    @classmethod
    def from_neutral(cls, neutral: WireObject) -> Self:
        """Convert to the 2.1 form: rejections are WARNING, errors that stop the robot are FATAL."""
        error = ErrorEntry.from_neutral(neutral)
        # 2.1, 6.10.5: with FATAL the robot needs a person, which no rejected message is a reason for
        mild = error.error_level in (ErrorLevel.WARNING, ErrorLevel.URGENT) or error.error_type in REJECTIONS
        changes = {
            "error_type": WRITTEN.get(error.error_type, error.error_type),
            "error_level": ErrorLevel.WARNING if mild else ErrorLevel.FATAL,
        }
        return super().from_neutral(error.model_copy(update=changes))


# 2.1, 6.10.6 has five modes. SERVICE takes no orders, as STARTUP. AUTOMATIC keeps the order, as INTERVENED
# (3.0, 6.6.7); that the robot does not go on by itself is said by ``paused``, see ``StateV21.from_neutral``.
OperatingModeV21 = Annotated[
    OperatingMode,
    reads({"TEACHIN": "TEACH_IN"}),
    writes({"TEACH_IN": "TEACHIN", "STARTUP": "SERVICE", "INTERVENED": "AUTOMATIC"}, OperatingMode),
]


class MapV21(Map):
    """A map on the robot (2.1 section 6.7)."""

    map_descriptor: Annotated[str | None, Field(alias="mapDescription")] = None


class PositionOfNodeStateV21(NodePosition):
    """Position of a node; without the allowed deviation, which only orders contain."""

    allowed_deviation_xy: Absent = None
    allowed_deviation_theta: Absent = None


class NodeStateV21(NodeState):
    """A node that the robot has not traversed yet (2.1 section 6.10.6)."""

    node_descriptor: Annotated[str | None, Field(alias="nodeDescription")] = None
    node_position: PositionOfNodeStateV21 | None = None


class EdgeStateV21(EdgeState):
    """An edge that the robot has not left yet (2.1 section 6.10.6)."""

    edge_descriptor: Annotated[str | None, Field(alias="edgeDescription")] = None
    trajectory: TrajectoryV21 | None = None


class MobileRobotPositionV21(MobileRobotPosition):
    """Position of the robot (2.1 section 6.10.6)."""

    localized: Annotated[bool, Field(alias="positionInitialized")]


class PowerSupplyV21(PowerSupply):
    """The battery (2.1 section 6.10.6)."""

    state_of_charge: Annotated[Percent, Field(alias="batteryCharge")]
    battery_current: Absent = None
    range: Annotated[NotNegative | None, Field(alias="reach")] = None


class SafetyStateV21(SafetyState):
    """Emergency stop and protective field (2.1 section 6.10.6); AUTOACK is a field violation in 3.0."""

    active_emergency_stop: Annotated[EmergencyStop, reads({"AUTOACK": "NONE"}), Field(alias="eStop")]

    @model_validator(mode="before")
    @classmethod
    def _self_acknowledged(cls, data: object) -> object:
        # 2.1: acknowledged by itself, once the field is free
        if isinstance(data, dict) and data.get("eStop") == "AUTOACK":
            return {**data, "fieldViolation": True}
        return data


class InformationV21(Information):
    """Information for people (2.1 section 6.10.6)."""

    info_descriptor: Annotated[str | None, Field(alias="infoDescription")] = None


class StateV21(State):
    """The state (2.1 section 6.10.6); actionStates also contains the instant actions."""

    timestamp: TimestampV2
    maps: tuple[MapV21, ...] | None = None
    zone_sets: Absent = None
    node_states: tuple[NodeStateV21, ...]
    edge_states: tuple[EdgeStateV21, ...]
    planned_path: Absent = None
    intermediate_path: Absent = None
    mobile_robot_position: Annotated[MobileRobotPositionV21 | None, Field(alias="agvPosition")] = None
    zone_requests: Absent = None
    edge_requests: Absent = None
    action_states: tuple[ActionStateV21, ...]
    # 2.1 has one list: only the sender of an action knows that it was an instant action
    instant_action_states: Annotated[tuple[ActionStateV21, ...], always(()), Field(exclude=True)] = ()
    zone_action_states: Absent = None
    power_supply: Annotated[PowerSupplyV21, Field(alias="batteryState")]
    operating_mode: OperatingModeV21
    errors: tuple[ErrorEntryV21, ...]
    information: tuple[InformationV21, ...] | None = None
    safety_state: SafetyStateV21

    @classmethod
    def from_neutral(cls, neutral: WireObject) -> Self:
        """Convert a state to its 2.1 form; INTERVENED is reported as paused."""
        state = State.from_neutral(neutral)
        changes = {
            "action_states": (*state.action_states, *state.instant_action_states),
            "errors": tuple(map(ErrorEntryV21.from_neutral, state.errors)),
            "paused": True if state.operating_mode is OperatingMode.INTERVENED else state.paused,
        }
        return super().from_neutral(state.model_copy(update=changes))


class VisualizationV21(Visualization):
    """Position and velocity (2.1 section 6.13); manufacturer and serial number may be missing."""

    header_id: UInt32 = 0
    timestamp: TimestampOrNow
    version: Version = "2.1.0"
    manufacturer: Identifier = ""
    serial_number: Identifier = ""
    # since 3.0, which requires it
    reference_state_header_id: Annotated[UInt32, always(0), Field(exclude=True)] = 0
    mobile_robot_position: Annotated[MobileRobotPositionV21 | None, Field(alias="agvPosition")] = None
    planned_path: Absent = None
    intermediate_path: Absent = None


ConnectionStateV21 = Annotated[
    ConnectionState,
    reads({"CONNECTIONBROKEN": "CONNECTION_BROKEN"}),
    writes({"CONNECTION_BROKEN": "CONNECTIONBROKEN", "HIBERNATING": "ONLINE"}, ConnectionState),
]


class ConnectionV21(Connection):
    """Connection state (2.1 section 6.14): CONNECTIONBROKEN; HIBERNATING is sent as ONLINE."""

    timestamp: TimestampV2
    connection_state: ConnectionStateV21
