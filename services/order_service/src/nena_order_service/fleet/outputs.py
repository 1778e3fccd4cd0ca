"""What the fleet-control core gives back: messages to send, and news for the order service."""

from __future__ import annotations

from dataclasses import dataclass

from nena_order_service.fleet.failures import FailureKind
from nena_order_service.fleet.mission import Mission
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.responses import Response
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.zone_set import ZoneSet


@dataclass(frozen=True, slots=True)
class PublishOrder:
    """Send the mission, or the part of it that an update is, as an order; header fields are the sender's."""

    robot: RobotKey
    mission: Mission
    order_update_id: int = 0


@dataclass(frozen=True, slots=True)
class PublishInstantActions:
    """Send instant actions; header fields are the sender's."""

    robot: RobotKey
    actions: tuple[Action, ...]


@dataclass(frozen=True, slots=True)
class PublishResponses:
    """Answer requests of the robot; header fields are the sender's."""

    robot: RobotKey
    responses: tuple[Response, ...]


@dataclass(frozen=True, slots=True)
class PublishZoneSet:
    """Bring the robot a zone set; header fields are the sender's."""

    robot: RobotKey
    zone_set: ZoneSet


Publish = PublishOrder | PublishInstantActions | PublishResponses | PublishZoneSet


@dataclass(frozen=True, slots=True)
class RobotChanged:
    """Something about a robot has changed that people or a dispatcher care about.

    Its pose and the fractions of its battery's percent change all the time and make no such news: take them
    from :meth:`FleetController.view` when they are asked for.
    """

    robot: RobotKey


@dataclass(frozen=True, slots=True)
class MissionAccepted:
    """The robot's state echoes the mission: it has it and will do it."""

    robot: RobotKey
    mission_id: str


@dataclass(frozen=True, slots=True)
class NodePassed:
    """The robot has traversed a node, or stands on the first one; in order, none left out."""

    robot: RobotKey
    mission_id: str
    node_id: str
    sequence_id: int


@dataclass(frozen=True, slots=True)
class BaseWanted:
    """The robot comes near the end of its base, and there is more of the mission (section 6.6.3)."""

    robot: RobotKey
    mission_id: str


@dataclass(frozen=True, slots=True)
class OperationStarted:
    """The first of the mission's actions has begun."""

    robot: RobotKey
    mission_id: str


@dataclass(frozen=True, slots=True)
class MissionFinished:
    """The robot has done all of it. It may also be the end of a mission that was cancelled too late."""

    robot: RobotKey
    mission_id: str


@dataclass(frozen=True, slots=True)
class MissionFailed:
    """The mission has ended without success.

    ``reason`` is one sentence for people; ``details`` holds the robot's own words, an error each.
    """

    robot: RobotKey
    mission_id: str
    reason: str
    details: tuple[str, ...] = ()
    kind: FailureKind = FailureKind.DRIVE


@dataclass(frozen=True, slots=True)
class ActionRetriable:
    """An action of the mission has failed, and the robot waits for ``retry`` or ``skipRetry``.

    See section 6.6.9; words as in :class:`MissionFailed`.
    """

    robot: RobotKey
    mission_id: str
    action_id: str
    reason: str
    details: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class MissionCancelled:
    """The mission has ended because it was to be cancelled; the robot has confirmed it or never had it."""

    robot: RobotKey
    mission_id: str


@dataclass(frozen=True, slots=True)
class InstantActionEnded:
    """An instant action that was asked for has come to its end.

    ``status`` is FINISHED or FAILED as the robot reports it, FAILED for one that was not sent, None where the
    robot never told; ``reason`` says in words what happened, ``result`` is the robot's own.
    """

    robot: RobotKey
    action: Action
    status: ActionStatus | None
    reason: str
    result: str | None = None


FleetOutput = (
    Publish
    | RobotChanged
    | MissionAccepted
    | NodePassed
    | BaseWanted
    | OperationStarted
    | MissionFinished
    | MissionFailed
    | MissionCancelled
    | ActionRetriable
    | InstantActionEnded
)

Outputs = tuple[FleetOutput, ...]
