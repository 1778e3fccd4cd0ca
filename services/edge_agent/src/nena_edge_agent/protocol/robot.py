"""The protocol core of one robot: it handles one event at a time and returns its effects."""

from __future__ import annotations

from datetime import datetime
from functools import partial
from math import isfinite
from typing import Any

from nena_edge_agent.driver import port
from nena_edge_agent.protocol import (
    actions,
    driving,
    edge_paths,
    events,
    instant_actions,
    orders,
    power,
    route_progress,
    zones,
)
from nena_edge_agent.protocol.action_states import loads_by_sensor
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.conditions import check_conditions
from nena_edge_agent.protocol.declaration import CANCEL_ORDER, INITIALIZE_POSITION, START_PAUSE
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.memory import Memory, memory_of, restore_robot
from nena_edge_agent.protocol.order_progress import OrderProgress
from nena_edge_agent.protocol.robot_state import PowerPhase, RobotState
from nena_edge_agent.protocol.state import make_state, make_visualization
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.visualization import Visualization

REQUESTS = (events.OrderReceived, events.InstantActionsReceived, events.MessageRefused)
"""Events that trigger a state message even without a change: the sender waits for it."""

FULL_CHARGE = 100.0
"""Maximum state of charge, percent."""


class RobotCore:
    """One VDA 5050 robot.

    Each call of :meth:`handle` processes one event completely and returns its effects. If
    :attr:`durable_version` has changed, the caller first writes :meth:`memory` to disk. Then it performs the
    effects in order.
    """

    def __init__(self, capabilities: Capabilities, memory: Memory | None = None) -> None:
        path_of = None
        if capabilities.follows_paths:
            path_of = partial(edge_paths.planned_corners, capabilities=capabilities)
        if memory:
            self._robot = restore_robot(memory, capabilities, path_of)
        else:
            self._robot = RobotState(capabilities, OrderProgress(capabilities.rules, path_of))
        self._shown = self._visible_values()

    def handle(self, event: events.Event, now: float) -> tuple[events.Effect, ...]:
        """Handle ``event`` at the monotonic time ``now``, s, and return its effects."""
        robot = self._robot
        robot.now, robot.effects = now, []
        # A hibernating robot ignores all messages but stopHibernation (6.2.3, 6.5).
        event = power.filter_event(robot, event)
        _apply_event(robot, event)
        # What stops the robot comes before what starts it: no action and no drive begins in the event that
        # pauses it.
        instant_actions.apply_hold(robot)
        # An expired lease closes its zone before the next goal is chosen (6.9).
        zones.expire(robot)
        # Before the drive: an action at the node keeps the robot there (6.2.2).
        if robot.standstill_by is not None:
            actions.schedule(robot)
        for report in zones.end_requests(robot):
            actions.apply_report(robot, report)
            actions.schedule(robot)
        driving.advance(robot)
        # After the drive: only now it is known whether something drives the robot.
        driving.watch_movement(robot)
        instant_actions.advance_pause(robot)
        # These wait for a standstill, which the steps above may have requested or confirmed.
        orders.advance_clearing(robot)
        orders.advance_mode(robot)
        instant_actions.advance_position(robot)
        power.advance(robot)
        # What follows describes the new state: requests, limits, distances, errors.
        zones.advance(robot)
        zones.keep_out(robot)
        driving.limit_speed(robot)
        route_progress.advance(robot)
        check_conditions(robot)
        shown = self._visible_values()
        if robot.power.silent:
            return tuple(robot.effects)
        if shown != self._shown or isinstance(event, REQUESTS):
            self._shown = shown
            robot.effects.append(events.ReportState())
        return tuple(robot.effects)

    def state(self, header: dict[str, Any]) -> State:
        """Return the state message (section 7.8); ``header`` has its header fields by their neutral names."""
        return make_state(header, self._robot)

    def visualization(self, header: dict[str, Any], state_header_id: int) -> Visualization:
        """Return the visualization message (section 7.9); ``state_header_id`` is that of the last state."""
        return make_visualization(header, self._robot, state_header_id=state_header_id)

    @property
    def robot(self) -> RobotState:
        """Return the robot's state, for reading only."""
        return self._robot

    @property
    def last_position(self) -> port.Pose | None:
        """Return the position of the last node, None if unknown."""
        node = self._robot.progress.last_node
        position = node.node_position if node else None
        return port.Pose(position.x, position.y, position.theta or 0.0, position.map_id) if position else None

    @property
    def own_goals(self) -> port.OwnGoals | None:
        """Return the robot's own goals that navigation has or may have, None without any."""
        return self._robot.goal.own

    @property
    def header_ids(self) -> tuple[tuple[Topic, int], ...]:
        """Return the first headerId of each topic for the next run of the program (section 7.2)."""
        return self._robot.header_ids

    @header_ids.setter
    def header_ids(self, header_ids: tuple[tuple[Topic, int], ...]) -> None:
        self._robot.header_ids = header_ids

    @property
    def power(self) -> PowerPhase:
        """Return the phase of hibernation or shutdown."""
        return self._robot.power

    @property
    def waits(self) -> bool:
        """Return whether a timeout is running; then :class:`TimePassed` events are needed."""
        robot = self._robot
        if robot.power is not PowerPhase.AWAKE:
            return True
        retries = robot.goal.retry_at is not None
        own = robot.goal.halting or retries or robot.link.waits
        stands = robot.standstill_by is not None or robot.moves_since is not None
        zones_wait = robot.zone_requests.waits or bool(robot.zone_set_requests)
        return own or stands or zones_wait or robot.position_request is not None

    @property
    def durable_version(self) -> tuple[object, ...]:
        """Return a value that changes whenever :meth:`memory` does."""
        return (*self._durable_values(), self._robot.header_ids)

    def memory(self) -> Memory:
        """Return the data that must survive the end of the process."""
        return memory_of(self._robot)

    def _durable_values(self) -> tuple[object, ...]:
        """Return the values of :attr:`durable_version` without the header IDs."""
        robot = self._robot
        return (
            robot.progress.revision,
            robot.actions.revision,
            robot.instant_actions.revision,
            robot.loads,
            robot.charging,
            robot.paused,
            robot.clearing,
            robot.power,
            robot.wake_up_at,
            robot.operating_mode,
            robot.wanted_mode,
            robot.zone_sets.revision,
            robot.zone_requests.revision,
            robot.goal.own,
        )

    def _visible_values(self) -> tuple[object, ...]:
        """Return the values whose change triggers a state (section 6.6)."""
        robot = self._robot
        pose, battery = robot.reports.pose, robot.reports.battery
        return (
            *self._durable_values(),
            robot.errors.revision,
            robot.goal.moving,
            robot.reports.velocity.moves,
            driving.new_base_request(robot),
            pose is not None and pose.localized,
            battery is not None and battery.charging,
            robot.reports.goals.external,
            robot.reports.safety,
            robot.reports.pause_button,
            robot.reports.session,
            robot.maps,
        )


def _apply_event(robot: RobotState, event: events.Event) -> None:  # noqa: C901, PLR0912, PLR0915 - a case for each event
    """Apply one event; the steps that follow from the new state come after it, whatever the event was."""
    match event:
        case port.PoseReport(pose):
            if all(isfinite(number) for number in (pose.x, pose.y, pose.theta)):
                robot.reports.pose = event
                robot.reports.velocity = port.VelocityReport(event.vx, event.omega)
                route_progress.pose_changed(robot)
                driving.pose_changed(robot)
        case port.VelocityReport():
            robot.reports.velocity = event
        case port.BatteryReport(charge):
            if 0.0 <= charge <= FULL_CHARGE:
                robot.reports.battery = event
        case port.Arrived():
            driving.arrived(robot, event)
        case port.DriveFailed():
            driving.failed(robot, event)
        case port.Halted():
            driving.halted(robot)
        case port.HaltFailed(description):
            driving.halt_failed(robot, description)
            actions.fail_waiting(robot, f"the robot did not stop: {description}")
            actions.schedule(robot)
            for action_type in (CANCEL_ORDER, START_PAUSE):  # the order is cleared once the robot stands
                robot.end_instant_actions(action_type, ActionStatus.FAILED, description)
            power.halt_failed(robot, description)
        case port.NavigationReport():
            driving.navigation_changed(robot, event)
        case port.PlanReport():
            robot.reports.plan = event
        case port.DriveProgress(_, recoveries):
            progress = robot.reports.progress
            if recoveries > (progress.recoveries if progress else 0):
                robot.reports.recovered_at = robot.now
            robot.reports.progress = event
        case port.DriveLimits():
            if event != robot.reports.limits:
                robot.reports.limits = event
                robot.effects.append(events.SendFactsheet())  # it reports navigation's goal tolerance
        case port.BlockedReport(blocked):
            robot.reports.blocked = event if blocked else None
        case port.CollisionReport(stops):
            robot.reports.collision = None if stops is False else event
        case port.KeepOutReport():
            if robot.areas:  # else it is a late report about former areas
                robot.reports.keep_out = event
        case port.NoRouteReport(areas):
            robot.reports.no_route = areas
        case port.PositionInitialized():
            instant_actions.position_initialized(robot, event)
        case port.GoalTable():
            robot.reports.goals = event
            robot.goal.record_listed(event.own)
            robot.goal.stood = robot.goal.stood and not event.external
        case port.SessionReport():
            robot.reports.session = event
        case events.Started(utc):
            _set_time(robot, utc)
            _continue_after_restart(robot)
        case events.TimePassed(utc):
            _set_time(robot, utc)
        case events.OrderReceived(order, utc):
            _set_time(robot, utc)
            orders.receive(robot, order)
        case events.InstantActionsReceived(message, utc):
            _set_time(robot, utc)
            instant_actions.receive(robot, message)
        case events.ResponsesReceived(message, utc):
            _set_time(robot, utc)
            zones.apply_responses(robot, message, utc)
        case events.ZoneSetReceived(message):
            zones.accept(robot, message.zone_set)
        case events.MessageRefused(entry, until):
            robot.errors.report(entry, until)
        case events.ActionReport(zone_set=zone_set):
            report = event
            if zone_set and (problem := zones.accept(robot, zone_set)):
                report = events.ActionReport(event.action_id, ActionStatus.FAILED, problem)
            actions.apply_report(robot, report)
            actions.schedule(robot)
        case events.LoadSensed(loaded):
            robot.loads = loads_by_sensor(robot.loads, loaded=loaded)
        case events.LinkReport(connected):
            robot.link.lost_since = None if connected else robot.now
            if connected and robot.power.signs_off:
                robot.effects.append(events.ReportState())  # the last state may not have been sent
        case events.OperatingModeSwitched():
            orders.switch_mode(robot, event)
        case events.ErrorSwitched(entry, active):
            if active:
                robot.errors.report(entry, Until.WITHDRAWN)
            else:
                robot.errors.withdraw(entry)
        case events.LocalTrigger(trigger_type):
            actions.release(robot, trigger_type)
        case events.SignedOff():
            power.signed_off(robot, event)
        case events.PowerReport():
            power.command_ended(robot, event)
        case events.PluginsReport(problems):
            robot.plugin_problems = problems
        case events.JournalReport(problem):
            robot.journal_problem = problem
        case events.MapsReport(maps):
            robot.maps = maps
        case events.SubscriptionsReport(refused):
            robot.refused_topics = refused
        case events.SafetyReport():
            robot.reports.safety = event
        case events.PauseButton(pressed):
            robot.reports.pause_button = pressed


def _set_time(robot: RobotState, utc: datetime | None) -> None:
    """Store the time of day, if an event contains it."""
    if utc:
        robot.utc = (utc, robot.now)


def _continue_after_restart(robot: RobotState) -> None:
    """Continue interrupted work; what the robot has done since is unknown."""
    robot.link.lost_since = robot.now
    # The answer of the localisation went to the former process.
    text = "the agent was interrupted before the localisation responded"
    robot.end_instant_actions(INITIALIZE_POSITION, ActionStatus.FAILED, text)
    zones.continue_after_restart(robot)
    # Navigation survives the agent, and may still drive to a goal that the order does not need.
    needs_goal = robot.progress.next_node is not None and robot.driving_allowed
    if robot.clearing or robot.paused or (robot.goal.own is not None and not needs_goal):
        robot.request_halt()
    power.continue_after_restart(robot)
    actions.continue_after_restart(robot)
    actions.schedule(robot)
