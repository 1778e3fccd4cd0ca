"""Poses in the plane: headings and quaternions, tolerances of goals, uncertainty of the localisation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from nena_edge_agent.driver.port import DriveGoal, Pose
from nena_edge_agent.nav2.settings import LocalisationSettings
from nena_shared.ros import wrap

SAME = 0.001
"""Maximum difference between two poses of the same node, metres or radians."""
PLAN_POINTS = 100
"""Maximum number of reported points of a plan, excluding its end."""


def thinned(points: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Return a limited number of points of a plan, always including the last one."""
    step = max(1, -(-len(points) // PLAN_POINTS))
    return (*points[:-1:step], *points[-1:])


@dataclass(frozen=True, slots=True)
class PoseReading:
    """A pose of the localisation: m, rad, variances in m² and rad², stamp in ns by the robot's clock."""

    x: float
    y: float
    yaw: float
    frame: str
    stamp: int
    x_variance: float
    y_variance: float
    yaw_variance: float


def quaternion_of(yaw: float) -> tuple[float, float]:
    """Return z and w of the unit quaternion of a heading in rad; x and y are 0."""
    half = wrap(yaw) / 2.0
    return math.sin(half), math.cos(half)


def localized(reading: PoseReading, settings: LocalisationSettings) -> bool:
    """Return whether the pose is certain enough; one without a valid variance is not."""
    xy_limit, yaw_limit = settings.xy_spread_limit**2, settings.theta_spread_limit**2
    # Zeros count as certain: ROS initialises a covariance with them, if none is set. NaN compares false.
    return (
        0.0 <= reading.x_variance <= xy_limit
        and 0.0 <= reading.y_variance <= xy_limit
        and 0.0 <= reading.yaw_variance <= yaw_limit
    )


def near(pose: Pose, place: Pose, *, xy: float, theta: float | None) -> bool:
    """Return whether ``pose`` is within ``xy`` m and ``theta`` rad (None: any heading) of ``place``."""
    if math.hypot(pose.x - place.x, pose.y - place.y) > xy:
        return False
    return theta is None or abs(wrap(pose.theta - place.theta)) <= theta


def has_reached(pose: Pose, goal: DriveGoal, *, xy_slack: float = 0.0, theta_slack: float = 0.0) -> bool:
    """Return whether a robot at ``pose`` has reached ``goal``; the slacks (m, rad) widen the tolerance."""
    theta = None if goal.deviation_theta is None else goal.deviation_theta + theta_slack
    return near(pose, goal.pose, xy=goal.deviation_xy + xy_slack, theta=theta)


def pose_problem(pose: Pose, map_id: str) -> str | None:
    """Return why a robot on the map ``map_id`` cannot be sent to ``pose``, None if it can."""
    if pose.map_id != map_id:
        return f"the goal is on map '{pose.map_id}', the robot on '{map_id}'"
    # Nav2 refuses neither NaN nor inf, and its planner_server may crash on such a goal.
    if not all(map(math.isfinite, (pose.x, pose.y, pose.theta))):
        return f"x {pose.x}, y {pose.y}, heading {pose.theta} is not a valid pose"
    return None
