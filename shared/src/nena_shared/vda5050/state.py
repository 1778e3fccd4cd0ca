"""The state message (VDA 5050 3.0 sections 6.6 and 7.8)."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import Field

from nena_shared.vda5050.action import ActionState
from nena_shared.vda5050.base import (
    Angle,
    Header,
    Identifier,
    NotNegative,
    Percent,
    Timestamp,
    UInt32,
    WireObject,
)
from nena_shared.vda5050.error import ErrorEntry, ErrorReference
from nena_shared.vda5050.order import NodePosition, Trajectory
from nena_shared.vda5050.request import EdgeRequest, ZoneRequest


class OperatingMode(StrEnum):
    """Who is in control of a robot (section 6.6.6)."""

    STARTUP = "STARTUP"
    AUTOMATIC = "AUTOMATIC"
    SEMIAUTOMATIC = "SEMIAUTOMATIC"
    INTERVENED = "INTERVENED"
    MANUAL = "MANUAL"
    SERVICE = "SERVICE"
    TEACH_IN = "TEACH_IN"

    @property
    def takes_orders(self) -> bool:
        """Return whether fleet control may send orders in this mode (section 6.6.6)."""
        # INTERVENED: a person moves the robot, which keeps its order and runs new ones later
        return self in (OperatingMode.AUTOMATIC, OperatingMode.SEMIAUTOMATIC, OperatingMode.INTERVENED)

    @property
    def fleet_controls(self) -> bool:
        """Return whether fleet control moves the robot in this mode (section 6.6.6)."""
        return self in (OperatingMode.AUTOMATIC, OperatingMode.SEMIAUTOMATIC)

    @property
    def clears_order(self) -> bool:
        """Return whether a robot drops its order in this mode (section 6.6.7)."""
        return not self.takes_orders


class EmergencyStop(StrEnum):
    """Whether an emergency stop is active, and how it is acknowledged (section 7.8)."""

    MANUAL = "MANUAL"
    REMOTE = "REMOTE"
    NONE = "NONE"


class InfoLevel(StrEnum):
    """Audience of an information entry (section 7.8)."""

    DEBUG = "DEBUG"
    INFO = "INFO"


class MapStatus(StrEnum):
    """Whether a map is in use (section 7.8)."""

    ENABLED = "ENABLED"
    DISABLED = "DISABLED"


class Map(WireObject):
    """A map on the robot (section 7.8)."""

    map_id: Identifier
    map_version: str
    map_descriptor: str | None = None
    map_status: MapStatus


class RobotZoneSetStatus(StrEnum):
    """Whether a zone set is in use: zoneSetStatus (section 7.8)."""

    ENABLED = "ENABLED"
    DISABLED = "DISABLED"


class ZoneSetState(WireObject):
    """A zone set on the robot; at most one per map is ENABLED (section 7.8)."""

    zone_set_id: Identifier
    map_id: Identifier
    zone_set_status: RobotZoneSetStatus


class NodeState(WireObject):
    """A node that the robot has not traversed yet (section 6.6.2)."""

    node_id: Identifier
    sequence_id: UInt32
    node_descriptor: str | None = None
    released: bool
    node_position: NodePosition | None = None


class EdgeState(WireObject):
    """An edge that the robot has not left yet (section 6.6.2)."""

    edge_id: Identifier
    sequence_id: UInt32
    edge_descriptor: str | None = None
    released: bool
    trajectory: Trajectory | None = None


class MobileRobotPosition(WireObject):
    """Position of the robot, m and rad in the map frame; unreliable unless ``localized`` (section 7.8)."""

    x: float
    y: float
    theta: Angle
    map_id: Identifier
    localized: bool
    localization_score: Annotated[float, Field(ge=0, le=1)] | None = None
    deviation_range: NotNegative | None = None


class Velocity(WireObject):
    """Velocity in the robot's frame, m/s and rad/s (section 7.8)."""

    vx: float | None = None
    vy: float | None = None
    omega: float | None = None


class BoundingBoxReference(WireObject):
    """Reference point of a load's bounding box, m and rad in the robot's frame (section 7.8)."""

    x: float
    y: float
    z: float
    theta: Angle | None = None


class LoadDimensions(WireObject):
    """Size of a load, m (section 7.8)."""

    length: NotNegative
    width: NotNegative
    height: NotNegative | None = None


class Load(WireObject):
    """A load on the robot; weight in kg (section 7.8)."""

    load_id: str | None = None
    load_type: str | None = None
    load_position: str | None = None
    bounding_box_reference: BoundingBoxReference | None = None
    load_dimensions: LoadDimensions | None = None
    weight: NotNegative | None = None


class PowerSupply(WireObject):
    """Battery: charge (percent), voltage (V), current (A), health (percent), range (m) (section 7.8)."""

    state_of_charge: Percent
    battery_voltage: float | None = None
    battery_current: float | None = None
    battery_health: Percent | None = None
    charging: bool
    range: NotNegative | None = None


class SafetyState(WireObject):
    """Emergency stop and protective field (section 7.8)."""

    active_emergency_stop: EmergencyStop
    field_violation: bool


class Information(WireObject):
    """Information for display only; no logic depends on it (section 7.8)."""

    info_type: str
    info_level: InfoLevel
    info_references: tuple[ErrorReference, ...] = ()
    info_descriptor: str | None = None


class PathPoint(WireObject):
    """A point of a polyline, m and rad, with its estimated time of arrival (section 7.8)."""

    x: float
    y: float
    theta: Angle | None = None
    eta: Timestamp


class IntermediatePath(WireObject):
    """The next part of the robot's planned path (section 6.6.2)."""

    polyline: tuple[PathPoint, ...]


class PlannedPath(WireObject):
    """The robot's planned path, at least to the end of the base (section 6.6.2)."""

    trajectory: Trajectory
    traversed_nodes: tuple[str, ...] | None = None


class State(Header):
    """The complete state of the robot, never a difference (section 6.6)."""

    maps: tuple[Map, ...] | None = None
    zone_sets: tuple[ZoneSetState, ...] | None = None
    zone_set_id: Identifier | None = None
    """Only 2.x: the zone set that the robot uses."""
    order_id: Identifier
    order_update_id: UInt32
    last_node_id: Identifier
    last_node_sequence_id: UInt32
    node_states: tuple[NodeState, ...]
    edge_states: tuple[EdgeState, ...]
    planned_path: PlannedPath | None = None
    intermediate_path: IntermediatePath | None = None
    mobile_robot_position: MobileRobotPosition | None = None
    velocity: Velocity | None = None
    loads: tuple[Load, ...] | None = None
    """None: the robot cannot detect loads; empty: no load."""
    driving: bool
    paused: bool | None = None
    new_base_request: bool | None = None
    distance_since_last_node: NotNegative | None = None
    zone_requests: tuple[ZoneRequest, ...] | None = None
    edge_requests: tuple[EdgeRequest, ...] | None = None
    action_states: tuple[ActionState, ...]
    instant_action_states: tuple[ActionState, ...]
    zone_action_states: tuple[ActionState, ...] | None = None
    power_supply: PowerSupply
    operating_mode: OperatingMode
    errors: tuple[ErrorEntry, ...]
    information: tuple[Information, ...] | None = None
    safety_state: SafetyState
