"""Vehicles as the order service sees them."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.fleet_api.base import Moment, Resource


class VehicleState(StrEnum):
    """What the robot reports, in openTCS's words."""

    UNKNOWN = "UNKNOWN"
    UNAVAILABLE = "UNAVAILABLE"
    ERROR = "ERROR"
    IDLE = "IDLE"
    EXECUTING = "EXECUTING"
    CHARGING = "CHARGING"


class ProcessingState(StrEnum):
    """What the order service does with it."""

    IDLE = "IDLE"
    PROCESSING_ORDER = "PROCESSING_ORDER"


class PrecisePosition(Resource):
    """m and rad in the plant's frame."""

    x: float
    y: float
    theta: float
    map_id: str


class VehicleStatus(Resource):
    """One vehicle as it stands."""

    name: str
    manufacturer: str
    serial_number: str
    state: VehicleState
    processing_state: ProcessingState
    reason: str
    """Why it is in this state, or why it is idle, in words."""
    connection: str
    """ONLINE, OFFLINE, CONNECTION_BROKEN, HIBERNATING; SILENT: no state for too long; UNKNOWN: none ever."""
    operating_mode: str | None = None
    current_position: str | None = None
    """Name of the point that it is at or was at last."""
    precise_position: PrecisePosition | None = None
    energy_level: float | None = None
    """Percent."""
    transport_order: str | None = None
    errors: tuple[str, ...] = ()
    last_state: Moment | None = None
