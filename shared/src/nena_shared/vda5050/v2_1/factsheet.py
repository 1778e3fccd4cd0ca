"""The factsheet message of 2.1 (section 6.15)."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, PlainSerializer, ValidationInfo, field_serializer, model_validator

from nena_shared.vda5050.base import NotNegative, UInt32, WireObject
from nena_shared.vda5050.factsheet import (
    ActionParameterDescription,
    ActionScope,
    Envelope2d,
    Envelope2dPoint,
    Envelope3d,
    Factsheet,
    LoadSet,
    LoadSpecification,
    MaximumArrayLengths,
    MaximumStringLengths,
    MobileRobotAction,
    MobileRobotConfiguration,
    MobileRobotGeometry,
    OptionalParameter,
    PhysicalParameters,
    ProtocolFeatures,
    ProtocolLimits,
    Timing,
    TypeSpecification,
    ValueDataType,
)
from nena_shared.vda5050.v2_1.base import TimestampOrNow
from nena_shared.vda5050.v2_1.order import (
    CANCELLED_ORDER,
    TRIGGER,
    ActionTypeV21,
    ActionV21,
    BlockingTypeV21,
    CorridorV21,
    EdgeV21,
    NodeV21,
    OrderV21,
)
from nena_shared.vda5050.v2_1.parameter import has_segment_in, missing_names, neutral_path, written_path
from nena_shared.vda5050.wire_names import Absent, always, reads, writes

KINEMATICS = {"DIFF": "DIFFERENTIAL", "OMNI": "OMNIDIRECTIONAL", "THREEWHEEL": "THREE_WHEEL"}


class TypeSpecificationV21(TypeSpecification):
    """The robot's class (2.1 section 6.15)."""

    mobile_robot_kinematics: Annotated[
        str,
        reads(KINEMATICS),
        writes({neutral: name for name, neutral in KINEMATICS.items()}),
        Field(alias="agvKinematic"),
    ]
    mobile_robot_class: Annotated[str, Field(alias="agvClass")]
    maximum_load_mass: Annotated[NotNegative, Field(alias="maxLoadMass")]
    navigation_types: tuple[
        Annotated[
            str, reads({"AUTONOMOUS": "FREELY_NAVIGATING"}), writes({"FREELY_NAVIGATING": "AUTONOMOUS"})
        ],
        ...,
    ]
    supported_zones: Absent = None


class PhysicalParametersV21(PhysicalParameters):
    """Speeds, accelerations and sizes (2.1 section 6.15)."""

    minimum_speed: Annotated[NotNegative, Field(alias="speedMin")]
    maximum_speed: Annotated[NotNegative, Field(alias="speedMax")]
    minimum_angular_speed: Annotated[NotNegative | None, Field(alias="angularSpeedMin")] = None
    maximum_angular_speed: Annotated[NotNegative | None, Field(alias="angularSpeedMax")] = None
    maximum_acceleration: Annotated[NotNegative, Field(alias="accelerationMax")]
    maximum_deceleration: Annotated[float, Field(alias="decelerationMax")]
    minimum_height: Annotated[NotNegative, Field(alias="heightMin")] = 0.0
    maximum_height: Annotated[NotNegative, Field(alias="heightMax")]


class MaximumStringLengthsV21(MaximumStringLengths):
    """Maximum string lengths, characters (2.1 section 6.15)."""

    maximum_message_length: Annotated[UInt32 | None, Field(alias="msgLen")] = None
    maximum_topic_serial_length: Annotated[UInt32 | None, Field(alias="topicSerialLen")] = None
    maximum_topic_element_length: Annotated[UInt32 | None, Field(alias="topicElemLen")] = None
    maximum_id_length: Annotated[UInt32 | None, Field(alias="idLen")] = None
    maximum_load_id_length: Annotated[UInt32 | None, Field(alias="loadIdLen")] = None


class MaximumArrayLengthsV21(MaximumArrayLengths):
    """Maximum array lengths (2.1 section 6.15)."""

    zone_set_zones: Absent = None
    state_instant_action_states: Absent = None
    state_zone_action_states: Absent = None


class TimingV21(Timing):
    """Intervals between messages, seconds (2.1 section 6.15)."""

    minimum_order_interval: Annotated[NotNegative, Field(alias="minOrderInterval")]
    minimum_state_interval: Annotated[NotNegative, Field(alias="minStateInterval")]


class ProtocolLimitsV21(ProtocolLimits):
    """Limits of messages (2.1 section 6.15)."""

    maximum_string_lengths: Annotated[MaximumStringLengthsV21, Field(alias="maxStringLens")]
    maximum_array_lengths: Annotated[MaximumArrayLengthsV21, Field(alias="maxArrayLens")]
    timing: TimingV21


class ActionParameterDescriptionV21(ActionParameterDescription):
    """A parameter of an action; FLOAT is read as NUMBER (2.1 section 6.15)."""

    value_data_type: Annotated[ValueDataType, reads({"FLOAT": "NUMBER"})]


# 2.1 has no zones; an action that is possible elsewhere, too, is still worth listing
ScopeV21 = Literal["INSTANT", "NODE", "EDGE"]


def _without_zones(scopes: tuple[ActionScope, ...]) -> list[str]:
    return [str(scope) for scope in scopes if scope is not ActionScope.ZONE]


class MobileRobotActionV21(MobileRobotAction):
    """A supported action; 2.1 has no fields for pausing and cancelling (2.1 section 6.15)."""

    action_type: ActionTypeV21
    action_scopes: Annotated[
        tuple[ActionScope, ...], PlainSerializer(_without_zones, return_type=list[ScopeV21], when_used="json")
    ]
    action_parameters: tuple[ActionParameterDescriptionV21, ...] | None = None
    action_result: Annotated[str | None, Field(alias="resultDescription")] = None
    blocking_types: tuple[BlockingTypeV21, ...] | None = None
    pause_allowed: Annotated[bool, always(value=False), Field(exclude=True)] = False
    cancel_allowed: Annotated[bool, always(value=False), Field(exclude=True)] = False

    @model_validator(mode="after")
    def _read_trigger(self, info: ValidationInfo) -> Self:
        if info.mode != "json" or not self.action_parameters:
            return self
        parameters = tuple(
            self._with_type(parameter, ValueDataType.STRING, ValueDataType.ARRAY)
            for parameter in self.action_parameters
        )
        return self.model_copy(update={"action_parameters": parameters})

    @field_serializer("action_parameters", when_used="json")
    def _written_parameters(
        self, parameters: tuple[ActionParameterDescriptionV21, ...] | None
    ) -> tuple[ActionParameterDescriptionV21, ...] | None:
        return parameters and tuple(
            self._with_type(parameter, ValueDataType.ARRAY, ValueDataType.STRING)
            for parameter in parameters
            if (self.action_type, parameter.key) != CANCELLED_ORDER
        )

    def _with_type(
        self, parameter: ActionParameterDescriptionV21, old: ValueDataType, new: ValueDataType
    ) -> ActionParameterDescriptionV21:
        """Return ``parameter`` with this version's type of the trigger parameter."""
        if (self.action_type, parameter.key) != TRIGGER or parameter.value_data_type is not old:
            return parameter
        return parameter.model_copy(update={"value_data_type": new})


def _neutral_name(path: str, info: ValidationInfo) -> str:
    return neutral_path(path) if info.mode == "json" else path


class OptionalParameterV21(OptionalParameter):
    """An optional field of the order, by its 2.x path (2.1 section 6.15)."""

    parameter: Annotated[
        str,
        AfterValidator(_neutral_name),
        PlainSerializer(written_path, return_type=str, when_used="json"),
    ]


class ProtocolFeaturesV21(ProtocolFeatures):
    """Optional fields and actions (2.1 section 6.15), without fields that 2.1 lacks."""

    missing: ClassVar[frozenset[str]] = missing_names(OrderV21, NodeV21, EdgeV21, CorridorV21, ActionV21)
    optional_parameters: tuple[OptionalParameterV21, ...]
    mobile_robot_actions: Annotated[tuple[MobileRobotActionV21, ...], Field(alias="agvActions")]

    @field_serializer("optional_parameters", when_used="json")
    def _known_parameters(
        self, parameters: tuple[OptionalParameterV21, ...]
    ) -> tuple[OptionalParameterV21, ...]:
        return tuple(
            parameter for parameter in parameters if not has_segment_in(self.missing, parameter.parameter)
        )


class Envelope3dV21(Envelope3d):
    """A 3D envelope (2.1 section 6.15)."""

    envelope3d_id: Annotated[str, Field(alias="set")]


class Envelope2dV21(Envelope2d):
    """A footprint (2.1 section 6.15)."""

    envelope2d_id: Annotated[str, Field(alias="set")]
    vertices: Annotated[tuple[Envelope2dPoint, ...], Field(alias="polygonPoints")]


class MobileRobotGeometryV21(MobileRobotGeometry):
    """The robot's outline and wheels (2.1 section 6.15)."""

    envelopes2d: Annotated[tuple[Envelope2dV21, ...] | None, Field(alias="envelopes2d")] = None
    envelopes3d: Annotated[tuple[Envelope3dV21, ...] | None, Field(alias="envelopes3d")] = None


class LoadSetV21(LoadSet):
    """A kind of load (2.1 section 6.15)."""

    maximum_weight: Annotated[NotNegative | None, Field(alias="maxWeight")] = None
    minimum_loadhandling_height: Annotated[NotNegative | None, Field(alias="minLoadhandlingHeight")] = None
    maximum_loadhandling_height: Annotated[NotNegative | None, Field(alias="maxLoadhandlingHeight")] = None
    minimum_loadhandling_depth: Annotated[float | None, Field(alias="minLoadhandlingDepth")] = None
    maximum_loadhandling_depth: Annotated[float | None, Field(alias="maxLoadhandlingDepth")] = None
    minimum_loadhandling_tilt: Annotated[float | None, Field(alias="minLoadhandlingTilt")] = None
    maximum_loadhandling_tilt: Annotated[float | None, Field(alias="maxLoadhandlingTilt")] = None
    maximum_speed: Annotated[NotNegative | None, Field(alias="agvSpeedLimit")] = None
    maximum_acceleration: Annotated[NotNegative | None, Field(alias="agvAccelerationLimit")] = None
    maximum_deceleration: Annotated[float | None, Field(alias="agvDecelerationLimit")] = None


class LoadSpecificationV21(LoadSpecification):
    """Load handling (2.1 section 6.15)."""

    load_sets: tuple[LoadSetV21, ...] | None = None


class MobileRobotConfigurationV21(MobileRobotConfiguration):
    """Configuration of this robot (2.1 section 6.15)."""

    battery_charging: Absent = None


class FactsheetV21(Factsheet):
    """The factsheet (2.1 section 6.15); blockingTypes are read, but not written.

    The schema of 2.1.0 compares this list with a string, so fleet controls that validate messages reject
    every factsheet that contains it.
    """

    header_id: UInt32 = 0
    timestamp: TimestampOrNow
    type_specification: TypeSpecificationV21
    physical_parameters: PhysicalParametersV21
    protocol_limits: ProtocolLimitsV21
    protocol_features: ProtocolFeaturesV21
    mobile_robot_geometry: Annotated[MobileRobotGeometryV21, Field(alias="agvGeometry")]
    load_specification: LoadSpecificationV21
    mobile_robot_configuration: Annotated[
        MobileRobotConfigurationV21 | None, Field(alias="vehicleConfig")
    ] = None

    @classmethod
    def from_neutral(cls, neutral: WireObject) -> Self:
        """Convert a factsheet to its 2.1 form."""
        factsheet = Factsheet.from_neutral(neutral)
        features = factsheet.protocol_features
        actions = tuple(
            action.model_copy(update={"blocking_types": None}) for action in features.mobile_robot_actions
        )
        features = features.model_copy(update={"mobile_robot_actions": actions})
        factsheet = factsheet.model_copy(update={"protocol_features": features})
        return super().from_neutral(factsheet)
