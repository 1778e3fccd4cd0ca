"""Errors that last as long as their cause (sections 6.6.5 and 6.6.6)."""

from __future__ import annotations

from nena_edge_agent.driver.port import PoseReport
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.instant_actions import STATES_KEPT, under_way
from nena_edge_agent.protocol.parts import NOT_REPORTED, RobotParts
from nena_edge_agent.protocol.session import switched_off
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference, ErrorType, error

ROBOT_NOT_STOPPED = "ROBOT_NOT_STOPPED"
ROBOT_BLOCKED = "ROBOT_BLOCKED"
DRIVE_RETRIED = "DRIVE_RETRIED"
EXTERNAL_GOAL = "EXTERNAL_GOAL"
JOURNAL_NOT_WRITTEN = "JOURNAL_NOT_WRITTEN"
JOURNAL_LOST = "JOURNAL_LOST"
SUBSCRIPTION_REFUSED = "SUBSCRIPTION_REFUSED"
ACTION_PLUGIN_UNUSABLE = "ACTION_PLUGIN_UNUSABLE"


def check_conditions(parts: RobotParts) -> None:
    """Show or take back what hinders the robot at the moment."""
    parts.errors.condition(ErrorType.LOCALIZATION_ERROR, _localisation(parts))
    parts.errors.condition(ErrorType.NAVIGATION_NOT_AVAILABLE, _navigation(parts))
    parts.errors.condition(ROBOT_NOT_STOPPED, _not_stopped(parts))
    parts.errors.condition(ROBOT_BLOCKED, _blocked(parts))
    parts.errors.condition(DRIVE_RETRIED, _retried(parts))
    parts.errors.condition(EXTERNAL_GOAL, _external_goal(parts))
    parts.errors.condition(JOURNAL_NOT_WRITTEN, _journal(parts))
    parts.errors.condition(SUBSCRIPTION_REFUSED, _subscriptions(parts))
    parts.errors.condition(ACTION_PLUGIN_UNUSABLE, _plugins(parts))
    parts.errors.condition(ErrorType.INSTANT_ACTION_STATES_FULL, _instant_states(parts))
    takes_orders = parts.coming_mode.takes_orders and not switched_off(parts)
    if takes_orders and not parts.fatal:
        parts.errors.end(Until.AVAILABLE)


def _localisation(parts: RobotParts) -> ErrorEntry | None:
    pose = parts.senses.pose
    unknown_in_order = pose is None and parts.progress.next_node is not None
    if (pose is None or pose.localized) and not unknown_in_order:
        return None
    if switched_off(parts) and parts.idle:
        return None  # it does not look, and NAVIGATION_NOT_AVAILABLE says why
    return error(
        ErrorType.LOCALIZATION_ERROR,
        f"the robot does not know where it is, and does not drive{_why(pose)}",
        hint="set its initial position",
    )


def _why(pose: PoseReport | None) -> str:
    return f": {pose.problem}" if pose and pose.problem else ""


def _navigation(parts: RobotParts) -> ErrorEntry | None:
    """Show that navigation is missing, also without an order, so that fleet control sends none."""
    navigation = parts.senses.navigation
    order_id = parts.progress.order_id if parts.progress.next_node else None
    if navigation.available or (navigation is NOT_REPORTED and order_id is None):
        return None
    hint = "what was ordered goes on by itself when navigation is back"
    if parts.goal.failed_at is not None:
        hint = "have navigation come back; the drive that failed is not tried again before an update"
    return error(
        ErrorType.NAVIGATION_NOT_AVAILABLE,
        f"the robot cannot drive now: {navigation.reason}",
        hint=hint,
        order_id=order_id,
    )


def _not_stopped(parts: RobotParts) -> ErrorEntry | None:
    """Show that a person has to stop the robot."""
    problem = parts.goal.halt_problem
    if not problem:
        return None
    return ErrorEntry(
        error_type=ROBOT_NOT_STOPPED,
        error_level=ErrorLevel.FATAL,
        error_description=f"the robot was told to stop and cannot be shown to stand: {problem}",
        error_hint="stop the robot at its emergency stop, then check Nav2 and the odometry on the robot",
    )


def _blocked(parts: RobotParts) -> ErrorEntry | None:
    blocked, node = parts.senses.blocked, parts.progress.next_node
    if blocked is None or node is None:
        return None
    return ErrorEntry(
        error_type=ROBOT_BLOCKED,
        error_level=ErrorLevel.WARNING,
        error_description=f"the robot has not moved for {blocked.seconds:g} s on its way to '{node.node_id}'",
        error_hint="clear its way; navigation goes on trying, and the drive fails when it gives up",
        error_references=(
            ErrorReference(reference_key="nodeId", reference_value=node.node_id),
            ErrorReference(reference_key="orderId", reference_value=parts.progress.order_id),
        ),
    )


def _retried(parts: RobotParts) -> ErrorEntry | None:
    """Show that a drive does not go as it should, until it succeeds or fails for good."""
    node, goal = parts.progress.next_node, parts.goal
    if not goal.failures or goal.failed_at is not None or node is None:
        return None
    number, most = goal.failures, parts.capabilities.drive_retries
    return ErrorEntry(
        error_type=DRIVE_RETRIED,
        error_level=ErrorLevel.WARNING,
        error_description=f"try {number} of {most} to reach node '{node.node_id}' again: {goal.problem}",
        error_hint="look at the way of the robot; the drive fails after the last try",
        error_references=(
            ErrorReference(reference_key="nodeId", reference_value=node.node_id),
            ErrorReference(reference_key="orderId", reference_value=parts.progress.order_id),
        ),
    )


def _external_goal(parts: RobotParts) -> ErrorEntry | None:
    """Show what the order waits for while navigation drives for somebody else."""
    if not parts.gives_way or parts.progress.next_node is None or parts.goal.target is not None:
        return None
    (goal, *_) = parts.senses.goals.external
    return ErrorEntry(
        error_type=EXTERNAL_GOAL,
        error_level=ErrorLevel.WARNING,
        error_description=f"the order waits: navigation drives for somebody else (goal {goal.goal_id})",
        error_hint="it goes on by itself when that goal has ended; cancel either of them to end the wait",
        error_references=(
            ErrorReference(reference_key="goalId", reference_value=goal.goal_id),
            ErrorReference(reference_key="orderId", reference_value=parts.progress.order_id),
        ),
    )


def _journal(parts: RobotParts) -> ErrorEntry | None:
    if not parts.journal_problem:
        return None
    return ErrorEntry(
        error_type=JOURNAL_NOT_WRITTEN,
        error_level=ErrorLevel.FATAL,
        error_description=f"what the robot does is not kept on disk: {parts.journal_problem}",
        error_hint="see to the agent's disk; until then the robot begins nothing and takes no orders, and "
        "its state shows what the disk has",
    )


def journal_lost(problem: str) -> ErrorEntry:
    """Make the error of a robot that does not know what it was doing; ``problem`` says what to do."""
    return ErrorEntry(
        error_type=JOURNAL_LOST,
        error_level=ErrorLevel.FATAL,
        error_description=f"what the robot was doing is not known: {problem}",
        error_hint="see where the robot is and what it carries, then do what the description says",
    )


def _subscriptions(parts: RobotParts) -> ErrorEntry | None:
    if not parts.refused_topics:
        return None
    return ErrorEntry(
        error_type=SUBSCRIPTION_REFUSED,
        error_level=ErrorLevel.URGENT,
        error_description=f"the broker does not let the robot hear {', '.join(parts.refused_topics)}",
        error_hint="let the robot subscribe to its own topics in the broker's access list",
    )


def _plugins(parts: RobotParts) -> ErrorEntry | None:
    if not parts.plugin_problems:
        return None
    return ErrorEntry(
        error_type=ACTION_PLUGIN_UNUSABLE,
        error_level=ErrorLevel.WARNING,
        error_description=f"actions are missing: {'; '.join(parts.plugin_problems)}",
        error_hint="put the plug-in right, or name those that are wanted in actions.plugins, and start anew",
    )


def _instant_states(parts: RobotParts) -> ErrorEntry | None:
    """Show that no more instant actions are begun, but those that the robot does at once."""
    if under_way(parts) < STATES_KEPT:
        return None
    return error(
        ErrorType.INSTANT_ACTION_STATES_FULL,
        f"{STATES_KEPT} instant actions are under way, the robot begins no more",
        hint="wait until some of them have ended",
    )
