"""Requests of a robot to fleet control, part of its state (VDA 5050 3.0 section 6.9)."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.vda5050.base import Identifier, UInt32, WireObject
from nena_shared.vda5050.order import Trajectory


class RequestStatus(StrEnum):
    """Status of a request (section 6.9)."""

    REQUESTED = "REQUESTED"
    """Not answered yet; no permission."""
    QUEUED = "QUEUED"
    GRANTED = "GRANTED"
    REVOKED = "REVOKED"
    EXPIRED = "EXPIRED"


class ZoneRequestType(StrEnum):
    """Type of a zone request (section 6.9): to enter a RELEASE zone, or to replan in a zone."""

    ACCESS = "ACCESS"
    REPLANNING = "REPLANNING"


class EdgeRequestType(StrEnum):
    """Type of a request on an edge: to leave the trajectory within the corridor (section 6.9)."""

    CORRIDOR = "CORRIDOR"


class ZoneRequest(WireObject):
    """A request about a zone; IDs are unique among the robot's active requests (section 6.9)."""

    request_id: Identifier
    request_type: ZoneRequestType
    zone_id: Identifier
    zone_set_id: Identifier
    request_status: RequestStatus
    trajectory: Trajectory | None = None
    """For REPLANNING: the requested path."""


class EdgeRequest(WireObject):
    """A request about an edge of the order; IDs are unique as for zones (section 6.9)."""

    request_id: Identifier
    request_type: EdgeRequestType
    edge_id: Identifier
    sequence_id: UInt32
    request_status: RequestStatus
