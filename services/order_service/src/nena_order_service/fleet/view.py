"""What the rest of the order service sees of a robot."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from nena_order_service.fleet.reported import State
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.topics import RobotKey


class LinkStatus(StrEnum):
    """What is known of the way to a robot."""

    UNKNOWN = "UNKNOWN"
    """It has never been heard of."""
    ONLINE = "ONLINE"
    OFFLINE = "OFFLINE"
    HIBERNATING = "HIBERNATING"
    CONNECTION_BROKEN = "CONNECTION_BROKEN"
    SILENT = "SILENT"
    """It should be there, but its last state is too old."""


class MissionPhase(StrEnum):
    """How far a mission has come."""

    WAITING = "WAITING"
    """Nothing is sent yet; the robot cannot be sent an order now."""
    SENT = "SENT"
    """Sent, but no state echoes it yet."""
    RUNNING = "RUNNING"
    """The robot has it."""
    CANCELLING = "CANCELLING"
    """It is to end early; the robot has not yet confirmed that."""


@dataclass(frozen=True, slots=True)
class Availability:
    """Whether a robot can take a mission now; ``reason`` says why, or why not, in words."""

    can_take_order: bool
    reason: str


@dataclass(frozen=True, slots=True)
class RobotView:
    """A robot at one moment."""

    key: RobotKey
    link: LinkStatus
    vehicle_state: VehicleState
    availability: Availability
    state: State | None
    """Its last state message."""
    state_at: float | None
    """When that came, in monotonic seconds."""
    factsheet: Factsheet | None
    malformed: int
    """How many of its messages could not be read."""
    mission_id: str | None
    mission_phase: MissionPhase | None
    mission_note: str
    """What the mission waits for, in words; empty where it waits for nothing but the robot's driving."""
