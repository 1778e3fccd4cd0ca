"""The factsheet message (VDA 5050 3.0 sections 6.10 and 7.10): a robot's type and abilities."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import ConfigDict, Field

from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.base import Angle, Header, JsonObject, NotNegative, Percent, UInt32, WireObject
from nena_shared.vda5050.state import BoundingBoxReference, LoadDimensions
from nena_shared.vda5050.zone_set import ZoneType


class Support(StrEnum):
    """How a robot supports an optional field of the order (section 7.10)."""

    SUPPORTED = "SUPPORTED"
    REQUIRED = "REQUIRED"


class ActionScope(StrEnum):
    """Where an action may be used (section 7.10)."""

    INSTANT = "INSTANT"
    NODE = "NODE"
    EDGE = "EDGE"
    ZONE = "ZONE"


class ValueDataType(StrEnum):
    """Type of a parameter's value (section 7.10)."""

    BOOL = "BOOL"
    NUMBER = "NUMBER"
    INTEGER = "INTEGER"
    STRING = "STRING"
    OBJECT = "OBJECT"
    ARRAY = "ARRAY"


class TypeSpecification(WireObject):
    """Kinematics, class, navigation types and maximum load (kg); the lists are open (section 7.10)."""

    series_name: str
    series_description: str | None = None
    mobile_robot_kinematics: str
    mobile_robot_class: str
    maximum_load_mass: NotNegative
    localization_types: tuple[str, ...]
    navigation_types: tuple[str, ...]
    supported_zones: tuple[ZoneType, ...] | None = None


class PhysicalParameters(WireObject):
    """Speeds in m/s and rad/s, accelerations in m/s², sizes in m (section 7.10)."""

    minimum_speed: NotNegative
    maximum_speed: NotNegative
    minimum_angular_speed: NotNegative | None = None
    maximum_angular_speed: NotNegative | None = None
    maximum_acceleration: NotNegative
    maximum_deceleration: float
    minimum_height: NotNegative
    maximum_height: NotNegative
    width: NotNegative
    length: NotNegative


class MaximumStringLengths(WireObject):
    """Maximum string lengths, characters; absent or 0: no limit (section 7.10)."""

    maximum_message_length: UInt32 | None = None
    maximum_topic_serial_length: UInt32 | None = None
    maximum_topic_element_length: UInt32 | None = None
    maximum_id_length: UInt32 | None = None
    id_numerical_only: bool | None = None
    maximum_load_id_length: UInt32 | None = None


class MaximumArrayLengths(WireObject):
    """Maximum array lengths; absent or 0: no limit. Names on the wire contain dots (section 7.10)."""

    model_config = ConfigDict(alias_generator=None)

    order_nodes: Annotated[UInt32 | None, Field(alias="order.nodes")] = None
    order_edges: Annotated[UInt32 | None, Field(alias="order.edges")] = None
    node_actions: Annotated[UInt32 | None, Field(alias="node.actions")] = None
    edge_actions: Annotated[UInt32 | None, Field(alias="edge.actions")] = None
    action_parameters: Annotated[UInt32 | None, Field(alias="actions.actionsParameters")] = None
    instant_actions: Annotated[UInt32 | None, Field(alias="instantActions")] = None
    trajectory_knot_vector: Annotated[UInt32 | None, Field(alias="trajectory.knotVector")] = None
    trajectory_control_points: Annotated[UInt32 | None, Field(alias="trajectory.controlPoints")] = None
    zone_set_zones: Annotated[UInt32 | None, Field(alias="zoneSet.zones")] = None
    state_node_states: Annotated[UInt32 | None, Field(alias="state.nodeStates")] = None
    state_edge_states: Annotated[UInt32 | None, Field(alias="state.edgeStates")] = None
    state_loads: Annotated[UInt32 | None, Field(alias="state.loads")] = None
    state_action_states: Annotated[UInt32 | None, Field(alias="state.actionStates")] = None
    state_instant_action_states: Annotated[UInt32 | None, Field(alias="state.instantActionStates")] = None
    state_zone_action_states: Annotated[UInt32 | None, Field(alias="state.zoneActionStates")] = None
    state_errors: Annotated[UInt32 | None, Field(alias="state.errors")] = None
    state_information: Annotated[UInt32 | None, Field(alias="state.information")] = None
    error_references: Annotated[UInt32 | None, Field(alias="error.errorReferences")] = None
    information_references: Annotated[UInt32 | None, Field(alias="information.infoReferences")] = None


class Timing(WireObject):
    """Intervals between messages, seconds (section 7.10)."""

    minimum_order_interval: NotNegative
    minimum_state_interval: NotNegative
    default_state_interval: NotNegative | None = None
    visualization_interval: NotNegative | None = None


class ProtocolLimits(WireObject):
    """Limits of messages to and from the robot (section 7.10)."""

    maximum_string_lengths: MaximumStringLengths
    maximum_array_lengths: MaximumArrayLengths
    timing: Timing


class OptionalParameter(WireObject):
    """A supported optional field, by its full dotted path (section 7.10)."""

    parameter: str
    support: Support
    description: str | None = None


class ActionParameterDescription(WireObject):
    """A parameter of an action (section 7.10)."""

    key: str
    value_data_type: ValueDataType
    description: str | None = None
    is_optional: bool | None = None


class MobileRobotAction(WireObject):
    """An action that the robot supports (section 7.10)."""

    action_type: str
    action_description: str | None = None
    action_scopes: tuple[ActionScope, ...]
    action_parameters: tuple[ActionParameterDescription, ...] | None = None
    action_result: str | None = None
    blocking_types: tuple[BlockingType, ...] | None = None
    pause_allowed: bool
    cancel_allowed: bool


class ProtocolFeatures(WireObject):
    """Supported optional fields and actions; anything not listed is unsupported (section 7.10)."""

    optional_parameters: tuple[OptionalParameter, ...]
    mobile_robot_actions: tuple[MobileRobotAction, ...]


class Envelope2dPoint(WireObject):
    """A corner of the footprint, m in the robot's frame (section 7.10)."""

    x: float
    y: float


class Envelope2d(WireObject):
    """A footprint (section 7.10)."""

    envelope2d_id: Annotated[str, Field(alias="envelope2dId")]
    vertices: tuple[Envelope2dPoint, ...]
    description: str | None = None


class Envelope3d(WireObject):
    """A 3D envelope in the manufacturer's format, inline or by URL (section 7.10)."""

    envelope3d_id: Annotated[str, Field(alias="envelope3dId")]
    format: str
    data: JsonObject | None = None
    url: str | None = None
    description: str | None = None


class WheelPosition(WireObject):
    """Position of a wheel, m and rad in the robot's frame (section 7.10)."""

    x: float
    y: float
    theta: Angle | None = None


class WheelDefinition(WireObject):
    """A wheel, m (section 7.10)."""

    type: str
    is_active_driven: bool
    is_active_steered: bool
    position: WheelPosition
    diameter: NotNegative
    width: NotNegative
    center_displacement: float | None = None
    constraints: str | None = None


class MobileRobotGeometry(WireObject):
    """The robot's outline and wheels (section 7.10)."""

    wheel_definitions: tuple[WheelDefinition, ...] | None = None
    envelopes2d: Annotated[tuple[Envelope2d, ...] | None, Field(alias="envelopes2d")] = None
    envelopes3d: Annotated[tuple[Envelope3d, ...] | None, Field(alias="envelopes3d")] = None


class LoadSet(WireObject):
    """A kind of load, and the limits that apply with it: kg, m, rad, m/s, m/s², s (section 7.10)."""

    set_name: str
    load_type: str
    load_positions: tuple[str, ...] | None = None
    bounding_box_reference: BoundingBoxReference | None = None
    load_dimensions: LoadDimensions | None = None
    maximum_weight: NotNegative | None = None
    minimum_loadhandling_height: NotNegative | None = None
    maximum_loadhandling_height: NotNegative | None = None
    minimum_loadhandling_depth: float | None = None
    maximum_loadhandling_depth: float | None = None
    minimum_loadhandling_tilt: float | None = None
    maximum_loadhandling_tilt: float | None = None
    maximum_speed: NotNegative | None = None
    maximum_acceleration: NotNegative | None = None
    maximum_deceleration: float | None = None
    pick_time: NotNegative | None = None
    drop_time: NotNegative | None = None
    description: str | None = None


class LoadSpecification(WireObject):
    """Load handling: load positions and load sets; without positions it carries nothing (section 7.10)."""

    load_positions: tuple[str, ...] | None = None
    load_sets: tuple[LoadSet, ...] | None = None


class VersionEntry(WireObject):
    """Version of a hardware or software component (section 7.10)."""

    key: str
    value: str


class Network(WireObject):
    """Network configuration of the robot (section 7.10)."""

    dns_servers: tuple[str, ...] | None = None
    ntp_servers: tuple[str, ...] | None = None
    local_ip_address: str | None = None
    netmask: str | None = None
    default_gateway: str | None = None


class BatteryCharging(WireObject):
    """Charging thresholds, percent, and the minimum charging time, s (section 7.10)."""

    critical_low_charging_level: Percent | None = None
    minimum_desired_charging_level: Percent | None = None
    maximum_desired_charging_level: Percent | None = None
    minimum_charging_time: NotNegative | None = None


class MobileRobotConfiguration(WireObject):
    """Configuration of this individual robot (section 7.10)."""

    versions: tuple[VersionEntry, ...] | None = None
    network: Network | None = None
    battery_charging: BatteryCharging | None = None


class Factsheet(Header):
    """The factsheet; retained, sent on each connect and on factsheetRequest (section 7.10)."""

    type_specification: TypeSpecification
    physical_parameters: PhysicalParameters
    protocol_limits: ProtocolLimits
    protocol_features: ProtocolFeatures
    mobile_robot_geometry: MobileRobotGeometry
    load_specification: LoadSpecification
    mobile_robot_configuration: MobileRobotConfiguration | None = None
