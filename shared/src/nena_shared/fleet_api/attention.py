"""The attention list in the API: what needs a person, since when, what it holds up, and what to do."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from nena_shared.fleet_api.base import Moment, Request, Resource
from nena_shared.fleet_api.stops import Person


class MatterKind(StrEnum):
    """Kinds of matters that need a person, the most urgent first."""

    BROKER_LOST = "broker_lost"
    ORDER_SERVICE_DOWN = "order_service_down"
    STORE_UNAVAILABLE = "store_unavailable"
    EMERGENCY_STOP = "emergency_stop"
    CIRCLE = "circle"
    JAM = "jam"
    ROBOT_ERROR = "robot_error"
    NOT_LOCALIZED = "not_localized"
    ROBOT_UNREADABLE = "robot_unreadable"
    ROBOT_LOST = "robot_lost"
    ROBOT_SILENT = "robot_silent"
    TAKEN_OUT = "taken_out"
    ORDER_FAILED = "order_failed"
    STOP = "stop"
    PROTECTIVE_FIELD = "protective_field"
    ROBOT_OFFLINE = "robot_offline"
    NOT_AUTOMATIC = "not_automatic"
    ROBOT_PAUSED = "robot_paused"
    BATTERY_LOW = "battery_low"
    PATH_LOCKED = "path_locked"
    ORDER_HELD = "order_held"
    ORDER_LATE = "order_late"
    BROKER_LACKS = "broker_lacks"

    @property
    def urgent(self) -> bool:
        """Whether it stops something now; the others are warnings."""
        return _RANKS[self] < _RANKS[MatterKind.STOP]

    @property
    def rank(self) -> int:
        """Position in the order of urgency, from 0."""
        return _RANKS[self]


class MatterChange(StrEnum):
    """What happens to a matter, once each."""

    BEGAN = "began"
    ACKNOWLEDGED = "acknowledged"
    ENDED = "ended"


_RANKS: Final = {kind: rank for rank, kind in enumerate(MatterKind)}

_ADVICE: Final[dict[MatterKind, str]] = {
    MatterKind.BROKER_LOST: "Check that the MQTT broker runs, and mqtt.host and mqtt.port of the aggregator.",
    MatterKind.ORDER_SERVICE_DOWN: "Check the order service and its log, and start it again.",
    MatterKind.STORE_UNAVAILABLE: "Check the database of the order service: disk, network, log.",
    MatterKind.EMERGENCY_STOP: "Find out why it was triggered; reset it when everyone is safe.",
    MatterKind.CIRCLE: "Reroute one of them: nena vehicles reroute NAME --forced.",
    MatterKind.JAM: "Help the robot at its head first.",
    MatterKind.ROBOT_ERROR: "Go to the robot; clear the error there.",
    MatterKind.NOT_LOCALIZED: "Set its position in the control panel.",
    MatterKind.ROBOT_UNREADABLE: "Compare its messages with VDA 5050, as the reason says.",
    MatterKind.ROBOT_LOST: "Check the robot's power, its network and its edge agent.",
    MatterKind.ROBOT_SILENT: "Check the robot's power, its network and its edge agent.",
    MatterKind.TAKEN_OUT: "Check the robot, then: nena vehicles level NAME TO_BE_UTILIZED.",
    MatterKind.ORDER_FAILED: "Find the cause in its history; create it again if it is still needed.",
    MatterKind.STOP: "End the stop when everyone is safe: nena stops end NAME.",
    MatterKind.PROTECTIVE_FIELD: "Remove what stands in the robot's way.",
    MatterKind.ROBOT_OFFLINE: "Start the robot and its edge agent.",
    MatterKind.NOT_AUTOMATIC: "Switch the robot to AUTOMATIC.",
    MatterKind.ROBOT_PAUSED: "Resume the robot when it may drive.",
    MatterKind.BATTERY_LOW: "Take it to a charging station.",
    MatterKind.PATH_LOCKED: "Unlock it when it is free, in the control panel or by nena paths unlock.",
    MatterKind.ORDER_HELD: "Resume or withdraw it: nena orders resume NAME.",
    MatterKind.ORDER_LATE: "Find out what it waits for: nena explain NAME.",
    MatterKind.BROKER_LACKS: "Use another MQTT broker, or do what docs/brokers.md says.",
}
"""What to do, in English, by kind; the control panel has its own texts."""


def advice_on(kind: MatterKind, subject: str) -> str:
    """Return what to do; of several subjects, it names the first one."""
    return _ADVICE[kind].replace("NAME", subject.split(", ", maxsplit=1)[0])


class Acknowledgement(Resource):
    """Who has acknowledged a matter, and when."""

    by: str
    at: Moment


class Matter(Resource):
    """Something that needs a person."""

    id: str
    """Kind and subject, such as ``jam:AMR-07``; the same as long as the matter lasts."""
    kind: MatterKind
    urgent: bool
    subject: str
    """Name of the vehicle, order, path or stop; empty for services."""
    robot: str | None = None
    """ID of the robot in the aggregator's API, if it is about one."""
    since: Moment
    reason: str
    """What it is, as text."""
    paths: tuple[str, ...] = ()
    """Paths that somebody has locked together, the first one first."""
    robots: tuple[str, ...] = ()
    """Names of the first vehicles that it holds up."""
    robot_count: int = 0
    orders: tuple[str, ...] = ()
    """Names of the first orders that it holds up."""
    order_count: int = 0
    advice: str
    """What to do, as text."""
    acknowledged: Acknowledgement | None = None


class AttentionList(Resource):
    """Everything that needs a person: urgent matters first, in each group the acknowledged ones last."""

    attention: tuple[Matter, ...]

    @property
    def unacknowledged(self) -> int:
        """Number of matters that nobody has acknowledged."""
        return sum(matter.acknowledged is None for matter in self.attention)


class AcknowledgementRequest(Request):
    """Request to acknowledge a matter."""

    by: Person | None = None
    """Name of the person; None: the user of the request's token."""
