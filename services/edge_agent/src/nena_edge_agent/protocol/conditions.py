"""Errors that last as long as their cause, and the ROS session in the state (sections 6.6.5 and 6.6.6)."""

from __future__ import annotations

from functools import lru_cache

from nena_edge_agent.driver.port import DriveLimits, PoseReport, SessionReport, SessionState
from nena_edge_agent.protocol import driving, edge_paths
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.geometry import radius
from nena_edge_agent.protocol.robot_state import (
    INSTANT_ACTION_LIMIT,
    NOT_REPORTED,
    PowerPhase,
    RobotState,
)
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference, ErrorType, error
from nena_shared.vda5050.order import NodePosition
from nena_shared.vda5050.own_actions import CONFIGURE_ROS_SESSION, ROS_SESSION, STOP_ROS_SESSION
from nena_shared.vda5050.state import InfoLevel, Information

ROBOT_NOT_STOPPED = "ROBOT_NOT_STOPPED"
MOVES_WITHOUT_ORDER = "MOVES_WITHOUT_ORDER"
ROBOT_BLOCKED = "ROBOT_BLOCKED"
COLLISION_STOP = "COLLISION_STOP"
COLLISION_MONITOR = "collisionMonitor"
DRIVE_RECOVERS = "DRIVE_RECOVERS"
DRIVE_RETRIED = "DRIVE_RETRIED"
DEVIATION_TOO_SMALL = "DEVIATION_TOO_SMALL"
EXTERNAL_GOAL = "EXTERNAL_GOAL"
JOURNAL_NOT_WRITTEN = "JOURNAL_NOT_WRITTEN"
JOURNAL_LOST = "JOURNAL_LOST"
SUBSCRIPTION_REFUSED = "SUBSCRIPTION_REFUSED"
ACTION_PLUGIN_UNUSABLE = "ACTION_PLUGIN_UNUSABLE"

RECOVERY_REPORT_TIME = 15.0
"""Seconds for which a recovery is reported."""

SESSION_OFF = frozenset({SessionState.NOT_ACTIVE, SessionState.TERMINATING})
"""States of a session that was stopped on request; in all others it is active or starting."""
SESSION_CHANGES = (STOP_ROS_SESSION, CONFIGURE_ROS_SESSION)


def check_conditions(robot: RobotState) -> None:
    """Report or withdraw the errors of current conditions (section 6.6.5)."""
    robot.errors.set_condition(ErrorType.LOCALIZATION_ERROR, _localization_error(robot))
    robot.errors.set_condition(ErrorType.NAVIGATION_NOT_AVAILABLE, _navigation_error(robot))
    robot.errors.set_condition(ROBOT_NOT_STOPPED, _not_stopped(robot))
    robot.errors.set_condition(MOVES_WITHOUT_ORDER, _adrift_error(robot))
    robot.errors.set_condition(ROBOT_BLOCKED, _blocked_error(robot))
    robot.errors.set_condition(COLLISION_STOP, _collision_error(robot))
    robot.errors.set_condition(DRIVE_RECOVERS, _recovery_error(robot))
    robot.errors.set_condition(DRIVE_RETRIED, _retry_error(robot))
    robot.errors.set_condition(DEVIATION_TOO_SMALL, _deviation_error(robot))
    robot.errors.set_condition(ErrorType.OUTSIDE_OF_CORRIDOR, edge_paths.outside_of_corridor(robot))
    robot.errors.set_condition(EXTERNAL_GOAL, _external_goal(robot))
    robot.errors.set_condition(JOURNAL_NOT_WRITTEN, _journal_error(robot))
    robot.errors.set_condition(SUBSCRIPTION_REFUSED, _subscriptions_error(robot))
    robot.errors.set_condition(ACTION_PLUGIN_UNUSABLE, _plugins_error(robot))
    robot.errors.set_condition(ErrorType.INSTANT_ACTION_STATES_FULL, _instant_actions(robot))
    takes_orders = robot.next_mode.takes_orders and not session_problem(robot)
    # Errors of orders refused for want of a robot end when there is one again (6.6.5.4).
    if takes_orders and robot.power is PowerPhase.AWAKE and not robot.fatal:
        robot.errors.end(Until.AVAILABLE)


def session_problem(robot: RobotState) -> str:
    """Return why the ROS session keeps the robot from taking orders; empty if it does not.

    A failed session does not: it restarts automatically, and an order waits for it.
    """
    session = robot.reports.session
    if session is None:
        return ""
    if session.state in SESSION_OFF:
        return "its ROS session is not active"
    switching = any(map(robot.running_instant_actions, SESSION_CHANGES))
    return "its ROS session is being switched" if switching else ""


@lru_cache(maxsize=64)
def session_information(session: SessionReport | None) -> tuple[Information, ...]:
    """Return the information entry of the ROS session, empty for a robot without ROS (section 6.6.4)."""
    if session is None:
        return ()
    facts = {"state": session.state.value, "namespace": session.namespace, "domainId": str(session.domain_id)}
    text = f"the ROS session is {session.state}"
    return (
        Information(
            info_type=ROS_SESSION,
            info_level=InfoLevel.INFO,
            info_references=tuple(
                ErrorReference(reference_key=key, reference_value=value) for key, value in facts.items()
            ),
            info_descriptor=f"{text}: {session.reason}" if session.reason else text,
        ),
    )


_UNKNOWN_COLLISION = Information(
    info_type=COLLISION_MONITOR,
    info_level=InfoLevel.INFO,
    info_descriptor="it is unknown whether the collision monitor stops the robot: it publishes only changes, "
    "and none since the agent was started",
)


def collision_information(robot: RobotState) -> tuple[Information, ...]:
    """Return the information entry of a robot that stands with a goal and may be stopped unreported."""
    report = robot.reports.collision
    unknown = report is not None and report.stops is None
    stands = robot.goal.target is not None and not robot.reports.velocity.moves
    return (_UNKNOWN_COLLISION,) if unknown and stands else ()


def journal_lost(problem: str) -> ErrorEntry:
    """Return the error of a robot whose journal is lost; ``problem`` includes what to do."""
    return error(
        JOURNAL_LOST,
        f"it is unknown what the robot was doing: {problem}",
        hint="check where the robot is and what it carries, then follow the description",
    ).with_level(ErrorLevel.FATAL)


def _localization_error(robot: RobotState) -> ErrorEntry | None:
    pose = robot.reports.pose
    unknown_in_order = pose is None and robot.progress.next_node is not None
    if (pose is None or pose.localized) and not unknown_in_order:
        return None
    if pose is None and robot.reports.navigation.starting:
        return None  # still searching for navigation
    if session_problem(robot) and robot.idle:
        return None  # expected, and explained by NAVIGATION_NOT_AVAILABLE
    return error(
        ErrorType.LOCALIZATION_ERROR,
        f"the robot is not localised and does not drive{_pose_problem(pose)}",
        hint="set its initial position",
    )


def _pose_problem(pose: PoseReport | None) -> str:
    return f": {pose.problem}" if pose and pose.problem else ""


def _navigation_error(robot: RobotState) -> ErrorEntry | None:
    """Report missing navigation, also without an order, so that fleet control sends none."""
    navigation = robot.reports.navigation
    order_id = robot.progress.order_id if robot.progress.next_node else None
    if navigation.available or (navigation is NOT_REPORTED and order_id is None):
        return None
    hint = "the order continues automatically when navigation is available again"
    if robot.goal.failed_at is not None:
        hint = "restart navigation, then send an order update to retry the drive that failed"
    return error(
        ErrorType.NAVIGATION_NOT_AVAILABLE,
        f"the robot cannot drive now: {navigation.reason}",
        hint=hint,
        order_id=order_id,
    )


def _not_stopped(robot: RobotState) -> ErrorEntry | None:
    """Report that a person must stop the robot."""
    problem = robot.goal.halt_problem
    if not problem:
        return None
    return error(
        ROBOT_NOT_STOPPED,
        f"the robot was told to stop, but its standstill is not confirmed: {problem}",
        hint="stop the robot at its emergency stop, then check Nav2 and the odometry on the robot",
    ).with_level(ErrorLevel.FATAL)


def _adrift_error(robot: RobotState) -> ErrorEntry | None:
    """Report that a person must look at a robot that moves although nobody has told it to."""
    if not driving.is_adrift(robot):
        return None
    return error(
        MOVES_WITHOUT_ORDER,
        "the robot moves, but it has no goal: neither its order nor another program's goal drives it",
        hint="stop it at its emergency stop, then check the robot's base and Nav2's controller; if a person "
        "drives it, set its mode to MANUAL first; if it stands and its odometry drifts, raise "
        "ros.goals.standstill_noise",
    ).with_level(ErrorLevel.FATAL)


def _blocked_error(robot: RobotState) -> ErrorEntry | None:
    blocked, node = robot.reports.blocked, robot.progress.next_node
    if blocked is None or node is None:
        return None
    return error(
        ROBOT_BLOCKED,
        f"the robot has not moved for {blocked.seconds:g} s on its way to '{node.node_id}'",
        hint="clear its path; the drive fails when navigation gives up",
        node_id=node.node_id,
        order_id=robot.progress.order_id,
    )


def _collision_error(robot: RobotState) -> ErrorEntry | None:
    """Report that the collision monitor stops the robot on its route."""
    stop, node = robot.reports.collision, robot.progress.next_node
    if stop is None or not stop.stops or node is None or robot.goal.target is None:
        return None
    return error(
        COLLISION_STOP,
        f"the collision monitor stops the robot on its way to '{node.node_id}' (field '{stop.polygon}')",
        hint="clear the area around the robot to continue; if it is clear, check the sensors",
        node_id=node.node_id,
        order_id=robot.progress.order_id,
    )


def _recovery_error(robot: RobotState) -> ErrorEntry | None:
    """Report a recovery of navigation for ``RECOVERY_REPORT_TIME`` seconds."""
    progress, node, at = robot.reports.progress, robot.progress.next_node, robot.reports.recovered_at
    if progress is None or not progress.recoveries or node is None or at is None:
        return None
    if robot.now - at > RECOVERY_REPORT_TIME or robot.goal.target is None:
        return None
    return error(
        DRIVE_RECOVERS,
        f"navigation cannot drive to '{node.node_id}' and runs its recoveries: "
        "it clears its costmaps, spins, waits and backs up",
        hint="clear the path to the node; the drive fails when navigation gives up",
        node_id=node.node_id,
        order_id=robot.progress.order_id,
    )


def _retry_error(robot: RobotState) -> ErrorEntry | None:
    """Report a drive that is retried, until it succeeds or fails permanently."""
    node, goal = robot.progress.next_node, robot.goal
    if not goal.failures or goal.failed_at is not None or node is None:
        return None
    return error(
        DRIVE_RETRIED,
        f"retry {goal.failures} of {goal.retries} to reach node '{node.node_id}': {goal.problem}",
        hint="check the robot's path; the drive fails after the last retry",
        node_id=node.node_id,
        order_id=robot.progress.order_id,
    )


def _deviation_error(robot: RobotState) -> ErrorEntry | None:
    """Report the next node whose allowed deviation is below Nav2's goal tolerance."""
    limits = robot.reports.limits
    if limits is None:
        return None
    for node in robot.progress.nodes:
        small = node.node_position and _too_small(node.node_position, limits, robot.capabilities)
        if small:
            text, parameter = small
            return error(
                DEVIATION_TOO_SMALL,
                f"node '{node.node_id}' allows a deviation of {text}: the drive can fail",
                hint=f"increase the node's allowed deviation, or lower {parameter} of Nav2's goal checker",
                node_id=node.node_id,
                order_id=robot.progress.order_id,
            )
    return None


def _too_small(
    position: NodePosition, limits: DriveLimits, capabilities: Capabilities
) -> tuple[str, str] | None:
    """Return what is wrong with the allowed deviation, and Nav2's parameter; None: nothing."""
    xy = radius(position, capabilities.default_deviation_xy)
    if xy < limits.tolerance:
        return f"{xy:g} m, but Nav2's goal tolerance is {limits.tolerance:g} m", "xy_goal_tolerance"
    theta = position.allowed_deviation_theta or capabilities.default_deviation_theta
    least = limits.theta_tolerance
    if position.theta is None or least is None or theta >= least:
        return None
    return f"{theta:g} rad, but Nav2's goal tolerance is {least:g} rad", "yaw_goal_tolerance"


def _external_goal(robot: RobotState) -> ErrorEntry | None:
    """Report another program's goal that the order is waiting for."""
    next_step = robot.progress.next_node is not None or robot.standstill_by is not None
    if not (robot.waits_for_external_goal and next_step) or robot.goal.target is not None:
        return None
    (goal, *_) = robot.reports.goals.external
    return error(
        EXTERNAL_GOAL,
        f"the order waits: navigation is driving to another program's goal ({goal.goal_id})",
        hint="the order continues when that goal has ended; cancel either of them to end the wait",
        goal_id=goal.goal_id,
        order_id=robot.progress.order_id,
    )


def _journal_error(robot: RobotState) -> ErrorEntry | None:
    if not robot.journal_problem:
        return None
    return error(
        JOURNAL_NOT_WRITTEN,
        f"the journal cannot be written: {robot.journal_problem}",
        hint="fix the agent's disk; until then no action starts, no order is accepted, and the state "
        "shows what is on the disk",
    ).with_level(ErrorLevel.FATAL)


def _subscriptions_error(robot: RobotState) -> ErrorEntry | None:
    if not robot.refused_topics:
        return None
    return error(
        SUBSCRIPTION_REFUSED,
        f"the broker refuses the robot's subscriptions: {', '.join(robot.refused_topics)}",
        hint="allow the robot to subscribe to its own topics in the broker's access list",
    ).with_level(ErrorLevel.URGENT)


def _plugins_error(robot: RobotState) -> ErrorEntry | None:
    if not robot.plugin_problems:
        return None
    return error(
        ACTION_PLUGIN_UNUSABLE,
        f"actions are missing: {'; '.join(robot.plugin_problems)}",
        hint="fix the plug-in, or list the wanted ones in actions.plugins, and restart the agent",
    )


def _instant_actions(robot: RobotState) -> ErrorEntry | None:
    """Report that the robot starts no more instant actions, except those of the core."""
    if robot.instant_actions_running < INSTANT_ACTION_LIMIT:
        return None
    return error(
        ErrorType.INSTANT_ACTION_STATES_FULL,
        f"{INSTANT_ACTION_LIMIT} instant actions are running; the robot starts no more",
        hint="wait until some of them have ended",
    )
