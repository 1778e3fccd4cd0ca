"""The state and the visualization in brief, for any version; the fields mean what their namesakes mean.

What stands in a message beside these fields is checked by the forms of the versions, and then left out.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Meta

from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.brief.base import (
    Angle,
    Brief,
    HeaderBrief,
    Identifier,
    Moment,
    NotNegative,
    Percent,
    Share,
    UInt32,
)
from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.request import EdgeRequestType, RequestStatus, ZoneRequestType
from nena_shared.vda5050.state import (
    EmergencyStop,
    InfoLevel,
    MapStatus,
    OperatingMode,
    State,
    ZoneSetStatus,
)
from nena_shared.vda5050.visualization import Visualization


class MapBrief(Brief, frozen=True, kw_only=True, gc=False):
    """A map that the robot holds."""

    map_id: Identifier
    map_version: str
    map_descriptor: str | None = None
    map_status: MapStatus


class NodePositionBrief(Brief, frozen=True, kw_only=True, gc=False):
    """Where a node is, m and rad."""

    x: float
    y: float
    theta: Angle | None = None
    map_id: Identifier


class NodeBrief(Brief, frozen=True, kw_only=True, gc=False):
    """A node that is still to be traversed."""

    node_id: Identifier
    sequence_id: UInt32
    node_descriptor: str | None = None
    released: bool
    node_position: NodePositionBrief | None = None


class ControlPointBrief(Brief, frozen=True, kw_only=True, gc=False):
    """A point that shapes a trajectory, m."""

    x: float
    y: float
    weight: NotNegative | None = None


class TrajectoryBrief(Brief, frozen=True, kw_only=True, gc=False):
    """A NURBS."""

    degree: Annotated[int, Meta(ge=1)] | None = None
    knot_vector: tuple[Share, ...] | None = None
    control_points: tuple[ControlPointBrief, ...]


class EdgeBrief(Brief, frozen=True, kw_only=True, gc=False):
    """An edge that is still to be driven to its end."""

    edge_id: Identifier
    sequence_id: UInt32
    edge_descriptor: str | None = None
    released: bool
    trajectory: TrajectoryBrief | None = None


class PositionBrief(Brief, frozen=True, kw_only=True, gc=False):
    """Where the robot is: m and rad in the frame of the map."""

    x: float
    y: float
    theta: Angle
    map_id: Identifier
    localized: bool
    localization_score: Share | None = None
    deviation_range: NotNegative | None = None


class VelocityBrief(Brief, frozen=True, kw_only=True, gc=False):
    """Speed in the robot's frame: m/s, m/s, rad/s."""

    vx: float | None = None
    vy: float | None = None
    omega: float | None = None


class BoundingBoxBrief(Brief, frozen=True, kw_only=True, gc=False):
    """Where a load's box stands."""

    x: float
    y: float
    z: float
    theta: Angle | None = None


class LoadDimensionsBrief(Brief, frozen=True, kw_only=True, gc=False):
    """Size of a load, m."""

    length: NotNegative
    width: NotNegative
    height: NotNegative | None = None


class LoadBrief(Brief, frozen=True, kw_only=True, gc=False):
    """Something that the robot carries; weight in kg."""

    load_id: str | None = None
    load_type: str | None = None
    load_position: str | None = None
    bounding_box_reference: BoundingBoxBrief | None = None
    load_dimensions: LoadDimensionsBrief | None = None
    weight: NotNegative | None = None


class ActionBrief(Brief, frozen=True, kw_only=True, gc=False):
    """Where one action stands; the codecs read the older name of a type."""

    action_id: Identifier
    action_type: Annotated[str, Meta(pattern="^(?!initPosition$)", max_length=1024)] | None = None
    action_descriptor: str | None = None
    action_status: ActionStatus
    action_result: str | None = None


class PowerSupplyBrief(Brief, frozen=True, kw_only=True, gc=False):
    """The battery: percent, V, percent, m."""

    state_of_charge: Percent
    battery_voltage: float | None = None
    battery_health: Percent | None = None
    charging: bool
    range: NotNegative | None = None


class SafetyBrief(Brief, frozen=True, kw_only=True, gc=False):
    """Emergency stop and protective field."""

    active_emergency_stop: EmergencyStop
    field_violation: bool


class ReferenceBrief(Brief, frozen=True, kw_only=True, gc=False):
    """What an error or a remark is about."""

    reference_key: str
    reference_value: str


class ErrorBrief(Brief, frozen=True, kw_only=True, gc=False):
    """One active error."""

    error_type: str
    error_level: ErrorLevel
    error_references: tuple[ReferenceBrief, ...] = ()
    error_description: str | None = None
    error_hint: str | None = None


class InformationBrief(Brief, frozen=True, kw_only=True, gc=False):
    """A remark for people."""

    info_type: str
    info_level: InfoLevel
    info_references: tuple[ReferenceBrief, ...] = ()
    info_descriptor: str | None = None


class PathPointBrief(Brief, frozen=True, kw_only=True, gc=False):
    """A point of a polyline, m and rad, and when the robot will be there."""

    x: float
    y: float
    theta: Angle | None = None
    eta: Moment


class PathBrief(Brief, frozen=True, kw_only=True, gc=False):
    """The way that the robot means to drive next."""

    polyline: tuple[PathPointBrief, ...]


class ZoneSetBrief(Brief, frozen=True, kw_only=True, gc=False):
    """A zone set that the robot holds."""

    zone_set_id: Identifier
    map_id: Identifier
    zone_set_status: ZoneSetStatus


class ZoneRequestBrief(Brief, frozen=True, kw_only=True, gc=False):
    """A request about a zone."""

    request_id: Identifier
    request_type: ZoneRequestType
    zone_id: Identifier
    zone_set_id: Identifier
    request_status: RequestStatus


class EdgeRequestBrief(Brief, frozen=True, kw_only=True, gc=False):
    """A request about an edge of the order."""

    request_id: Identifier
    request_type: EdgeRequestType
    edge_id: Identifier
    sequence_id: UInt32
    request_status: RequestStatus


class StateBrief(HeaderBrief, frozen=True, kw_only=True, gc=False):
    """What watchers need of a state."""

    FULL: ClassVar[type[Header]] = State
    """The neutral message that this is the brief of."""

    maps: tuple[MapBrief, ...] | None = None
    order_id: Identifier
    order_update_id: UInt32
    last_node_id: Identifier
    last_node_sequence_id: UInt32
    node_states: tuple[NodeBrief, ...]
    edge_states: tuple[EdgeBrief, ...]
    intermediate_path: PathBrief | None = None
    mobile_robot_position: PositionBrief | None = None
    velocity: VelocityBrief | None = None
    zone_sets: tuple[ZoneSetBrief, ...] | None = None
    zone_requests: tuple[ZoneRequestBrief, ...] | None = None
    edge_requests: tuple[EdgeRequestBrief, ...] | None = None
    loads: tuple[LoadBrief, ...] | None = None
    driving: bool
    paused: bool | None = None
    new_base_request: bool | None = None
    distance_since_last_node: NotNegative | None = None
    action_states: tuple[ActionBrief, ...]
    instant_action_states: tuple[ActionBrief, ...]
    power_supply: PowerSupplyBrief
    operating_mode: OperatingMode
    errors: tuple[ErrorBrief, ...]
    information: tuple[InformationBrief, ...] | None = None
    safety_state: SafetyBrief


class VisualizationBrief(HeaderBrief, frozen=True, kw_only=True, gc=False):
    """What watchers need of a visualization."""

    FULL: ClassVar[type[Header]] = Visualization

    mobile_robot_position: PositionBrief | None = None
    velocity: VelocityBrief | None = None
