"""The state message of 3.0 (section 7.8)."""

from __future__ import annotations

from typing import Annotated

from nena_shared.vda5050.action import ActionState
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.order import NodePosition
from nena_shared.vda5050.request import EdgeRequest, RequestStatus, ZoneRequest
from nena_shared.vda5050.state import EdgeState, NodeState, OperatingMode, PlannedPath, State
from nena_shared.vda5050.v3_0.action import ActionTypeV30
from nena_shared.vda5050.v3_0.order import TrajectoryV30
from nena_shared.vda5050.wire_names import Absent, reads, writes

RequestStatusV30 = Annotated[RequestStatus, writes({"QUEUED": "REQUESTED"}, RequestStatus)]
"""Section 6.9 has QUEUED, table and schema do not: read, but not sent to a fleet control of 3.0.0."""


class PositionOfNodeStateV30(NodePosition):
    """Where a node is; how near the robot must come stands in the order alone."""

    allowed_deviation_xy: Absent = None
    allowed_deviation_theta: Absent = None


class NodeStateV30(NodeState):
    """A node that is still to be traversed."""

    node_position: PositionOfNodeStateV30 | None = None


class EdgeStateV30(EdgeState):
    """An edge that is still to be driven to its end."""

    trajectory: TrajectoryV30 | None = None


class PlannedPathV30(PlannedPath):
    """The way that the robot means to drive at least to the end of its base."""

    trajectory: TrajectoryV30


class ActionStateV30(ActionState):
    """Where one action stands."""

    action_type: ActionTypeV30 | None = None


class ZoneRequestV30(ZoneRequest):
    """A request about a zone."""

    request_status: RequestStatusV30
    trajectory: TrajectoryV30 | None = None


class EdgeRequestV30(EdgeRequest):
    """A request about an edge of the order."""

    request_status: RequestStatusV30


class ErrorEntryV30(ErrorEntry):
    """One active error; section 7.8 has an older name for one type."""

    error_type: Annotated[str, reads({"INVALID_ORDER": "INVALID_ORDER_ACTION"})]


class StateV30(State):
    """Everything about the robot."""

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
