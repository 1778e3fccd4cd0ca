"""Errors that last as long as their cause, and the ROS session in the state (sections 6.6.5 and 6.6.6)."""

from __future__ import annotations

from functools import lru_cache

from nena_edge_agent.driver.port import SessionReport, SessionState
from nena_edge_agent.protocol import driving, edge_paths
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.geometry import radius
from nena_edge_agent.protocol.robot_state import (
    INSTANT_ACTION_LIMIT,
    NOT_REPORTED,
    PowerPhase,
    RobotState,
)
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference, ErrorType, error
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
    # The state lists new errors in this order.
    conditions: dict[str, ErrorEntry | None] = {
        ErrorType.LOCALIZATION_ERROR: _localization_error(robot),
        ErrorType.NAVIGATION_NOT_AVAILABLE: _navigation_error(robot),
        **_movement_errors(robot),
        **_drive_errors(robot),
        DEVIATION_TOO_SMALL: _deviation_error(robot),
        ErrorType.OUTSIDE_OF_CORRIDOR: edge_paths.outside_of_corridor(robot),
        EXTERNAL_GOAL: _external_goal(robot),
        **_agent_errors(robot),
    }
    for kind, entry in conditions.items():
        robot.errors.set_condition(kind, entry)
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
    reason = f": {pose.problem}" if pose and pose.problem else ""
    return error(
        ErrorType.LOCALIZATION_ERROR,
        f"the robot is not localised and does not drive{reason}",
        hint="set its initial position",
    )


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


def _movement_errors(robot: RobotState) -> dict[str, ErrorEntry | None]:
    """Report a robot that moves, or may move, without being told to: a person must stop it."""
    errors: dict[str, ErrorEntry | None] = dict.fromkeys((ROBOT_NOT_STOPPED, MOVES_WITHOUT_ORDER))
    if problem := robot.goal.halt_problem:
        errors[ROBOT_NOT_STOPPED] = error(
            ROBOT_NOT_STOPPED,
            f"the robot was told to stop, but its standstill is not confirmed: {problem}",
            hint="stop the robot at its emergency stop, then check Nav2 and the odometry on the robot",
        ).with_level(ErrorLevel.FATAL)
    if driving.is_adrift(robot):
        errors[MOVES_WITHOUT_ORDER] = error(
            MOVES_WITHOUT_ORDER,
            "the robot moves, but it has no goal: neither its order nor another program's goal drives it",
            hint="stop it at its emergency stop, then check the robot's base and Nav2's controller; if a "
            "person drives it, set its mode to MANUAL first; if it stands and its odometry drifts, raise "
            "ros.goals.standstill_noise",
        ).with_level(ErrorLevel.FATAL)
    return errors


def _drive_errors(robot: RobotState) -> dict[str, ErrorEntry | None]:
    """Report what delays the drive to the next node."""
    errors: dict[str, ErrorEntry | None] = dict.fromkeys(
        (ROBOT_BLOCKED, COLLISION_STOP, DRIVE_RECOVERS, DRIVE_RETRIED)
    )
    node, goal, reports = robot.progress.next_node, robot.goal, robot.reports
    if node is None:
        return errors
    texts: dict[str, tuple[str, str]] = {}
    if blocked := reports.blocked:
        texts[ROBOT_BLOCKED] = (
            f"the robot has not moved for {blocked.seconds:g} s on its way to '{node.node_id}'",
            "clear its path; the drive fails when navigation gives up",
        )
    stop, drive, recovered_at = reports.collision, reports.progress, reports.recovered_at
    if goal.target is not None and stop is not None and stop.stops:
        texts[COLLISION_STOP] = (
            f"the collision monitor stops the robot on its way to '{node.node_id}' (field '{stop.polygon}')",
            "clear the area around the robot to continue; if it is clear, check the sensors",
        )
    # Nav2 reports the number of recoveries, not their end: each is shown for a while.
    recent = recovered_at is not None and robot.now - recovered_at <= RECOVERY_REPORT_TIME
    if goal.target is not None and drive is not None and drive.recoveries and recent:
        texts[DRIVE_RECOVERS] = (
            (
                f"navigation cannot drive to '{node.node_id}' and runs its recoveries: "
                "it clears its costmaps, spins, waits and backs up"
            ),
            "clear the path to the node; the drive fails when navigation gives up",
        )
    if goal.failures and goal.failed_at is None:
        texts[DRIVE_RETRIED] = (
            f"retry {goal.failures} of {goal.retries} to reach node '{node.node_id}': {goal.problem}",
            "check the robot's path; the drive fails after the last retry",
        )
    for kind, (text, hint) in texts.items():
        errors[kind] = error(kind, text, hint=hint, node_id=node.node_id, order_id=robot.progress.order_id)
    return errors


def _deviation_error(robot: RobotState) -> ErrorEntry | None:
    """Report the next node whose allowed deviation is below Nav2's goal tolerance."""
    limits = robot.reports.limits
    if limits is None:
        return None
    capabilities = robot.capabilities
    for node in robot.progress.nodes:
        position = node.node_position
        if position is None:
            continue
        xy = radius(position, capabilities.default_deviation_xy)
        theta = position.allowed_deviation_theta or capabilities.default_deviation_theta
        least_theta = limits.theta_tolerance
        if xy < limits.tolerance:
            text = f"{xy:g} m, but Nav2's goal tolerance is {limits.tolerance:g} m"
            parameter = "xy_goal_tolerance"
        # Without theta the goal has no heading to miss (7.3, nodePosition).
        elif position.theta is not None and least_theta is not None and theta < least_theta:
            text = f"{theta:g} rad, but Nav2's goal tolerance is {least_theta:g} rad"
            parameter = "yaw_goal_tolerance"
        else:
            continue
        return error(
            DEVIATION_TOO_SMALL,
            f"node '{node.node_id}' allows a deviation of {text}: the drive can fail",
            hint=f"increase the node's allowed deviation, or lower {parameter} of Nav2's goal checker",
            node_id=node.node_id,
            order_id=robot.progress.order_id,
        )
    return None


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


def _agent_errors(robot: RobotState) -> dict[str, ErrorEntry | None]:
    """Report what keeps the agent itself from doing its work."""
    errors: dict[str, ErrorEntry | None] = dict.fromkeys(
        (
            JOURNAL_NOT_WRITTEN,
            SUBSCRIPTION_REFUSED,
            ACTION_PLUGIN_UNUSABLE,
            ErrorType.INSTANT_ACTION_STATES_FULL,
        )
    )
    if robot.journal_problem:
        errors[JOURNAL_NOT_WRITTEN] = error(
            JOURNAL_NOT_WRITTEN,
            f"the journal cannot be written: {robot.journal_problem}",
            hint="fix the agent's disk; until then no action starts, no order is accepted, and the state "
            "shows what is on the disk",
        ).with_level(ErrorLevel.FATAL)
    if robot.refused_topics:
        errors[SUBSCRIPTION_REFUSED] = error(
            SUBSCRIPTION_REFUSED,
            f"the broker refuses the robot's subscriptions: {', '.join(robot.refused_topics)}",
            hint="allow the robot to subscribe to its own topics in the broker's access list",
        ).with_level(ErrorLevel.URGENT)
    if robot.plugin_problems:
        errors[ACTION_PLUGIN_UNUSABLE] = error(
            ACTION_PLUGIN_UNUSABLE,
            f"actions are missing: {'; '.join(robot.plugin_problems)}",
            hint="fix the plug-in, or list the wanted ones in actions.plugins, and restart the agent",
        )
    # The core's own instant actions still start: fleet control can cancel and pause.
    if robot.instant_actions_running >= INSTANT_ACTION_LIMIT:
        errors[ErrorType.INSTANT_ACTION_STATES_FULL] = error(
            ErrorType.INSTANT_ACTION_STATES_FULL,
            f"{INSTANT_ACTION_LIMIT} instant actions are running; the robot starts no more",
            hint="wait until some of them have ended",
        )
    return errors
