"""Speed limits at the robot and ahead of it: SPEED_LIMIT zones and edges (section 6.4).

The limit of the edge that the robot drives on comes with its goal.
"""

from __future__ import annotations

from itertools import islice
from math import dist

from nena_edge_agent.protocol import zones
from nena_edge_agent.protocol.capabilities import DriveStrategy
from nena_edge_agent.protocol.events import LimitSpeed
from nena_edge_agent.protocol.robot_state import RobotState


def advance(robot: RobotState) -> None:
    """Apply the lowest limit, early enough to slow down before it applies."""
    if not robot.capabilities.limits_speed or robot.reports.localized_pose is None:
        return
    limit = min((*zones.speed_limits(robot), *_limits_of_edges(robot)), default=None)
    if limit != robot.speed_limit:
        robot.speed_limit = limit
        robot.effects.append(LimitSpeed(limit))


def _limits_of_edges(robot: RobotState) -> list[float]:
    """Return the limits of the edges behind the next nodes, as far as the robot needs to slow down."""
    pose = robot.reports.localized_pose
    passes = robot.capabilities.strategy is DriveStrategy.PASS_THROUGH and robot.goal.target is not None
    if pose is None or not passes:
        return []
    place = (pose.x, pose.y)
    found: list[float] = []
    left = robot.capabilities.braking_distance
    for node, edge in zip(robot.progress.nodes, islice(robot.progress.edges, 1, None), strict=False):
        position = node.node_position
        if position is None or not edge.released:
            break
        left -= dist(place, (position.x, position.y))
        if left < 0:
            break
        if edge.maximum_speed is not None:
            found.append(edge.maximum_speed)
        place = (position.x, position.y)
    return found
