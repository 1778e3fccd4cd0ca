"""Outputs of the fleet-control core: messages to send, and events for the order service."""

from __future__ import annotations

from dataclasses import dataclass

from nena_order_service.fleet.failures import FailureKind
from nena_order_service.fleet.vda_order import VdaOrder
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
    """Send instant actions (section 7.4); header fields are the sender's."""

    robot: RobotKey
    actions: tuple[Action, ...]


@dataclass(frozen=True, slots=True)
class PublishResponses:
    """Answer requests of the robot (section 7.5); header fields are the sender's."""

    robot: RobotKey
    responses: tuple[Response, ...]


@dataclass(frozen=True, slots=True)
class PublishZoneSet:
    """Send the robot a zone set (section 7.6); header fields are the sender's."""

    robot: RobotKey
    zone_set: ZoneSet


Publish = PublishOrder | PublishInstantActions | PublishResponses | PublishZoneSet


@dataclass(frozen=True, slots=True)
class RobotChanged:
    """Something relevant to people or a dispatcher has changed about a robot.

    Its pose and fractions of the battery's percent change all the time and make no such event: read them from
    :meth:`FleetController.view`.
    """

    robot: RobotKey


@dataclass(frozen=True, slots=True)
class VdaOrderAccepted:
    """The robot's state echoes the VDA order (section 6.1.2): the robot has accepted it."""

    robot: RobotKey
    order_id: str


@dataclass(frozen=True, slots=True)
class NodePassed:
    """The robot has traversed a node, or is on the first one (section 6.6.2); in order, without gaps."""

    robot: RobotKey
    order_id: str
    node_id: str
    sequence_id: int


@dataclass(frozen=True, slots=True)
class BaseWanted:
    """The robot approaches the end of its base, and the VDA order has more nodes (section 6.6.3)."""

    robot: RobotKey
    order_id: str


@dataclass(frozen=True, slots=True)
class OperationStarted:
    """The first of the VDA order's actions has begun."""

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

    ``reason`` is one sentence for people; ``details`` has the robot's own texts, one per error.
    """

    robot: RobotKey
    order_id: str
    reason: str
    details: tuple[str, ...] = ()
    kind: FailureKind = FailureKind.DRIVE


@dataclass(frozen=True, slots=True)
class ActionRetriable:
    """An action of the VDA order has failed, and the robot waits for ``retry`` or ``skipRetry``.

    See section 6.6.9; words as in :class:`VdaOrderFailed`.
    """

    robot: RobotKey
    order_id: str
    action_id: str
    reason: str
    details: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class VdaOrderCancelled:
    """The VDA order was cancelled (section 6.1.3); the robot has confirmed it or never had it."""

    robot: RobotKey
    order_id: str


@dataclass(frozen=True, slots=True)
class InstantActionEnded:
    """A requested instant action has ended (section 6.2.1).

    ``status`` is FINISHED or FAILED as reported by the robot, FAILED for one that was not sent, None if the
    robot never reported it; ``reason`` describes what happened, ``result`` is the robot's own.
    """

    robot: RobotKey
    action: Action
    status: ActionStatus | None
    reason: str
    result: str | None = None


FleetOutput = (
    Publish
    | RobotChanged
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
