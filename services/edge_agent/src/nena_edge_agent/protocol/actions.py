"""The life cycle of an order's actions: queue, start, pause, end (sections 6.2.2, 6.2.3 and 6.6.9)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf

from nena_edge_agent.protocol import zones
from nena_edge_agent.protocol.action_states import ActionRecord, ActionStates, loads_after
from nena_edge_agent.protocol.declaration import (
    CLEAR_INSTANT_ACTIONS,
    ENABLE_ZONE_SET,
    PREDEFINED,
    TRIGGER_TYPE,
    WAIT_FOR_TRIGGER,
    ActionDeclaration,
)
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import (
    ActionReport,
    CancelAction,
    PauseAction,
    ResumeAction,
    StartAction,
)
from nena_edge_agent.protocol.robot_state import RobotState
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorType, error
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import Edge

CoreAction = Callable[[RobotState, Action], tuple[ActionStatus, str | None]]
"""Executes or starts an action in the core; returns its new status and its result."""
STANDSTILL_TIMEOUT = 10.0
"""Seconds in which a robot must stand for a SOFT or HARD action, if something other than the order moves it.
"""


def enqueue(robot: RobotState, actions: Sequence[Action]) -> None:
    """Queue the actions of a reached node or entered edge; start those that may run now (section 6.2.2)."""
    robot.queue.append(actions)
    schedule(robot)


def schedule(robot: RobotState) -> None:
    """Start every action that may run now; a SOFT or HARD one waits until the robot stands (section 6.2.2).

    A drive succeeds within navigation's goal tolerance, where the robot still moves.
    """
    while startable := _startable_records(robot):  # an action that ends at once may unblock others
        stands = robot.stands
        ready = [record for record in startable if stands or not robot.needs_standstill(record)]
        for record in ready:
            robot.restarts.discard(record.action.action_id)
            states = robot.instant_actions if record.scope is ActionScope.INSTANT else robot.actions
            states.change(record.action.action_id, ActionStatus.INITIALIZING)
            _start_action(robot, record)
        if not ready:
            if not _standstill_overdue(robot):
                return
            velocity = robot.reports.velocity
            if goals := robot.reports.goals.external:
                motion = f"navigation is driving to another program's goal ({goals[0].goal_id})"
            elif velocity.vx is None:
                motion = "its velocity is unknown"
            else:
                motion = f"its odometry shows {velocity.vx:.2f} m/s, {velocity.omega or 0.0:.2f} rad/s"
            fail_waiting(robot, f"the robot did not stop within {STANDSTILL_TIMEOUT:.0f} s: {motion}")
    robot.standstill_by = None


def fail_waiting(robot: RobotState, reason: str) -> None:
    """Fail the actions that wait until the robot stands."""
    robot.standstill_by = None
    for record in _startable_records(robot):
        if robot.needs_standstill(record):
            apply_report(robot, ActionReport(record.action.action_id, ActionStatus.FAILED, reason))


def apply_report(robot: RobotState, report: ActionReport) -> None:
    """Apply a plug-in's report about an action of the order or an instant action (section 6.6.9)."""
    states = robot.actions if report.action_id in robot.actions else robot.instant_actions
    record = states.get(report.action_id)
    status = ActionStatus.RETRIABLE if record and _is_retriable(robot, record, report) else report.status
    if not record or not states.change(report.action_id, status, report.result):
        return
    if report.loads is not None:
        robot.loads = report.loads
    elif report.status is ActionStatus.FINISHED:
        robot.loads = loads_after(record.action, _declaration_of(robot, record), robot.loads)
    robot.charging = robot.charging if report.charging is None else report.charging
    robot.maps = robot.maps if report.maps is None else report.maps
    if report.error:
        robot.errors.report(report.error, Until.INSTANT_ACTION_ACCEPTED)
    if status.ended:
        robot.queue.remove(report.action_id)
        robot.instant_queue.remove(report.action_id)
        robot.restarts.discard(report.action_id)
    # Instant actions go on during a pause (6.2.3): only those of the order are paused. One may have started
    # during the pause, or have been paused after its end.
    if states is robot.actions:
        pausable = _declares_trait(robot, record, "pause_allowed")
        if robot.held and status is ActionStatus.RUNNING and pausable:
            robot.effects.append(PauseAction(report.action_id))
        elif not robot.held and status is ActionStatus.PAUSED:
            robot.effects.append(ResumeAction(report.action_id))
    instant = states is robot.instant_actions
    if report.status is ActionStatus.FAILED and (instant or not robot.clearing):
        until = Until.INSTANT_ACTION_ACCEPTED if instant else Until.ORDER_OVER
        robot.errors.report(_failure_entry(robot, record), until)


def pause(robot: RobotState) -> None:
    """Pause every running action that can be paused."""
    for record in robot.actions:
        if record.status is ActionStatus.RUNNING and _declares_trait(robot, record, "pause_allowed"):
            robot.effects.append(PauseAction(record.action.action_id))


def resume(robot: RobotState) -> None:
    """Resume paused actions; those that a restart of the agent has interrupted start again."""
    for record in robot.actions:
        action_id = record.action.action_id
        if record.status is ActionStatus.PAUSED and action_id in robot.restarts:
            robot.actions.change(action_id, ActionStatus.INITIALIZING)
        elif record.status is ActionStatus.PAUSED:
            robot.effects.append(ResumeAction(action_id))


def cancel_all(robot: RobotState) -> None:
    """Fail waiting actions, and cancel running ones that can be cancelled (section 6.1.3)."""
    for record in list(robot.actions):
        action_id = record.action.action_id
        waits = record.action.action_type == WAIT_FOR_TRIGGER
        if record.status in (ActionStatus.WAITING, ActionStatus.RETRIABLE) or waits:
            _end_action(robot, record, ActionStatus.FAILED, "the order was cancelled")
        elif record.active and (
            action_id in robot.restarts or _declares_trait(robot, record, "cancel_allowed")
        ):
            robot.effects.append(CancelAction(action_id))


def end_with_edge(robot: RobotState, edge: Edge) -> None:
    """End the actions of ``edge``, which the robot has left (section 6.6.2).

    One that cannot be cancelled runs to its end.
    """
    for action in edge.actions:
        record = robot.actions.get(action.action_id)
        if not record or record.status.ended:
            continue
        if record.status is ActionStatus.RETRIABLE:
            _end_action(robot, record, ActionStatus.FAILED, record.result)
            robot.errors.report(_failure_entry(robot, record), Until.ORDER_OVER)  # no retry is possible now
            continue
        if record.active and not _declares_trait(robot, record, "cancel_allowed"):
            continue
        if record.active:
            robot.effects.append(CancelAction(action.action_id))
        # One without a goal of its own, such as a signal light, has done its work.
        succeeds = record.active and _declares_trait(robot, record, "open_ended")
        status = ActionStatus.FINISHED if succeeds else ActionStatus.FAILED
        result = None if succeeds else "the edge ended before the action"
        apply_report(robot, ActionReport(action.action_id, status, result))


def continue_after_restart(robot: RobotState) -> None:
    """Start interrupted actions again if their declaration allows it; fail the others."""
    for states in (robot.actions, robot.instant_actions):
        for record in [candidate for candidate in states if candidate.active]:
            if record.status is ActionStatus.RETRIABLE:
                robot.errors.report(_failure_entry(robot, record), Until.ORDER_OVER)
            elif record.action.action_type not in PREDEFINED:  # the core continues its own actions
                _continue_action(robot, states, record)


# retry and skipRetry (sections 6.2.3 and 6.6.9)


def retry(robot: RobotState, action: Action) -> str | None:
    """Start the RETRIABLE action again that ``action`` names (section 6.2.3).

    Return the reason for a refusal, None on success.
    """
    record, problem = _find_retriable(robot, action)
    if record is None:
        return problem
    if robot.held:
        return "the robot is paused; resume it first"
    robot.errors.withdraw(_failure_entry(robot, record))
    robot.actions.change(record.action.action_id, ActionStatus.INITIALIZING, "")
    robot.restarts.add(record.action.action_id)
    schedule(robot)
    return None


def skip_retry(robot: RobotState, action: Action) -> str | None:
    """Fail the RETRIABLE action that ``action`` names, and continue the order (section 6.2.3).

    Return the reason for a refusal, None on success.
    """
    record, problem = _find_retriable(robot, action)
    if record is None:
        return problem
    _end_action(robot, record, ActionStatus.FAILED, record.result)
    robot.errors.report(_failure_entry(robot, record), Until.ORDER_OVER)
    schedule(robot)
    return None


def _find_retriable(robot: RobotState, action: Action) -> tuple[ActionRecord | None, str]:
    wanted = str(action.parameter("actionId"))
    record = robot.actions.get(wanted)
    if record is None:
        return None, f"the order has no action '{wanted}'"
    if record.status is not ActionStatus.RETRIABLE:
        return None, f"action '{wanted}' is {record.status}, not RETRIABLE"
    return record, ""


# Node actions that the core executes


def release(robot: RobotState, trigger_type: str) -> bool:
    """Finish all actions that wait for ``trigger_type`` (section 6.2.3); return whether there were any."""
    waiting: list[ActionRecord] = []
    for record in robot.actions:
        types = record.action.parameter(TRIGGER_TYPE)
        waits = record.action.action_type == WAIT_FOR_TRIGGER and record.status is ActionStatus.RUNNING
        # 2.x has one type as a string, which is read as a list of one.
        if waits and isinstance(types, list) and trigger_type in types:
            waiting.append(record)
    for record in waiting:
        _end_action(robot, record, ActionStatus.FINISHED, f"released by {trigger_type}")
    schedule(robot)
    return bool(waiting)


def clear_instant_actions(robot: RobotState, _: Action) -> tuple[ActionStatus, str | None]:
    """Remove ended instant actions from the state (section 6.2.3).

    This action itself stays in the state until the next clearInstantActions.
    """
    robot.instant_actions.remove(lambda record: record.status.ended)
    return ActionStatus.FINISHED, None


CORE_ACTIONS: dict[str, CoreAction] = {
    CLEAR_INSTANT_ACTIONS: clear_instant_actions,
    ENABLE_ZONE_SET: zones.enable,
    WAIT_FOR_TRIGGER: lambda *_: (ActionStatus.RUNNING, None),
}
"""Node actions that the core executes, by action type."""


# Helpers


def _startable_records(robot: RobotState) -> list[ActionRecord]:
    """Return the actions that start now, or as soon as the robot stands."""
    runnable = () if robot.held or robot.clearing else robot.queue.runnable()
    records = (
        *(robot.actions.get(action_id) for action_id in runnable),
        *(robot.instant_actions.get(action_id) for action_id in robot.instant_queue),
    )
    return [
        record
        for record in records
        if record
        and (
            record.status is ActionStatus.WAITING
            or (record.status is ActionStatus.INITIALIZING and record.action.action_id in robot.restarts)
        )
    ]


def _standstill_overdue(robot: RobotState) -> bool:
    """Stop the robot for an action that waits until it stands; return whether that has taken too long.

    The driver itself limits the time of a halt. Another program's goal for which the order waits, and an
    action that moves the robot, end on their own.
    """
    if robot.waits_for_external_goal or robot.action_may_move:
        robot.standstill_by = inf
    elif robot.standstill_by is None or robot.standstill_by == inf:
        robot.standstill_by = robot.now + STANDSTILL_TIMEOUT
        if not robot.goal.moving:
            robot.request_halt()
    return robot.now >= robot.standstill_by and not robot.goal.moving


def _start_action(robot: RobotState, record: ActionRecord) -> None:
    action_id = record.action.action_id
    core_action = CORE_ACTIONS.get(record.action.action_type)
    declared = _declaration_of(robot, record)
    if record.scope is not ActionScope.INSTANT and core_action:
        status, result = core_action(robot, record.action)
        apply_report(robot, ActionReport(action_id, status, result))
    # The order was accepted with another load in mind if an earlier action has failed since.
    elif declared and (problem := declared.load_problem(loaded=bool(robot.loads))):
        apply_report(robot, ActionReport(action_id, ActionStatus.FAILED, problem))
    else:
        robot.effects.append(StartAction(record.action, robot.loads))


def _end_action(robot: RobotState, record: ActionRecord, status: ActionStatus, result: str | None) -> None:
    """End an order action that is not running in a plug-in."""
    robot.actions.change(record.action.action_id, status, result)
    robot.queue.remove(record.action.action_id)


def _is_retriable(robot: RobotState, record: ActionRecord, report: ActionReport) -> bool:
    """Return whether a failed action becomes RETRIABLE, to wait for retry or skipRetry (section 6.6.9)."""
    return (
        report.status is ActionStatus.FAILED
        # Figure 21 leads to RETRIABLE only from RUNNING, and instant actions have no such status.
        and record.status is ActionStatus.RUNNING
        and record.scope is not ActionScope.INSTANT
        and bool(record.action.retriable)
        and not robot.clearing
        and ActionStatus.RETRIABLE in robot.capabilities.rules.action_statuses
    )


def _continue_action(robot: RobotState, states: ActionStates, record: ActionRecord) -> None:
    action_id = record.action.action_id
    waits = robot.held and not robot.clearing and record.scope is not ActionScope.INSTANT
    restartable = _declares_trait(robot, record, "restartable")
    if waits and restartable and _declares_trait(robot, record, "pause_allowed"):
        robot.restarts.add(action_id)
        robot.actions.change(action_id, ActionStatus.PAUSED)
    elif restartable and not robot.clearing:
        states.restart(action_id)
        if robot.needs_standstill(record):
            robot.restarts.add(action_id)  # what the robot does is unknown
        else:
            _start_action(robot, record)
    else:
        result = "the agent was interrupted while the action was running"
        apply_report(robot, ActionReport(action_id, ActionStatus.FAILED, result))


def _declares_trait(robot: RobotState, record: ActionRecord, trait: str) -> bool:
    return bool(getattr(_declaration_of(robot, record), trait, False))


def _declaration_of(robot: RobotState, record: ActionRecord) -> ActionDeclaration | None:
    return robot.capabilities.actions.get(record.action.action_type)


def _failure_entry(robot: RobotState, record: ActionRecord) -> ErrorEntry:
    """Return the error of a failed action: a warning, because the order continues."""
    order_id = robot.progress.order_id or None
    hint = "the order continues; cancel it, or send the action again in another order"
    if record.scope is ActionScope.INSTANT:
        order_id, hint = None, "fix the cause, and send it again with another actionId"
    elif record.status is ActionStatus.RETRIABLE:
        hint = "send retry or skipRetry"
    return error(
        ErrorType.ACTION_FAILED,
        f"action '{record.action.action_type}' failed: {record.result or 'no reason given'}",
        hint=hint,
        action_id=record.action.action_id,
        order_id=order_id,
    ).with_level(ErrorLevel.WARNING)
