"""VDA 5050 2.0: messages that differ from 2.1."""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

from pydantic import AliasChoices, Field, PlainSerializer

from nena_shared.vda5050.base import Percent, UInt32, Version, WireObject
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1.factsheet import (
    FactsheetV21,
    MaximumArrayLengthsV21,
    MobileRobotActionV21,
    PhysicalParametersV21,
    ProtocolFeaturesV21,
    ProtocolLimitsV21,
)
from nena_shared.vda5050.v2_1.order import ActionV21, CorridorV21, EdgeV21, NodeV21, OrderV21
from nena_shared.vda5050.v2_1.parameter import missing_names
from nena_shared.vda5050.v2_1.state import ErrorEntryV21, PowerSupplyV21, StateV21, VisualizationV21
from nena_shared.vda5050.wire_names import Absent


class EdgeV20(EdgeV21):
    """An edge (2.0 section 6.7); 2.0 has no corridors."""

    corridor: Absent = None


class OrderV20(OrderV21):
    """A graph of nodes and edges to drive (2.0 section 6.7)."""

    edges: tuple[EdgeV20, ...]


WholePercent = Annotated[Percent, PlainSerializer(round, return_type=int, when_used="json")]


class ErrorEntryV20(ErrorEntryV21):
    """An error (2.0 section 6.10.5); 2.0 has no hints."""

    error_hint: Absent = None


class PowerSupplyV20(PowerSupplyV21):
    """The battery (2.0 section 6.10.6); batteryHealth is an integer."""

    battery_health: WholePercent | None = None


class StateV20(StateV21):
    """The state of the robot (2.0 section 6.10.6); 2.0 has no maps."""

    maps: Absent = None
    errors: tuple[ErrorEntryV20, ...]
    power_supply: Annotated[PowerSupplyV20, Field(alias="batteryState")]

    @classmethod
    def from_neutral(cls, neutral: WireObject) -> Self:
        """Convert a state to its 2.0 form; drop node positions without theta, which 2.0 requires."""
        state = State.from_neutral(neutral)
        nodes = tuple(
            node
            if node.node_position is None or node.node_position.theta is not None
            else node.model_copy(update={"node_position": None})
            for node in state.node_states
        )
        return super().from_neutral(state.model_copy(update={"node_states": nodes}))


class VisualizationV20(VisualizationV21):
    """Position and velocity (2.0 section 6.12); the header may be missing."""

    version: Version = "2.0.0"


class PhysicalParametersV20(PhysicalParametersV21):
    """Speeds, accelerations and sizes (2.0 section 7)."""

    minimum_angular_speed: Absent = None
    maximum_angular_speed: Absent = None


class MaximumArrayLengthsV20(MaximumArrayLengthsV21):
    """Maximum array lengths (2.0 section 7); one array has another name in the text of the standard."""

    state_information: Annotated[
        UInt32 | None,
        Field(
            validation_alias=AliasChoices("state.information", "state.informations"),
            serialization_alias="state.information",
        ),
    ] = None
    information_references: Annotated[
        UInt32 | None,
        Field(
            validation_alias=AliasChoices("information.infoReferences", "informations.infoReferences"),
            serialization_alias="information.infoReferences",
        ),
    ] = None


class ProtocolLimitsV20(ProtocolLimitsV21):
    """Limits of messages (2.0 section 7)."""

    maximum_array_lengths: Annotated[MaximumArrayLengthsV20, Field(alias="maxArrayLens")]


class MobileRobotActionV20(MobileRobotActionV21):
    """A supported action (2.0 section 7); 2.0 has no blocking types here."""

    blocking_types: Absent = None


class ProtocolFeaturesV20(ProtocolFeaturesV21):
    """Optional fields and actions (2.0 section 7), without fields that 2.0 lacks."""

    missing: ClassVar[frozenset[str]] = missing_names(OrderV20, NodeV21, EdgeV20, CorridorV21, ActionV21)
    mobile_robot_actions: Annotated[tuple[MobileRobotActionV20, ...], Field(alias="agvActions")]


class FactsheetV20(FactsheetV21):
    """The factsheet (2.0 section 7)."""

    physical_parameters: PhysicalParametersV20
    protocol_limits: ProtocolLimitsV20
    protocol_features: ProtocolFeaturesV20
    mobile_robot_configuration: Absent = None
