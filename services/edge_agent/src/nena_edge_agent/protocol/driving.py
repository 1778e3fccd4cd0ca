"""Drive along the order: enter edges, send goals, traverse nodes (sections 6.6.1 to 6.6.3)."""

from __future__ import annotations

from itertools import islice, pairwise
from math import atan2, dist, pi, sin

from nena_edge_agent.driver import port
from nena_edge_agent.protocol import actions, edge_paths, zones
from nena_edge_agent.protocol.action_states import allow_driving
from nena_edge_agent.protocol.capabilities import Capabilities, DriveStrategy, ExternalGoals
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import Drive, LimitSpeed
from nena_edge_agent.protocol.geometry import (
    distance,
    heading_matches,
    is_same_position,
    is_within_deviation,
    radius,
    turn,
)
from nena_edge_agent.protocol.robot_state import EdgeEnd, RobotState
from nena_shared.vda5050.error import ErrorType, error
from nena_shared.vda5050.order import Edge, Node, NodePosition
from nena_shared.vda5050.own_actions import BEHAVIOR_TREE, USE_BEHAVIOR_TREE

HALT_TIMEOUT = 5.0
"""Seconds after which a halt without an answer is requested again."""
ROLL_OUT_TIME = 5.0
"""Seconds in which a robot may roll out after a drive; beyond, it counts as moving without an order."""
POSES_AHEAD = 20
"""Maximum number of poses ahead in a goal; later ones are sent while the robot drives."""
CORNER_CUT_DISTANCE = 0.7
"""Distance from a pose at which Nav2's default tree drops it and heads for the next one, metres."""
RETRIED = frozenset(
    {
        port.DriveFailure.ABORTED,
        port.DriveFailure.NOT_TAKEN_UP,
        port.DriveFailure.OUTSIDE_TOLERANCE,
        port.DriveFailure.NAVIGATION_GONE,
    }
)
"""Failures that are retried; a cancelled or replaced goal was ended on purpose."""
TRANSIENT_RETRIES = 3
"""Least number of retries if the cause of a failure is transient, as at a restart of navigation."""
TRANSIENT_WAIT = 2.0
"""Shortest delay of these retries, seconds: Nav2 says that it is not active up to 4 s after the death of a
server (the time-out of its bond), and then the last retry waits for it."""


def advance(robot: RobotState) -> None:
    """Take the steps that are due: repeat an unanswered halt, stop the robot, or drive on."""
    since = robot.goal.halting_since
    if since is not None and robot.now - since >= HALT_TIMEOUT:
        robot.request_halt()
    if _must_stop(robot):
        # after a restart navigation may continue the earlier goal until the first pose arrives
        (stop if robot.reports.pose is not None else halt)(robot)
        return
    node, pose = robot.progress.next_node, robot.reports.localized_pose
    position = node.node_position if node else None
    # An update, a zone or an action may have changed the poses after the next node.
    if (
        robot.goal.target is not None
        and node
        and position
        and pose
        and _poses_ahead(robot) != robot.goal.ahead
    ):
        _send_goal(robot, node, position, pose)
    while _may_drive(robot):
        if goals := robot.reports.goals.external:
            text = f"navigation is driving to another program's goal ({goals[0].goal_id})"
            _fail_drive(robot, port.DriveFailure.TAKEN_OVER, text)
            return
        # The actions of an edge start when it is entered, and may forbid driving (6.2.2, 6.6.2).
        if not robot.progress.edge_entered:
            actions.enqueue(robot, robot.progress.enter_edge().actions)
        node, pose = robot.progress.next_node, robot.reports.localized_pose
        if not robot.driving_allowed or node is None or node.node_position is None or pose is None:
            return  # order acceptance excludes a node without a position
        if not _is_already_at(robot, node.node_position, pose):
            _send_goal(robot, node, node.node_position, pose)
            return
        # An edge of no length, as to start new actions at a node (6.1.2, figure 7).
        _traverse_node(robot)


def halt(robot: RobotState) -> None:
    """Stop the robot if it has a goal."""
    if robot.goal.target is not None:
        robot.goal.target = None
        robot.request_halt()


def stop(robot: RobotState) -> None:
    """Stop the robot, also if its goal is from an earlier run and not adopted yet."""
    if robot.goal.pending and not robot.goal.halting:
        robot.goal.target = None
        robot.request_halt()
    halt(robot)


def confirm_standstill(robot: RobotState) -> bool:
    """Return whether the robot does not move for us; stop it if it moves without a goal or an action."""
    if not robot.moves:
        return True
    if not robot.goal.moving and not robot.action_may_move:
        robot.request_halt()
    return False


def new_base_request(robot: RobotState) -> bool:
    """Return whether the end of the base is near and a horizon is left (section 6.6.3).

    A robot that passes nodes requests a new base early enough to pass the end of the old one at full speed.
    """
    nodes, pose = robot.progress.nodes, robot.reports.localized_pose
    if not nodes or nodes[-1].released or robot.clearing:
        return False
    capabilities = robot.capabilities
    request_distance = capabilities.base_request_distance
    if capabilities.strategy is DriveStrategy.PASS_THROUGH:
        driven = capabilities.maximum_speed * capabilities.base_request_time
        request_distance = max(request_distance, _hand_over(robot) + driven)
    if pose is None:
        return True  # the distance is unknown
    base = (node.node_position for node in nodes if node.released)
    path = [(pose.x, pose.y), *((position.x, position.y) for position in base if position)]
    return sum(dist(start, end) for start, end in pairwise(path)) <= request_distance


# Reports of the driver


def arrived(robot: RobotState, event: port.Arrived) -> None:
    """Count the goal's node as traversed (section 6.6.2)."""
    if robot.goal.is_current(event.generation):
        _traverse_node(robot)


def failed(robot: RobotState, event: port.DriveFailed) -> None:
    """Stop the robot, and schedule a retry or report the failure (section 6.6.5.1).

    The order stays active: fleet control decides what to do.
    """
    if not robot.goal.is_current(event.generation):
        return
    robot.goal.record_end()
    # the controller may drive on without the navigator, or the base without the controller (Nav2 aborts with
    # code 0 when controller_server dies, and a base without a command time-out keeps its last speed)
    robot.request_halt()
    pauses = robot.capabilities.external_goals is ExternalGoals.PAUSE
    retries, wait = robot.capabilities.drive_retries, robot.capabilities.retry_wait
    if event.transient:
        retries, wait = max(retries, TRANSIENT_RETRIES), max(wait, TRANSIENT_WAIT)
    if event.failure is port.DriveFailure.TAKEN_OVER and pauses:
        robot.goal.target = None  # resent when the other drive has ended
    elif event.failure in RETRIED and robot.goal.failures < retries:
        problem = f"{event.description} ({event.failure})"
        robot.goal.retry(robot.now + wait, problem, retries)
    else:
        _fail_drive(robot, event.failure, event.description, event.hint, event.code)


def halted(robot: RobotState) -> None:
    """Record that the robot has no goal of ours and has stopped, unless it drives for another program."""
    robot.goal.halting_since, robot.goal.halt_problem = None, ""
    robot.goal.stood = not robot.reports.goals.external
    robot.goal.target, robot.goal.path = None, ()
    robot.goal.record_end()


def halt_failed(robot: RobotState, description: str) -> None:
    """Record that the robot's standstill is not confirmed; the halt is repeated until it is."""
    robot.goal.halt_problem = description
    if robot.goal.halting_since is None:
        robot.goal.halting_since = robot.now


def navigation_changed(robot: RobotState, report: port.NavigationReport) -> None:
    """Resend the goal when navigation is available again, because it may have lost the goal."""
    if report.available and not robot.reports.navigation.available:
        robot.goal.target = None
    robot.reports.navigation = report


def pose_changed(robot: RobotState) -> None:
    """Traverse the next node if the robot is within its deviation and need not stop (section 6.6.2)."""
    node = robot.progress.next_node
    passing = robot.capabilities.strategy is DriveStrategy.PASS_THROUGH
    if passing and node and robot.goal.target is not None and _may_pass(robot, node):
        _traverse_node(robot)


def watch_movement(robot: RobotState) -> None:
    """Record since when the robot moves although nothing drives it.

    Once that is reported, only standstill ends it.
    """
    velocity = robot.reports.velocity
    if velocity.vx is None:
        return  # it is unknown whether the robot moves
    if not velocity.moves:
        robot.moves_since = None
    elif not is_adrift(robot):
        driven = robot.goal.moving or robot.goal.pending or bool(robot.reports.goals.external)
        by_hand = not robot.next_mode.fleet_controls
        if driven or by_hand or robot.action_may_move:
            robot.moves_since = None
        elif robot.moves_since is None:
            robot.moves_since = robot.now


def is_adrift(robot: RobotState) -> bool:
    """Return whether the robot has moved for a while although nothing drives it."""
    return robot.moves_since is not None and robot.now - robot.moves_since >= ROLL_OUT_TIME


# Conditions


def _must_stop(robot: RobotState) -> bool:
    return (
        robot.hold_applied
        or robot.clearing
        or robot.link.must_stop(robot.now)
        # Without a pose the robot could not tell that it has left its path or entered a zone.
        or robot.reports.localized_pose is None
        or (
            (robot.goal.target is not None or robot.goal.pending)
            and (_is_barred(robot) or not robot.instant_queue.driving_allowed)
        )
    )


def _may_drive(robot: RobotState) -> bool:
    node = robot.progress.next_node
    return (
        node is not None
        and robot.reports.navigation.available
        and not robot.goal.halting
        and not robot.waits_for_external_goal
        and not robot.link.out_of_reach(robot.now)
        and (robot.goal.retry_at is None or robot.now >= robot.goal.retry_at)
        # A failed node waits for fleet control: an update or a cancelOrder (6.6.5.1).
        and robot.goal.failed_at != node.sequence_id
        and robot.goal.target is None
        and robot.driving_allowed
        and not _is_barred(robot)
        # After a restart costmaps may have no mask yet, and Nav2 would plan through BLOCKED zones.
        and not zones.awaits_keep_out(robot)
    )


def _is_barred(robot: RobotState) -> bool:
    """Return whether a zone stops the robot, or it has left its path."""
    return zones.must_stop(robot) or edge_paths.deviation_from_path(robot) > 0.0


def _may_pass(robot: RobotState, node: Node) -> bool:
    """Return whether the robot is within the deviation of ``node`` and may drive on without a stop."""
    pose, position = robot.reports.localized_pose, node.node_position
    edge, beyond = robot.progress.edges[0], next(islice(robot.progress.edges, 1, None), None)
    if pose is None or position is None or beyond is None or not beyond.released:
        return False
    capabilities = robot.capabilities
    on_path = edge_paths.follows(edge, capabilities)
    # At this distance the next goal is sent: early enough that navigation does not slow down first.
    driven = abs(robot.reports.velocity.vx or 0.0) * capabilities.hand_over_time
    pass_radius = max(capabilities.pass_radius, _hand_over(robot) + driven)
    after = next(islice(robot.progress.nodes, 1, None), None)
    end = after.node_position if after else None
    return (
        robot.driving_allowed
        and not robot.link.out_of_reach(robot.now)
        # SOFT and HARD actions at the node or on the next edge need a stop (6.2.2).
        and allow_driving(node.actions)
        and allow_driving(beyond.actions)
        and on_path == edge_paths.follows(beyond, capabilities)
        # Nav2 ends a goal with another tree than the running one instead of replacing it (onPreempt).
        and _behavior_tree(beyond) == _behavior_tree(edge)
        and ((capabilities.drives_ahead and not on_path) or distance(pose, position) <= pass_radius)
        and is_within_deviation(pose, position, capabilities.default_deviation_xy)
        and heading_matches(pose, position, capabilities.default_deviation_theta)
        and (end is None or zones.first_barred(robot, position, end, edge=1) is None)
    )


def _hand_over(robot: RobotState) -> float:
    """Return the distance from a goal, m, at which navigation slows down or counts it as reached."""
    limits = robot.reports.limits
    return limits.hand_over if limits else robot.capabilities.hand_over_distance


def _is_already_at(robot: RobotState, position: NodePosition, pose: port.Pose) -> bool:
    """Return whether the edge to ``position`` has no length and the robot is already there, as required.

    It may have been turned by hand since, or have begun its order with another heading than its first node's.
    """
    last, capabilities = robot.progress.last_node if robot.progress.on_last_node else None, robot.capabilities
    same = last and last.node_position and is_same_position(last.node_position, position)
    return (
        bool(same)
        and is_within_deviation(pose, position, capabilities.default_deviation_xy)
        and heading_matches(pose, position, capabilities.default_deviation_theta)
    )


# Steps


def _send_goal(robot: RobotState, node: Node, position: NodePosition, pose: port.Pose) -> None:
    goal, capabilities = robot.goal, robot.capabilities
    goal.generation += 1
    goal.ahead = _poses_ahead(robot)
    goal.target, goal.retry_at, goal.stood = node.sequence_id, None, False
    # The robot may be moved from now on, whether or not navigation accepts the goal.
    robot.progress.leave_node()
    robot.charging = False
    edge = robot.progress.edges[0]
    path = edge_paths.path_poses(robot, pose, position)
    # Without theta the standard leaves the heading to the robot (7.3, nodePosition): that of travel.
    theta = position.theta
    deviation_theta: float | None = None
    if theta is not None:
        deviation_theta = position.allowed_deviation_theta or capabilities.default_deviation_theta
    elif path:
        theta = path[-1].theta
    elif distance(pose, position):
        theta = atan2(position.y - pose.y, position.x - pose.x)
    else:
        theta = pose.theta
    drive = port.DriveGoal(
        generation=goal.generation,
        pose=port.Pose(position.x, position.y, theta, position.map_id),
        deviation_xy=radius(position, capabilities.default_deviation_xy),
        deviation_theta=deviation_theta,
        maximum_speed=edge.maximum_speed,
        ahead=goal.ahead,
        # A path goes to the controller, which runs no behaviour tree.
        behavior_tree="" if path else _behavior_tree(edge),
        path=path,
    )
    robot.reports.progress = None  # belongs to the goal before
    listed = robot.reports.goals.goals
    goal.record_sent(drive.pose, listed[-1].goal_id if listed else "")
    robot.effects.append(Drive(drive))


def _behavior_tree(edge: Edge) -> str:
    """Return the behaviour tree named by an action of ``edge``; empty: navigation's default."""
    trees = (action for action in edge.actions if action.action_type == USE_BEHAVIOR_TREE)
    return next((str(action.parameter(BEHAVIOR_TREE)) for action in trees), "")


def _traverse_node(robot: RobotState) -> None:
    robot.goal.target = None
    robot.goal.record_end()
    robot.goal.forget_failures()
    node, edge = robot.progress.traverse()
    # A node counts as traversed within its deviation (6.6.2), so the robot may still be on the edge: its
    # speed limit holds until the robot has left it, also for the next goal.
    pose, position, limit = robot.reports.localized_pose, node.node_position, edge.maximum_speed
    if limit is not None and pose and position and robot.capabilities.limits_speed:
        within = max(radius(position, robot.capabilities.default_deviation_xy), distance(pose, position))
        robot.edge_ends = (*robot.edge_ends, EdgeEnd(limit, position, pose, within))
        if robot.speed_limit is None or limit < robot.speed_limit:
            robot.speed_limit = limit
            robot.effects.append(LimitSpeed(limit))
    actions.end_with_edge(robot, edge)
    actions.enqueue(robot, node.actions)


def _fail_drive(
    robot: RobotState, failure: port.DriveFailure, description: str, hint: str = "", code: int = 0
) -> None:
    node = robot.progress.nodes[0]
    robot.goal.failed_at, robot.goal.target = node.sequence_id, None
    robot.errors.report(
        error(
            ErrorType.NODE_UNREACHABLE,
            f"node '{node.node_id}' was not reached: {description} ({failure})",
            hint=hint or "fix the cause",
            node_id=node.node_id,
            order_id=robot.progress.order_id,
            order_update_id=robot.progress.order_update_id,
            failure=failure,
            error_code=str(code) if code else None,
        ),
        Until.ORDER_OVER,
    )


# Poses after the next node, for a driver that passes several without a stop


def _poses_ahead(robot: RobotState) -> tuple[port.Pose, ...]:
    """Return the poses after the next node, up to the next stop or the end of the base.

    The robot stops at a node with a theta or with an action that requires standstill, at a corner that
    navigation would cut by more than the node allows, and before a zone that it must not enter.
    """
    capabilities, pose = robot.capabilities, robot.reports.localized_pose
    passes = capabilities.strategy is DriveStrategy.PASS_THROUGH and capabilities.drives_ahead
    if not passes or pose is None or robot.link.out_of_reach(robot.now):
        return ()
    progress = robot.progress
    if progress.edges and edge_paths.follows(progress.edges[0], capabilities):
        return ()
    previous: port.Pose | NodePosition = (progress.last_node and progress.last_node.node_position) or pose
    poses: list[port.Pose] = []
    edges = islice(progress.edges, 1, POSES_AHEAD + 1)
    tree = _behavior_tree(progress.edges[0]) if progress.edges else ""
    for node, edge, beyond in zip(progress.nodes, edges, islice(progress.nodes, 1, None), strict=False):
        here, there = node.node_position, beyond.node_position
        if here is None or there is None or not _can_pass_through(node, edge, previous, there, capabilities):
            break
        if zones.first_barred(robot, here, there) is not None or _behavior_tree(edge) != tree:
            break
        theta = there.theta if there.theta is not None else atan2(there.y - here.y, there.x - here.x)
        poses.append(port.Pose(there.x, there.y, theta, there.map_id))
        previous = here
    return tuple(poses)


def _can_pass_through(
    node: Node, edge: Edge, before: port.Pose | NodePosition, there: NodePosition, capabilities: Capabilities
) -> bool:
    """Return whether the robot can drive through ``node`` onto ``edge`` without a stop."""
    here = node.node_position
    # NavigateThroughPoses passes its poses in any heading.
    if here is None or here.theta is not None or not edge.released or edge_paths.follows(edge, capabilities):
        return False
    if not allow_driving(node.actions) or not allow_driving(edge.actions):
        return False
    if distance(before, here) == 0 or distance(here, there) == 0:
        return True
    inward = atan2(here.y - before.y, here.x - before.x)
    bend = abs(turn(inward, atan2(there.y - here.y, there.x - here.x)))
    # Nav2 heads for the next pose CORNER_CUT_DISTANCE before this one, and so misses the corner by this much.
    corner_cut = CORNER_CUT_DISTANCE * sin(min(bend, pi / 2))
    return corner_cut <= radius(here, capabilities.default_deviation_xy)


def limit_speed(robot: RobotState) -> None:
    """Apply the lowest speed limit of zones and edges within the braking distance (section 6.4).

    The limit of the current edge is part of its goal.
    """
    pose = robot.reports.localized_pose
    if not robot.capabilities.limits_speed or pose is None:
        return
    # A traversed edge's limit holds until the robot has passed its node or left its surroundings.
    robot.edge_ends = tuple(end for end in robot.edge_ends if end.is_ahead_of(pose))
    left = (end.maximum_speed for end in robot.edge_ends)
    limit = min((*zones.speed_limits(robot), *_edge_speed_limits(robot), *left), default=None)
    if limit != robot.speed_limit:
        robot.speed_limit = limit
        robot.effects.append(LimitSpeed(limit))


def _edge_speed_limits(robot: RobotState) -> list[float]:
    """Return the speed limits, m/s, of the next edges within the braking distance."""
    pose = robot.reports.localized_pose
    passes = robot.capabilities.strategy is DriveStrategy.PASS_THROUGH and robot.goal.target is not None
    if pose is None or not passes:
        return []
    place: port.Pose | NodePosition = pose
    limits: list[float] = []
    left = robot.capabilities.braking_distance
    for node, edge in zip(robot.progress.nodes, islice(robot.progress.edges, 1, None), strict=False):
        position = node.node_position
        if position is None or not edge.released:
            break
        left -= distance(place, position)
        if left < 0:
            break
        if edge.maximum_speed is not None:
            limits.append(edge.maximum_speed)
        place = position
    return limits
