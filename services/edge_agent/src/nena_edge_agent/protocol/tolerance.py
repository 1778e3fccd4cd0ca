"""Whether a robot is where a node wants it: distances in m, angles in rad."""

from __future__ import annotations

from math import cos, hypot, pi, sin

from nena_edge_agent.driver.port import Pose
from nena_shared.vda5050.order import NodePosition


def radius(position: NodePosition, default: float) -> float:
    """Give the deviation that is allowed in every direction; 0 or none means the robot's own."""
    allowed = position.allowed_deviation_xy
    return min(allowed.a, allowed.b) or default if allowed else default


def distance(pose: Pose, position: NodePosition) -> float:
    """Give the straight distance."""
    return hypot(pose.x - position.x, pose.y - position.y)


def in_place(pose: Pose, position: NodePosition, default: float) -> bool:
    """Tell whether ``pose`` lies within the allowed ellipse around ``position``, on its map."""
    if pose.map_id != position.map_id:
        return False
    allowed = position.allowed_deviation_xy
    if allowed is None or not (allowed.a and allowed.b):
        return distance(pose, position) <= default
    dx, dy = pose.x - position.x, pose.y - position.y
    along = dx * cos(allowed.theta) + dy * sin(allowed.theta)
    across = dy * cos(allowed.theta) - dx * sin(allowed.theta)
    return hypot(along / allowed.a, across / allowed.b) <= 1.0


def heading_fits(pose: Pose, position: NodePosition, default: float) -> bool:
    """Tell whether the robot looks where ``position`` demands; without a demand it does."""
    if position.theta is None:
        return True
    return abs(turn(position.theta, pose.theta)) <= (position.allowed_deviation_theta or default)


def turn(start: float, end: float) -> float:
    """Give the shortest turn from ``start`` to ``end``, in [-π, π)."""
    return (end - start + pi) % (2 * pi) - pi


def same_place(one: NodePosition, other: NodePosition) -> bool:
    """Tell whether a robot that stands at ``one`` need not move for ``other``."""
    there = (one.x, one.y, one.map_id) == (other.x, other.y, other.map_id)
    return there and other.theta in (None, one.theta)
