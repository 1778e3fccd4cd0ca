"""The factsheet message of 2.0 (section 7)."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import AliasChoices, Field

from nena_shared.vda5050.base import UInt32
from nena_shared.vda5050.v2_0.order import EdgeV20, OrderV20
from nena_shared.vda5050.v2_1.action import ActionV21
from nena_shared.vda5050.v2_1.factsheet import (
    FactsheetV21,
    MaximumArrayLengthsV21,
    MobileRobotActionV21,
    PhysicalParametersV21,
    ProtocolFeaturesV21,
    ProtocolLimitsV21,
)
from nena_shared.vda5050.v2_1.order import CorridorV21, NodeV21
from nena_shared.vda5050.v2_1.parameter import missing_names
from nena_shared.vda5050.wire_names import Absent


class PhysicalParametersV20(PhysicalParametersV21):
    """Speeds, accelerations and sizes."""

    minimum_angular_speed: Absent = None
    maximum_angular_speed: Absent = None


class MaximumArrayLengthsV20(MaximumArrayLengthsV21):
    """Most entries per array; the text has another name for one of the arrays."""

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
    """What messages must keep to."""

    maximum_array_lengths: Annotated[MaximumArrayLengthsV20, Field(alias="maxArrayLens")]


class MobileRobotActionV20(MobileRobotActionV21):
    """An action that the robot can do; 2.0 does not say how it may block."""

    blocking_types: Absent = None


class ProtocolFeaturesV20(ProtocolFeaturesV21):
    """Optional fields and actions; fields that 2.0 does not have are not told."""

    missing: ClassVar[frozenset[str]] = missing_names(OrderV20, NodeV21, EdgeV20, CorridorV21, ActionV21)
    mobile_robot_actions: Annotated[tuple[MobileRobotActionV20, ...], Field(alias="agvActions")]


class FactsheetV20(FactsheetV21):
    """What a robot is and can do."""

    physical_parameters: PhysicalParametersV20
    protocol_limits: ProtocolLimitsV20
    protocol_features: ProtocolFeaturesV20
    mobile_robot_configuration: Absent = None
