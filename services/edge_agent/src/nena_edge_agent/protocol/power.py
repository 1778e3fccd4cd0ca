"""Hibernation and shutdown (section 6.2.3).

The robot reports hibernation or shutdown in a last state before its command runs. A hibernating robot stays
connected, sends no states, and reacts only to stopHibernation and to its wake-up time.
"""

from __future__ import annotations

from dataclasses import replace

from nena_edge_agent.protocol import events, orders
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.robot_state import PowerPhase, RobotState
from nena_shared.clock import iso
from nena_shared.vda5050.action import (
    START_HIBERNATION,
    STOP_HIBERNATION,
    Action,
    ActionStatus,
    wake_up_time,
)
from nena_shared.vda5050.error import error

POWER_COMMAND_FAILED = "POWER_COMMAND_FAILED"
STANDSTILL_TIMEOUT = 30.0
"""Timeout for movements and actions outside the order to end before hibernation, seconds."""

_IGNORING = frozenset(PowerPhase) - {PowerPhase.AWAKE, PowerPhase.FALLING_ASLEEP}
"""Phases in which messages are ignored."""


# Actions


def start_hibernation(robot: RobotState, action: Action) -> str | None:
    """Clear the order and stop the robot, to hibernate then; return why it cannot hibernate, if so.

    A second startHibernation ends together with the first, and replaces its wake-up time.
    """
    if robot.journal_problem:
        return f"the journal cannot be written: {robot.journal_problem}"
    at, now = wake_up_time(action), robot.utc_now
    if at is not None and now is not None and at <= now:
        return f"the wake-up time {iso(at)} has passed; it is {iso(now)}"
    robot.instant_actions.change(action.action_id, ActionStatus.RUNNING)
    robot.power, robot.wake_up_at, robot.kept_awake_since = PowerPhase.FALLING_ASLEEP, at, None
    orders.begin_clearing(robot)
    return None


def stop_hibernation(robot: RobotState, action: Action) -> None:
    """Wake the robot; if it is awake, finish at once."""
    if robot.power.silent:
        robot.instant_actions.change(action.action_id, ActionStatus.RUNNING)
        _wake_robot(robot)
    else:
        _stay_awake(robot, "revoked by stopHibernation")
        robot.instant_actions.change(action.action_id, ActionStatus.FINISHED)


def shut_down(robot: RobotState, action: Action) -> str | None:
    """Begin the shutdown of an idle robot; return why that is impossible, if so.

    A second shutdown finishes at once.
    """
    if robot.power is PowerPhase.SHUTTING_DOWN:
        robot.instant_actions.change(action.action_id, ActionStatus.FINISHED)
        return None
    # A hibernating robot must be woken before it is shut down (6.2.3).
    if robot.power is not PowerPhase.AWAKE:
        return "the robot is about to hibernate; send stopHibernation first"
    if robot.instant_actions_running > 1:
        return "another instant action is running; wait for its end"
    if problem := _motion_problem(robot):
        return problem
    robot.instant_actions.change(action.action_id, ActionStatus.FINISHED)
    robot.power = PowerPhase.SHUTTING_DOWN
    return None


# Messages


def filter_event(robot: RobotState, event: events.Event) -> events.Event:
    """Return ``event``; if the robot ignores messages, only its stopHibernation actions are kept."""
    if robot.power not in _IGNORING:
        return event
    match event:
        case events.InstantActionsReceived(message):
            wakes = robot.power is not PowerPhase.SHUTTING_DOWN
            taken = tuple(
                action for action in message.actions if wakes and action.action_type == STOP_HIBERNATION
            )
            if rest := [action.action_type for action in message.actions if action not in taken]:
                robot.effects.append(events.LogIgnored(f"instant actions: {', '.join(rest)}"))
            return replace(event, message=message.model_copy(update={"actions": taken}))
        case events.OrderReceived(order):
            robot.effects.append(events.LogIgnored(f"order '{order.order_id}'"))
        case events.ZoneSetReceived():
            robot.effects.append(events.LogIgnored("zone set"))
        case events.ResponsesReceived():
            robot.effects.append(events.LogIgnored("responses"))
        case events.MessageRefused():
            robot.effects.append(events.LogIgnored("a message that cannot be read"))
        case _:
            return event
    # The time still passes: the wake-up time may be due.
    return events.TimePassed()


# Progress


def advance(robot: RobotState) -> None:
    """Hibernate once the order is cleared and the robot is at standstill; wake at the wake-up time.

    Hibernation must be on disk before it is reported, so a robot whose journal fails stays awake.
    """
    now = robot.utc_now
    if robot.wake_up_at is not None and now is not None and now >= robot.wake_up_at:
        if robot.power is PowerPhase.HIBERNATING:
            _wake_robot(robot)
        elif not robot.power.silent:
            _stay_awake(robot, "the wake-up time has passed before the robot could hibernate")
    if robot.journal_problem and robot.power in (PowerPhase.FALLING_ASLEEP, PowerPhase.SIGNING_OFF):
        _stay_awake(robot, f"the journal cannot be written: {robot.journal_problem}")
    # The order ends as by cancelOrder before the robot hibernates (6.2.3).
    if robot.power is not PowerPhase.FALLING_ASLEEP or robot.clearing or robot.goal.moving:
        return
    # A running instant action keeps the robot awake: no state could report its end.
    running = {record.action.action_type for record in robot.instant_actions if not record.status.ended}
    others = ", ".join(sorted(running - {START_HIBERNATION}))
    problem = _motion_problem(robot) or (f"instant actions are running ({others})" if others else None)
    if not problem:
        # startHibernation is FINISHED in the last state, before the command runs (6.2.3).
        robot.end_instant_actions(START_HIBERNATION, ActionStatus.FINISHED)
        robot.power = PowerPhase.SIGNING_OFF
    elif robot.kept_awake_since is None:
        robot.kept_awake_since = robot.now
    elif robot.now - robot.kept_awake_since >= STANDSTILL_TIMEOUT:
        _stay_awake(robot, f"{problem}, for {STANDSTILL_TIMEOUT:.0f} s")


def _motion_problem(robot: RobotState) -> str | None:
    """Return how the robot moves without an order, if it does: by a person or another program."""
    if goals := robot.reports.goals.external:
        return f"navigation is driving to another program's goal ({goals[0].goal_id})"
    return "the robot moves without an order" if robot.reports.velocity.moves else None


def signed_off(robot: RobotState, _: events.SignedOff) -> None:
    """Hibernate or shut down after the last state, unless the robot was woken in the meantime."""
    if robot.power is PowerPhase.SIGNING_OFF:
        robot.power = PowerPhase.HIBERNATING
        robot.effects.append(events.Hibernate(robot.wake_up_at))
    elif robot.power is PowerPhase.SHUTTING_DOWN:
        robot.effects.append(events.ShutDown())


def command_ended(robot: RobotState, event: events.PowerReport) -> None:
    """Handle the end of a power command; if it has failed, the robot is awake or wakes up."""
    if event.problem:
        entry = error(
            POWER_COMMAND_FAILED,
            f"power.{event.command} failed, and the robot is awake: {event.problem}",
            hint="the agent's log has the output of the command; correct it or the setting",
            command=event.command,
        )
        robot.errors.report(entry, Until.ORDER_ACCEPTED)
    if event.command is events.PowerCommand.HIBERNATE and event.problem:
        _wake_robot(robot)
    if event.command is events.PowerCommand.WAKE and robot.power is PowerPhase.WAKING:
        robot.power, robot.wake_up_at = PowerPhase.AWAKE, None
        status = ActionStatus.FAILED if event.problem else ActionStatus.FINISHED
        robot.end_instant_actions(STOP_HIBERNATION, status, event.problem or None)
        robot.effects.append(events.GoOnline())


def halt_failed(robot: RobotState, description: str) -> None:
    """Stay awake, because the robot's standstill cannot be confirmed."""
    if robot.power is PowerPhase.FALLING_ASLEEP:
        _stay_awake(robot, description)


def continue_after_restart(robot: RobotState) -> None:
    """Run a wake command again that a restart of the agent has interrupted.

    A robot whose settings no longer offer hibernation is awake.
    """
    if robot.power is PowerPhase.AWAKE:
        return
    if START_HIBERNATION not in robot.capabilities.actions:
        _stay_awake(robot, "the robot's settings no longer offer hibernation")
        robot.end_instant_actions(STOP_HIBERNATION, ActionStatus.FINISHED)
        robot.effects.append(events.GoOnline())
    elif robot.power is PowerPhase.WAKING:
        robot.effects.append(events.Wake())


def _wake_robot(robot: RobotState) -> None:
    if robot.power is PowerPhase.HIBERNATING:
        robot.power = PowerPhase.WAKING
        robot.effects.append(events.Wake())


def _stay_awake(robot: RobotState, reason: str) -> None:
    robot.end_instant_actions(START_HIBERNATION, ActionStatus.FAILED, reason)
    robot.power, robot.wake_up_at = PowerPhase.AWAKE, None
