"""The state message of 2.1 (section 6.10)."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from nena_shared.vda5050.base import NotNegative, Percent, WireObject
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
from nena_shared.vda5050.v2_1.action import ActionStateV21
from nena_shared.vda5050.v2_1.base import TimestampV2
from nena_shared.vda5050.v2_1.error import ErrorEntryV21
from nena_shared.vda5050.v2_1.trajectory import TrajectoryV21
from nena_shared.vda5050.wire_names import Absent, always, reads, writes

OperatingModeV21 = Annotated[
    OperatingMode,
    reads({"TEACHIN": "TEACH_IN"}),
    writes({"TEACH_IN": "TEACHIN", "STARTUP": "SERVICE", "INTERVENED": "AUTOMATIC"}, OperatingMode),
]


class MapV21(Map):
    """A map that the robot holds."""

    map_descriptor: Annotated[str | None, Field(alias="mapDescription")] = None


class PositionOfNodeStateV21(NodePosition):
    """Where a node is; how near the robot must come stands in the order alone."""

    allowed_deviation_xy: Absent = None
    allowed_deviation_theta: Absent = None


class NodeStateV21(NodeState):
    """A node that is still to be traversed."""

    node_descriptor: Annotated[str | None, Field(alias="nodeDescription")] = None
    node_position: PositionOfNodeStateV21 | None = None


class EdgeStateV21(EdgeState):
    """An edge that is still to be driven to its end."""

    edge_descriptor: Annotated[str | None, Field(alias="edgeDescription")] = None
    trajectory: TrajectoryV21 | None = None


class MobileRobotPositionV21(MobileRobotPosition):
    """Where the robot is."""

    localized: Annotated[bool, Field(alias="positionInitialized")]


class PowerSupplyV21(PowerSupply):
    """The battery."""

    state_of_charge: Annotated[Percent, Field(alias="batteryCharge")]
    battery_current: Absent = None
    range: Annotated[NotNegative | None, Field(alias="reach")] = None


class SafetyStateV21(SafetyState):
    """Emergency stop and protective field; a stop that acknowledges itself is a field violation in 3.0."""

    active_emergency_stop: Annotated[EmergencyStop, reads({"AUTOACK": "NONE"}), Field(alias="eStop")]

    @model_validator(mode="before")
    @classmethod
    def _self_acknowledged(cls, data: object) -> object:
        if isinstance(data, dict) and data.get("eStop") == "AUTOACK":
            return {**data, "fieldViolation": True}
        return data


class InformationV21(Information):
    """A remark for people."""

    info_descriptor: Annotated[str | None, Field(alias="infoDescription")] = None


class StateV21(State):
    """Everything about the robot; the states of instant actions stand among those of the order's actions."""

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
    instant_action_states: Annotated[tuple[ActionStateV21, ...], always(()), Field(exclude=True)] = ()
    zone_action_states: Absent = None
    power_supply: Annotated[PowerSupplyV21, Field(alias="batteryState")]
    operating_mode: OperatingModeV21
    errors: tuple[ErrorEntryV21, ...]
    information: tuple[InformationV21, ...] | None = None
    safety_state: SafetyStateV21

    @classmethod
    def from_neutral(cls, neutral: WireObject) -> Self:
        """Make the 2.1 form of a state; while a person intervenes, fleet control sees a pause."""
        state = State.model_validate(neutral, by_name=True, by_alias=False)
        return cls.model_validate(
            state.model_copy(
                update={
                    "action_states": (*state.action_states, *state.instant_action_states),
                    "errors": tuple(ErrorEntryV21.from_neutral(each) for each in state.errors),
                    "paused": True if state.operating_mode is OperatingMode.INTERVENED else state.paused,
                }
            ),
            by_name=True,
            by_alias=False,
        )
