"""Hibernation and shutdown: the robot ends its order, signs off, and wakes again (section 6.2.3).

A hibernating robot stays connected, sends no states, and acts on stopHibernation alone. It also wakes at its
wake-up time. A robot that falls asleep or shuts down reports that in a last state before its command runs.
"""

from __future__ import annotations

from dataclasses import replace

from nena_edge_agent.protocol import orders
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import (
    Event,
    GoOnline,
    Hibernate,
    InstantActionsReceived,
    LogIgnored,
    MessageRefused,
    OrderReceived,
    PowerCommand,
    PowerReport,
    ResponsesReceived,
    ShutDown,
    SignedOff,
    TimePassed,
    Wake,
    ZoneSetReceived,
)
from nena_edge_agent.protocol.robot_state import PowerPhase, RobotState
from nena_shared.clock import iso
from nena_shared.vda5050.action import (
    START_HIBERNATION,
    STOP_HIBERNATION,
    Action,
    ActionStatus,
    wake_up_time,
)
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference

POWER_COMMAND_FAILED = "POWER_COMMAND_FAILED"
REST_TIMEOUT = 30.0
"""Seconds that a robot about to hibernate waits for the end of what is not part of its order."""

_DEAF = frozenset(PowerPhase) - {PowerPhase.AWAKE, PowerPhase.FALLING_ASLEEP}
"""Phases in which messages are ignored."""


# Actions


def start_hibernation(robot: RobotState, action: Action) -> str | None:
    """Begin to clear the order and to stop; return why the robot cannot hibernate, if so.

    A second request joins the first, with its own wake-up time.
    """
    if robot.journal_problem:
        return f"the journal cannot be written: {robot.journal_problem}"
    at, now = wake_up_time(action), robot.utc_now
    if at is not None and now is not None and at <= now:
        return f"the wake-up time {iso(at)} has passed; it is {iso(now)}"
    robot.instant_actions.change(action.action_id, ActionStatus.RUNNING)
    robot.power, robot.wake_up_at, robot.restless_since = PowerPhase.FALLING_ASLEEP, at, None
    orders.begin_clearing(robot)
    return None


def stop_hibernation(robot: RobotState, action: Action) -> None:
    """Wake the robot; one that is awake is so already."""
    if robot.power.silent:
        robot.instant_actions.change(action.action_id, ActionStatus.RUNNING)
        _wake(robot)
    else:
        _stay_awake(robot, "revoked by stopHibernation")
        robot.instant_actions.change(action.action_id, ActionStatus.FINISHED)


def shut_down(robot: RobotState, action: Action) -> str | None:
    """Begin to shut an idle robot down; return why it cannot be, if so.

    A second request joins the first.
    """
    if robot.power is PowerPhase.SHUTTING_DOWN:
        robot.instant_actions.change(action.action_id, ActionStatus.FINISHED)
        return None
    if robot.power is not PowerPhase.AWAKE:
        return "the robot is about to hibernate; send stopHibernation first"
    if robot.instant_actions_running > 1:
        return "another instant action is running; wait for its end"
    if problem := _motion(robot):
        return problem
    robot.instant_actions.change(action.action_id, ActionStatus.FINISHED)
    robot.power = PowerPhase.SHUTTING_DOWN
    return None


# Messages


def heard(robot: RobotState, event: Event) -> Event:
    """Return what is left of ``event`` at a robot that ignores messages: of those only stopHibernation."""
    if robot.power not in _DEAF:
        return event
    match event:
        case InstantActionsReceived(message):
            wakes = robot.power is not PowerPhase.SHUTTING_DOWN
            taken = tuple(each for each in message.actions if wakes and each.action_type == STOP_HIBERNATION)
            if rest := [each.action_type for each in message.actions if each not in taken]:
                robot.effects.append(LogIgnored(f"instant actions: {', '.join(rest)}"))
            return replace(event, message=message.model_copy(update={"actions": taken}))
        case OrderReceived(order):
            robot.effects.append(LogIgnored(f"order '{order.order_id}'"))
        case ZoneSetReceived():
            robot.effects.append(LogIgnored("zone set"))
        case ResponsesReceived():
            robot.effects.append(LogIgnored("responses"))
        case MessageRefused():
            robot.effects.append(LogIgnored("a message that cannot be read"))
        case _:
            return event
    return TimePassed()


# Progress


def advance(robot: RobotState) -> None:
    """Sign off once the order is cleared and the robot is at rest; wake it at its wake-up time.

    That it hibernates must be on the disk before it is said, so a robot without a journal stays awake.
    """
    now = robot.utc_now
    if robot.wake_up_at is not None and now is not None and now >= robot.wake_up_at:
        if robot.power is PowerPhase.HIBERNATING:
            _wake(robot)
        elif not robot.power.silent:
            _stay_awake(robot, "the wake-up time has passed before the robot could hibernate")
    if robot.journal_problem and robot.power in (PowerPhase.FALLING_ASLEEP, PowerPhase.SIGNING_OFF):
        _stay_awake(robot, f"the journal cannot be written: {robot.journal_problem}")
    if robot.power is PowerPhase.FALLING_ASLEEP and not robot.clearing and not robot.goal.moving:
        _sign_off(robot)


def _sign_off(robot: RobotState) -> None:
    """End startHibernation: sign off, or fail if something beside the order keeps the robot awake."""
    problem = _motion(robot) or _other_actions(robot)
    if not problem:
        robot.end_instant_actions(START_HIBERNATION, ActionStatus.FINISHED)
        robot.power = PowerPhase.SIGNING_OFF
    elif robot.restless_since is None:
        robot.restless_since = robot.now
    elif robot.now - robot.restless_since >= REST_TIMEOUT:
        _stay_awake(robot, f"{problem}, for {REST_TIMEOUT:.0f} s")


def _motion(robot: RobotState) -> str | None:
    """Return what moves the robot without an order, such as a person or another program."""
    if goals := robot.reports.goals.external:
        return f"navigation drives to a goal of another program ({goals[0].goal_id})"
    return "the robot moves without an order" if robot.reports.velocity.moves else None


def _other_actions(robot: RobotState) -> str | None:
    """Return what runs beside startHibernation: no state could report its end."""
    running = {each.action.action_type for each in robot.instant_actions if not each.status.ended}
    others = ", ".join(sorted(running - {START_HIBERNATION}))
    return f"instant actions are running ({others})" if others else None


def signed_off(robot: RobotState, _: SignedOff) -> None:
    """Hibernate, or shut down, now that fleet control can know; the robot may have been woken meanwhile."""
    if robot.power is PowerPhase.SIGNING_OFF:
        robot.power = PowerPhase.HIBERNATING
        robot.effects.append(Hibernate(robot.wake_up_at))
    elif robot.power is PowerPhase.SHUTTING_DOWN:
        robot.effects.append(ShutDown())


def command_ended(robot: RobotState, event: PowerReport) -> None:
    """Note the end of a command: if it has failed, the robot is awake, or wakes now."""
    if event.problem:
        robot.errors.report(_failure(event), Until.ORDER_ACCEPTED)
    if event.command is PowerCommand.HIBERNATE and event.problem:
        _wake(robot)
    if event.command is PowerCommand.WAKE and robot.power is PowerPhase.WAKING:
        robot.power, robot.wake_up_at = PowerPhase.AWAKE, None
        status = ActionStatus.FAILED if event.problem else ActionStatus.FINISHED
        robot.end_instant_actions(STOP_HIBERNATION, status, event.problem or None)
        robot.effects.append(GoOnline())


def halt_failed(robot: RobotState, description: str) -> None:
    """Stay awake: the robot's standstill cannot be confirmed."""
    if robot.power is PowerPhase.FALLING_ASLEEP:
        _stay_awake(robot, description)


def continue_after_restart(robot: RobotState) -> None:
    """Run the wake command again that a restart of the agent has interrupted.

    A robot whose settings do not offer hibernation any more is awake.
    """
    if robot.power is PowerPhase.AWAKE:
        return
    if START_HIBERNATION not in robot.capabilities.actions:
        _stay_awake(robot, "the robot's settings do not offer hibernation any more")
        robot.end_instant_actions(STOP_HIBERNATION, ActionStatus.FINISHED)
        robot.effects.append(GoOnline())
    elif robot.power is PowerPhase.WAKING:
        robot.effects.append(Wake())


def _wake(robot: RobotState) -> None:
    if robot.power is PowerPhase.HIBERNATING:
        robot.power = PowerPhase.WAKING
        robot.effects.append(Wake())


def _stay_awake(robot: RobotState, reason: str) -> None:
    robot.end_instant_actions(START_HIBERNATION, ActionStatus.FAILED, reason)
    robot.power, robot.wake_up_at = PowerPhase.AWAKE, None


def _failure(event: PowerReport) -> ErrorEntry:
    return ErrorEntry(
        error_type=POWER_COMMAND_FAILED,
        error_level=ErrorLevel.WARNING,
        error_description=f"power.{event.command} failed, and the robot is awake: {event.problem}",
        error_hint="the agent's log has the output of the command; correct it or the setting",
        error_references=(ErrorReference(reference_key="command", reference_value=event.command.value),),
    )
