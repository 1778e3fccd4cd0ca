"""The capabilities of a robot, by its settings and its version of VDA 5050."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from nena_edge_agent.driver.port import DriveLimits
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.geometry import Footprint
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.factsheet import OptionalParameter, Support
from nena_shared.vda5050.order import Edge, Order, OrientationType
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.versions import RULES
from nena_shared.vda5050.zone_set import ZoneType


class LinkLossPolicy(StrEnum):
    """What a robot does while its broker connection is lost."""

    ASSERTIVE = "assertive"
    """Drive to the end of the base, as the standard specifies."""
    PREVENTIVE_AT_ONCE = "preventive_at_once"
    """Stop immediately, and wait."""
    PREVENTIVE_NEXT_NODE = "preventive_next_node"
    """Drive to the next node, and wait there."""


class DriveStrategy(StrEnum):
    """How the robot drives from node to node."""

    STOP_AT_NODES = "stop_at_nodes"
    """Stop at each node; each is a separate goal."""
    PASS_THROUGH = "pass_through"  # noqa: S105 - a drive strategy, no password
    """Send the next goal within the deviation of a node that requires no stop."""


class ExternalGoals(StrEnum):
    """What happens to an order while navigation drives to another program's goal."""

    PAUSE = "pause"
    """Wait until the other goal has ended, then continue."""
    FAIL = "fail"
    """Fail the drive; fleet control decides what to do."""


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a robot can do, and how it is configured; in m, rad, m/s and s.

    Attributes:
        limits_speed: the driver accepts speed limits below ``maximum_speed``.
        keeps_out: the driver plans around closed areas.
        follows_paths: the driver follows trajectories.
        drives_ahead: the driver passes several poses of one goal without a stop.
        hand_over_distance: to pass a node at full speed, the next goal must arrive this distance plus
            ``hand_over_time`` of driving before the end of the current one.
        base_request_time: the same time at the end of the base, with fleet control's response time.
        link_loss: policy once the broker has been unreachable for ``link_loss_timeout``.
        drive_retries: number of retries of a failed drive, each after ``retry_wait``.
        tolerated_parameters: optional order fields to ignore instead of rejecting the order, by path:
            ``edges.trajectory``.
        braking_distance: from full speed.
        frame: identifies the frame of all coordinates: the transforms from the plant to the robot's maps.
    """

    map_id: str
    map_version: str = "1"
    actions: Mapping[str, ActionDeclaration] = field(default_factory=dict)
    default_deviation_xy: float = 0.3
    default_deviation_theta: float = 0.3
    maximum_speed: float = 1.0
    limits_speed: bool = True
    keeps_out: bool = False
    follows_paths: bool = False
    strategy: DriveStrategy = DriveStrategy.STOP_AT_NODES
    pass_radius: float = 0.5
    hand_over_distance: float = 0.0
    hand_over_time: float = 0.0
    drives_ahead: bool = False
    base_request_distance: float = 2.0
    base_request_time: float = 0.0
    external_goals: ExternalGoals = ExternalGoals.PAUSE
    link_loss: LinkLossPolicy = LinkLossPolicy.ASSERTIVE
    link_loss_timeout: float = 10.0
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
        """Return the types of zones that the robot supports (section 6.10)."""
        if not self.rules.zones:
            return frozenset()
        limit = {ZoneType.SPEED_LIMIT} if self.limits_speed else set()
        return frozenset({ZoneType.BLOCKED, ZoneType.LINE_GUIDED, ZoneType.RELEASE} | limit)


SPEED = "edges.maximumSpeed"
"""Optional field that needs a driver with speed limits."""
TRAJECTORY = "edges.trajectory"
CORRIDOR = "edges.corridor"
"""Optional fields that need a driver that follows paths."""
ZONE_SET = "zoneSetId"
"""Optional field of 2.x orders; not supported, because 2.x has no zone sets."""

_ALWAYS: tuple[OptionalParameter, ...] = (
    OptionalParameter(
        parameter="order.nodes.nodePosition",
        support=Support.REQUIRED,
        description="The robot drives to coordinates; it does not know nodes by name.",
    ),
    OptionalParameter(parameter="order.nodes.nodePosition.theta", support=Support.SUPPORTED),
    OptionalParameter(parameter="order.edges.length", support=Support.SUPPORTED),
)


def _unreachable_speed(edge: Edge, capabilities: Capabilities) -> bool:
    """Return whether the robot cannot keep to the edge's speed limit."""
    limit = edge.maximum_speed
    return limit is not None and limit < capabilities.maximum_speed and not capabilities.limits_speed


DEMANDS: dict[str, Callable[[Edge, Capabilities], bool]] = {
    SPEED: _unreachable_speed,
    "edges.maximumMobileRobotHeight": lambda edge, _: edge.maximum_mobile_robot_height is not None,
    "edges.minimumLoadHandlingDeviceHeight": lambda edge, _: (
        edge.minimum_load_handling_device_height is not None
    ),
    # The robot turns freely: 0 tangential is the direction of travel (7.3).
    "edges.orientation": lambda edge, _: (
        edge.orientation is not None
        and (edge.orientation != 0 or edge.orientation_type is OrientationType.GLOBAL)
    ),
    "edges.direction": lambda edge, _: bool(edge.direction),
    "edges.reachOrientationBeforeEntering": lambda edge, _: bool(edge.reach_orientation_before_entering),
    "edges.maximumRotationSpeed": lambda edge, _: edge.maximum_rotation_speed is not None,
    TRAJECTORY: lambda edge, robot: edge.trajectory is not None and not robot.follows_paths,
    CORRIDOR: lambda edge, robot: edge.corridor is not None and not robot.follows_paths,
}
"""For each optional edge field: whether an edge demands what the robot cannot do. Values that match the
robot's default behaviour (drive forwards, turn freely, drive at its own speed) demand nothing."""
TOLERABLE: frozenset[str] = frozenset({ZONE_SET, *DEMANDS})
"""Fields that the setting ``tolerated_parameters`` may name."""


def supported(capabilities: Capabilities, limits: DriveLimits | None = None) -> tuple[OptionalParameter, ...]:
    """Return the optional fields for the factsheet (section 6.10).

    Unlisted fields are unsupported. ``limits`` are navigation's, None: not reported.
    """
    deviations = (
        OptionalParameter(
            parameter=f"order.nodes.nodePosition.{field}",
            support=Support.SUPPORTED,
            description=f"at least {tolerance:g} {unit}: Nav2's goal tolerance" if tolerance else None,
        )
        for field, tolerance, unit in (
            ("allowedDeviationTheta", limits.theta_tolerance if limits else None, "rad"),
            ("allowedDeviationXY", limits.tolerance if limits else None, "m"),
        )
    )
    more: list[str] = []
    if capabilities.limits_speed:
        more.append(SPEED)
    if capabilities.follows_paths:
        more += [TRAJECTORY, CORRIDOR, f"{CORRIDOR}.corridorReferencePoint", f"{CORRIDOR}.releaseRequired"]
    if ActionStatus.RETRIABLE in capabilities.rules.action_statuses:
        more += ["nodes.actions.retriable", "edges.actions.retriable"]
    listed = (OptionalParameter(parameter=f"order.{name}", support=Support.SUPPORTED) for name in more)
    return (*_ALWAYS, *deviations, *listed)


def unsupported(order: Order, capabilities: Capabilities) -> tuple[str, Edge | None] | None:
    """Return the first optional field that the robot does not support, and its edge, if any.

    VDA 5050 3.0 section 6.1.4.2.
    """
    if order.zone_set_id and ZONE_SET not in capabilities.tolerated_parameters:
        return ZONE_SET, None
    demands = [demand for demand in DEMANDS.items() if demand[0] not in capabilities.tolerated_parameters]
    for edge in order.edges:
        for name, demanded in demands:
            if demanded(edge, capabilities):
                return name, edge
    return None
