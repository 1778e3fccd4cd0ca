"""Outputs of the core of fleet control: messages to send, when to resend them, and events for the engine."""

from __future__ import annotations

from dataclasses import dataclass

from nena_order_service.fleet.failures import FailureKind
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.fleet_api.reasons import Reason
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.responses import Response
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.zone_set import ZoneSet


@dataclass(frozen=True, slots=True)
class PublishOrder:
    """Send a VDA order or an update of one (section 7.3); the sender adds the header."""

    robot: RobotKey
    vda_order: VdaOrder
    order_update_id: int = 0


@dataclass(frozen=True, slots=True)
class PublishInstantActions:
    """Send instant actions (section 7.4); the sender adds the header."""

    robot: RobotKey
    actions: tuple[Action, ...]


@dataclass(frozen=True, slots=True)
class PublishResponses:
    """Answer the robot's requests (section 7.5); the sender adds the header."""

    robot: RobotKey
    responses: tuple[Response, ...]


@dataclass(frozen=True, slots=True)
class PublishZoneSet:
    """Send a zone set (section 7.6); the sender adds the header."""

    robot: RobotKey
    zone_set: ZoneSet


Publish = PublishOrder | PublishInstantActions | PublishResponses | PublishZoneSet


@dataclass(slots=True)
class Delivery:
    """Schedule of a message: it is resent with growing delays until a state echoes it; monotonic seconds."""

    settings: FleetSettings
    sendings: int = 0
    """Number of times that it was sent since the robot was last unreachable."""
    in_all: int = 0
    """Number of times that it was sent in total."""
    _due_at: float = 0.0
    _sent_at: float = 0.0
    _doubted_at: float | None = None
    """When a refusal that may be about another message was first seen."""

    def is_due(self, now: float) -> bool:
        """Return whether the message is to be sent now."""
        return now >= self._due_at and self.sendings < self.settings.sendings

    def has_failed(self, now: float) -> bool:
        """Return whether all attempts are used up and the delay after the last one has passed."""
        return now >= self._due_at and self.sendings >= self.settings.sendings

    def note_sent(self, now: float) -> None:
        """Note that the message was sent."""
        pause = self.settings.resend_after * 2.0**self.sendings
        self._due_at = now + min(pause, self.settings.resend_at_most_after)
        self._sent_at = now
        self.sendings += 1
        self.in_all += 1

    def is_refused(self, now: float, *, named: bool) -> bool:
        """Return whether a refusal counts: it is ``named``, or persists after a resend."""
        # 2.x does not require references: an unnamed refusal may be about another message, which a resend
        # shows.
        if named or self.sendings >= self.settings.sendings:
            return True
        if self._doubted_at is None:
            self._doubted_at = now
            self._due_at = 0.0
        return now - self._doubted_at >= self.settings.resend_after

    def hasten(self) -> None:
        """Shorten the delay to its first value, because the last sending may be lost; it still counts."""
        self._due_at = min(self._due_at, self._sent_at + self.settings.resend_after)

    def restart(self) -> None:
        """Restart the schedule, because the robot cannot be sent the message now."""
        self.sendings = 0
        self._due_at = 0.0
        self._doubted_at = None


@dataclass(frozen=True, slots=True)
class RobotChanged:
    """A robot has changed in a way relevant to users or the dispatcher.

    Its pose and fractions of its charge change continuously and cause no event: read them from
    :meth:`FleetController.view`.
    """

    robot: RobotKey


@dataclass(frozen=True, slots=True)
class StateIgnored:
    """A state was ignored, because it is a repetition or older than the last one (section 7.2)."""

    robot: RobotKey


@dataclass(frozen=True, slots=True)
class BrokerLinkChanged:
    """Our own link to the broker is lost or back, which changes the views of all robots."""


@dataclass(frozen=True, slots=True)
class VdaOrderAccepted:
    """The robot has accepted the VDA order: its state echoes it (section 6.1.2)."""

    robot: RobotKey
    order_id: str


@dataclass(frozen=True, slots=True)
class NodePassed:
    """The robot has traversed a node, or is on the first one (section 6.6.2); sent in order, without gaps."""

    robot: RobotKey
    order_id: str
    node_id: str
    sequence_id: int


@dataclass(frozen=True, slots=True)
class BaseWanted:
    """The robot requests a longer base (newBaseRequest), and the VDA order has a horizon (section 6.6.3)."""

    robot: RobotKey
    order_id: str


@dataclass(frozen=True, slots=True)
class OperationStarted:
    """The first action at the VDA order's last node has begun."""

    robot: RobotKey
    order_id: str


@dataclass(frozen=True, slots=True)
class VdaOrderFinished:
    """The robot has finished the VDA order (section 6.6.8)."""

    robot: RobotKey
    order_id: str


@dataclass(frozen=True, slots=True)
class VdaOrderFailed:
    """The VDA order has ended without success.

    ``reason`` is one sentence; ``details`` has the robot's own texts, one per error.
    """

    robot: RobotKey
    order_id: str
    reason: Reason
    details: tuple[str, ...] = ()
    kind: FailureKind = FailureKind.DRIVE


@dataclass(frozen=True, slots=True)
class ActionRetriable:
    """An action is RETRIABLE: the robot waits for ``retry`` or ``skipRetry`` (section 6.6.9).

    ``reason`` and ``details`` are as in :class:`VdaOrderFailed`.
    """

    robot: RobotKey
    order_id: str
    action_id: str
    reason: Reason
    details: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class VdaOrderCancelled:
    """The VDA order was cancelled (section 6.1.3): the robot has confirmed that, or never had the order."""

    robot: RobotKey
    order_id: str


@dataclass(frozen=True, slots=True)
class InstantActionEnded:
    """A requested instant action has ended (section 6.2.1).

    ``status`` is FINISHED or FAILED as reported by the robot, FAILED if it was not sent, or None if the robot
    never reported its end. ``reason`` describes what happened; ``result`` is the robot's actionResult.
    """

    robot: RobotKey
    action: Action
    status: ActionStatus | None
    reason: Reason
    result: str | None = None


FleetOutput = (
    Publish
    | RobotChanged
    | StateIgnored
    | BrokerLinkChanged
    | VdaOrderAccepted
    | NodePassed
    | BaseWanted
    | OperationStarted
    | VdaOrderFinished
    | VdaOrderFailed
    | VdaOrderCancelled
    | ActionRetriable
    | InstantActionEnded
)

Outputs = tuple[FleetOutput, ...]
