"""Follow trajectories and corridors along the order (sections 6.1.5 and 7.3)."""

from __future__ import annotations

from itertools import islice
from math import dist

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol import courses
from nena_edge_agent.protocol.geometry import Point, in_place
from nena_edge_agent.protocol.robot_state import RobotState
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.order import Node, NodePosition


def path_of(robot: RobotState, index: int = 0) -> tuple[Point, ...]:
    """Return the path of the next edge, or of the one ``index`` after it; empty: navigation plans one."""
    progress = robot.progress
    edge = next(islice(progress.edges, index, None), None)
    node = next(islice(progress.nodes, index, None), None)
    before = progress.last_node if index == 0 else next(islice(progress.nodes, index - 1, None), None)
    if edge is None or node is None or node.node_position is None:
        return ()
    if not courses.follows(edge, robot.capabilities):
        return ()
    return courses.course(edge, before.node_position if before else None, node.node_position)


def poses_from(robot: RobotState, pose: Pose, position: NodePosition) -> tuple[Pose, ...]:
    """Return the path from ``pose`` to the next node, at ``position``, after the previous path."""
    path = path_of(robot)
    if not path:
        robot.goal.path = ()
        return ()
    place, before = (pose.x, pose.y), robot.goal.path
    if before and dist(before[-1], path[0]) <= courses.ENDS_WITHIN:
        path = (*courses.rest(before, place), *path[1:])
    else:
        path = courses.rest(path, place)
    robot.goal.path = path
    return courses.poses(path, position.map_id, position.theta)


def has_left(robot: RobotState) -> bool:
    """Return whether the robot is too far off the path of its edge to drive."""
    return _metres_outside(robot) > 0.0


def outside_of_corridor(robot: RobotState) -> ErrorEntry | None:
    """Return the error of a robot that has left its corridor, or the trajectory of its edge."""
    metres = _metres_outside(robot)
    if metres <= 0.0:
        return None
    edge = robot.progress.edges[0]
    allowed = f"may be {courses.OFF_TRAJECTORY:g} m off the trajectory of edge '{edge.edge_id}'"
    if edge.corridor is not None and not edge.corridor.release_required:
        allowed = f"must be in the corridor of edge '{edge.edge_id}'"
    return error(
        ErrorType.OUTSIDE_OF_CORRIDOR,
        f"the robot {allowed}, is {metres:.2f} m outside, and does not drive",
        hint="move the robot back by hand and check its position on the map, or cancel the order",
        edge_id=edge.edge_id,
        order_id=robot.progress.order_id,
    )


def _metres_outside(robot: RobotState) -> float:
    pose, path = robot.reports.localized_pose, path_of(robot)
    if pose is None or not path or not robot.progress.edges[0].released:
        return 0.0
    if any(_at(robot, pose, node) for node in (robot.progress.last_node, robot.progress.next_node)):
        return 0.0
    corridor = robot.progress.edges[0].corridor
    return courses.leaves(courses.corners(path), corridor, pose, robot.capabilities.footprint)


def _at(robot: RobotState, pose: Pose, node: Node | None) -> bool:
    position = node.node_position if node else None
    return position is not None and in_place(pose, position, robot.capabilities.default_deviation_xy)
