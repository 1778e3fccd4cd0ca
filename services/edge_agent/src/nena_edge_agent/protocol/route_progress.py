"""Driven and remaining distance of the robot's order (section 6.6.2)."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import lru_cache
from itertools import pairwise
from math import dist

from nena_edge_agent.driver.port import PlanReport
from nena_edge_agent.protocol.geometry import distance
from nena_edge_agent.protocol.robot_state import RobotState
from nena_shared.vda5050.error import ErrorReference
from nena_shared.vda5050.state import InfoLevel, Information, IntermediatePath, PathPoint

JITTER = 0.03
"""Metres by which the poses of a stopped robot may differ."""
JUMP = 3.0
"""Distance between two poses beyond which the localisation has corrected itself, metres."""
PLAN_TOLERANCE = 0.75
"""Maximum distance between a goal and the end of navigation's plan, metres."""


@dataclass(frozen=True, slots=True)
class Distance:
    """The distances driven and left, m."""

    driven: float
    left: float

    @property
    def percent(self) -> int:
        """Return the driven share of the distance, percent."""
        whole = self.driven + self.left
        return round(100 * self.driven / whole) if whole > 0 else 100


def pose_changed(robot: RobotState) -> None:
    """Add the distance from the last pose to the newest one."""
    route, pose = robot.route, robot.reports.localized_pose
    if pose is None:
        return
    # A stopped robot's pose jitters: without a threshold the distance would grow while it stands.
    step = distance(route.pose, pose) if route.pose else 0.0
    if route.pose is None or step >= JITTER:
        route.pose = pose
    if JITTER <= step <= JUMP:
        route.since_node += step
        route.in_order += step


def advance(robot: RobotState) -> None:
    """Restart the distances at each reached node and with each order; after a restart, at the last node."""
    route, progress = robot.route, robot.progress
    node = (progress.last_node_id, progress.last_node_sequence_id)
    if progress.order_id != route.order_id:
        route.order_id, route.in_order, route.node = progress.order_id, 0.0, None
    if node != route.node:
        first, route.node, route.since_node = route.node is None, node, 0.0
        position = progress.last_node.node_position if progress.last_node else None
        pose = robot.reports.localized_pose
        # After a restart the distance driven before is unknown: the straight one is the least.
        if first and position and pose and not progress.on_last_node:
            route.since_node = distance(position, pose)
        route.in_order += route.since_node


def since_node(robot: RobotState) -> float | None:
    """Return the metres driven since the last node, None before the first one (section 7.8)."""
    return robot.route.since_node if robot.progress.last_node_id else None


def to_goal(robot: RobotState) -> Distance | None:
    """Return the distance to the current goal, None without one."""
    pose, goal = robot.reports.localized_pose, robot.goal.pose
    if robot.goal.target is None or goal is None or pose is None:
        return None
    plan, progress = current_plan(robot), robot.reports.progress
    if plan:
        here = (pose.x, pose.y)
        nearest = min(range(len(plan.points)), key=lambda index: dist(plan.points[index], here))
        rest = plan.points[nearest:]
        left = sum(dist(start, end) for start, end in pairwise(rest)) + dist(here, rest[0])
    else:
        # Nav2's feedback has the distance left; drivers without one leave the straight line.
        left = progress.left if progress and progress.left is not None else distance(pose, goal)
    return Distance(robot.route.since_node, left)


def to_end(robot: RobotState) -> Distance | None:
    """Return the distance to the end of the base, None if nothing is left of it."""
    progress, pose = robot.progress, robot.reports.localized_pose
    node = progress.next_node
    position = node.node_position if node else None
    if node is None or position is None or pose is None:
        return None
    goal = to_goal(robot)
    first = goal.left if goal else distance(pose, position)
    return Distance(robot.route.in_order, first + progress.base_path.length_from(node.sequence_id))


def current_plan(robot: RobotState) -> PlanReport | None:
    """Return navigation's plan if it leads to the current goal."""
    plan, goal = robot.reports.plan, robot.goal.pose
    if robot.goal.target is None or plan is None or goal is None:
        return None
    return plan if dist(plan.points[-1], (goal.x, goal.y)) <= PLAN_TOLERANCE else None


def information(robot: RobotState) -> tuple[Information, ...]:
    """Return the information entry with the progress of goal and order, in metres and percent.

    VDA 5050 3.0 section 6.6.4.
    """
    distances = {"goal": to_goal(robot), "order": to_end(robot)}
    driven = {name: length for name, length in distances.items() if length}
    if not driven:
        return ()
    references: list[ErrorReference] = []
    for name, length in driven.items():
        references.append(_error_reference(f"{name}DistanceLeft", f"{length.left:.2f}"))
        references.append(_error_reference(f"{name}Percent", str(length.percent)))
    drive = robot.reports.progress
    if drive and drive.recoveries and robot.goal.target is not None:
        references.append(_error_reference("recoveries", str(drive.recoveries)))
    sentences = [
        f"{length.left:.1f} m of the {name} left, {length.percent} % driven"
        for name, length in driven.items()
    ]
    return (
        Information(
            info_type="progress",
            info_level=InfoLevel.INFO,
            info_references=tuple(references),
            info_descriptor="; ".join(sentences),
        ),
    )


def intermediate_path(robot: RobotState, start: datetime) -> IntermediatePath | None:
    """Return navigation's plan with estimated times of arrival (section 6.6.2), None without a plan.

    ``start`` is the time at its beginning; the robot is assumed to drive as fast as it may.
    """
    limits = (robot.capabilities.maximum_speed, robot.speed_limit)
    speed = min(limit for limit in limits if limit is not None)
    plan = current_plan(robot)
    if plan is None or speed <= 0:
        return None
    lengths = [0.0]
    for start_point, end_point in pairwise(plan.points):
        lengths.append(lengths[-1] + dist(start_point, end_point))
    points = (
        PathPoint(x=x, y=y, eta=start + timedelta(seconds=length / speed))
        for (x, y), length in zip(plan.points, lengths, strict=True)
    )
    return IntermediatePath(polyline=tuple(points))


@lru_cache(maxsize=1024)
def _error_reference(key: str, value: str) -> ErrorReference:
    return ErrorReference(reference_key=key, reference_value=value)
