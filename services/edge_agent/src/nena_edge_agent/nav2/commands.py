"""Commands of the goal tracker and the localisation to the driver."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from nena_edge_agent.driver.port import DriveGoal, DriverEvent


class Server(StrEnum):
    """The servers of Nav2 that drive for us, by the names of their nodes."""

    NAVIGATOR = "bt_navigator"
    CONTROLLER = "controller_server"
    """It drives along paths of our own."""


@dataclass(frozen=True, slots=True)
class PublishGoal:
    """Publish the goal on the topic; it may be lost on the way."""

    goal: DriveGoal


@dataclass(frozen=True, slots=True)
class SendGoal:
    """Send the goal to the action of a server, with this ID; the server responds."""

    goal: DriveGoal
    goal_id: str
    server: Server = Server.NAVIGATOR


@dataclass(frozen=True, slots=True)
class RequestResult:
    """Request the result of the goal, which the server sends when the goal has ended."""

    goal_id: str
    server: Server = Server.NAVIGATOR


@dataclass(frozen=True, slots=True)
class CancelGoal:
    """Call the cancel service for this goal only (zero stamp)."""

    goal_id: str
    server: Server = Server.NAVIGATOR


@dataclass(frozen=True, slots=True)
class StopMotion:
    """Cancel all goals of the controller, the behaviours and the docking server, from any client."""


@dataclass(frozen=True, slots=True)
class RequestPose:
    """Make the localisation send a pose although the robot is at standstill."""


@dataclass(frozen=True, slots=True)
class Report:
    """Report an event to the protocol core."""

    event: DriverEvent


Command = PublishGoal | SendGoal | RequestResult | CancelGoal | StopMotion | RequestPose | Report
