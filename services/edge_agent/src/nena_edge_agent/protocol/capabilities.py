"""What a robot can do and how it is set up, as far as the protocol core needs to know."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.ground import Footprint
from nena_edge_agent.protocol.link_loss import LinkLossPolicy
from nena_edge_agent.protocol.rules import RULES, Rules
from nena_shared.vda5050.zone_set import ZoneType


class DriveStrategy(StrEnum):
    """How nodes are driven to."""

    STOP_AT_NODES = "stop_at_nodes"
    """Each node is a goal that is driven to its end."""
    PASS_THROUGH = "pass_through"  # noqa: S105 - a way to drive, no password
    """The next goal is given in the range of a node that gives no reason to stop."""


class ExternalGoals(StrEnum):
    """What becomes of an order when somebody else has navigation drive."""

    PAUSE = "pause"
    """It waits for the end of the other drive, and goes on."""
    FAIL = "fail"
    """Its drive fails; fleet control decides."""


@dataclass(frozen=True, slots=True)
class Capabilities:
    """A robot's set-up; distances in m, angles in rad, speeds in m/s.

    ``maximum_speed`` is the robot's own; ``limits_speed`` tells whether its driver can keep it below that.

    ``drives_ahead``: its driver goes over several places at once, and is told which come.

    ``braking_distance`` is the way in m in which the robot becomes slower, from its full speed; ``footprint``
    is its contour.

    ``link_loss`` holds once the link to the broker has been lost for ``link_loss_patience`` seconds.

    A drive that has failed is tried again ``drive_retries`` times, each time after ``retry_wait`` seconds.

    ``frame`` names the frame of all coordinates, by how the plant lies on the robot's maps.

    ``tolerated_parameters`` are optional fields of the order that are passed over instead of refused, by
    their path, e.g. ``edges.trajectory``.
    """

    map_id: str
    map_version: str = "1"
    actions: Mapping[str, ActionDeclaration] = field(default_factory=dict)
    default_deviation_xy: float = 0.3
    default_deviation_theta: float = 0.3
    maximum_speed: float = 1.0
    limits_speed: bool = True
    strategy: DriveStrategy = DriveStrategy.STOP_AT_NODES
    pass_radius: float = 0.5
    drives_ahead: bool = False
    base_request_distance: float = 2.0
    external_goals: ExternalGoals = ExternalGoals.PAUSE
    link_loss: LinkLossPolicy = LinkLossPolicy.ASSERTIVE
    link_loss_patience: float = 10.0
    drive_retries: int = 0
    retry_wait: float = 5.0
    maximum_nodes: int = 1000
    maximum_actions: int = 1000
    tolerated_parameters: frozenset[str] = frozenset()
    footprint: Footprint = field(default_factory=lambda: Footprint(length=0.8, width=0.6))
    braking_distance: float = 1.0
    frame: str = ""
    rules: Rules = RULES["2.1.0"]

    @property
    def zones(self) -> frozenset[ZoneType]:
        """The types of zones that the robot honours."""
        if not self.rules.standard.zones:
            return frozenset()
        limit = {ZoneType.SPEED_LIMIT} if self.limits_speed else set()
        return frozenset({ZoneType.BLOCKED, ZoneType.LINE_GUIDED, ZoneType.RELEASE} | limit)
