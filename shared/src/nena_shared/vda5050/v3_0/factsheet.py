"""The factsheet message of 3.0 (section 7.10), whose schema misspells some names."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, AliasChoices, Field

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
from nena_shared.vda5050.v3_0.action import ActionTypeV30
from nena_shared.vda5050.wire_names import reads

KINEMATICS = {"DIFF": "DIFFERENTIAL", "OMNI": "OMNIDIRECTIONAL", "THREEWHEEL": "THREE_WHEEL"}


class TypeSpecificationV30(TypeSpecification):
    """The robot's class and how it finds its way; the schema of 3.0.0 demands a misspelt name."""

    mobile_robot_kinematics: Annotated[
        str,
        reads(KINEMATICS),
        Field(validation_alias=AliasChoices("mobileRobotKinematics", "mobileRobotKinematic")),
    ]
    navigation_types: tuple[Annotated[str, reads({"AUTONOMOUS": "FREELY_NAVIGATING"})], ...]


class ActionParameterDescriptionV30(ActionParameterDescription):
    """A parameter that an action takes."""

    value_data_type: Annotated[ValueDataType, reads({"FLOAT": "NUMBER"})]


class MobileRobotActionV30(MobileRobotAction):
    """An action that the robot can do."""

    action_type: ActionTypeV30
    action_parameters: tuple[ActionParameterDescriptionV30, ...] | None = None


def _right_name(path: str) -> str:
    """Return the name of the text for the one that the order's schema has."""
    return path.replace("maxRotationSpeed", "maximumRotationSpeed")


class OptionalParameterV30(OptionalParameter):
    """An optional field of the order."""

    parameter: Annotated[str, AfterValidator(_right_name)]


class ProtocolFeaturesV30(ProtocolFeatures):
    """Optional fields and actions."""

    optional_parameters: tuple[OptionalParameterV30, ...]
    mobile_robot_actions: tuple[MobileRobotActionV30, ...]


class MobileRobotConfigurationV30(MobileRobotConfiguration):
    """How this very robot is set up; the schema of 3.0.0 has a blank behind one name."""

    battery_charging: Annotated[
        BatteryCharging | None, Field(validation_alias=AliasChoices("batteryCharging", "batteryCharging "))
    ] = None


class FactsheetV30(Factsheet):
    """What a robot is and can do."""

    type_specification: TypeSpecificationV30
    protocol_features: ProtocolFeaturesV30
    mobile_robot_configuration: MobileRobotConfigurationV30 | None = None
