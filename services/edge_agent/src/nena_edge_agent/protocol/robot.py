"""The protocol core of one robot: it handles one event at a time and returns its effects."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import isfinite
from typing import Any

from nena_edge_agent.driver.port import (
    Arrived,
    BatteryReport,
    BlockedReport,
    CollisionReport,
    DriveFailed,
    DriveLimits,
    DriveProgress,
    GoalTable,
    Halted,
    HaltFailed,
    NavigationReport,
    NoRouteReport,
    OwnGoals,
    PlanReport,
    Pose,
    PoseReport,
    PositionInitialized,
    SessionReport,
    VelocityReport,
)
from nena_edge_agent.protocol import (
    actions,
    driving,
    edge_paths,
    instant_actions,
    orders,
    power,
    route_progress,
    zones,
)
from nena_edge_agent.protocol.action_states import sensed
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.conditions import check_conditions
from nena_edge_agent.protocol.declaration import CANCEL_ORDER, START_PAUSE
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import (
    ActionReport,
    Effect,
    ErrorSwitched,
    Event,
    InstantActionsReceived,
    JournalReport,
    LinkReport,
    LoadSensed,
    LocalTrigger,
    MapsReport,
    MessageRefused,
    OperatingModeSwitched,
    OrderReceived,
    PauseButton,
    PluginsReport,
    PowerReport,
    ReportState,
    ResponsesReceived,
    SafetyReport,
    SendFactsheet,
    SignedOff,
    Started,
    SubscriptionsReport,
    TimePassed,
    ZoneSetReceived,
)
from nena_edge_agent.protocol.memory import Memory, memory_of, restored
from nena_edge_agent.protocol.robot_state import PowerPhase, RobotState
from nena_edge_agent.protocol.state import make_state, make_visualization
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.visualization import Visualization

REQUESTS = (OrderReceived, InstantActionsReceived, MessageRefused)
"""Events that trigger a state even if nothing has changed: the sender waits for it."""

FULL = 100.0
"""Maximum state of charge, percent."""


class RobotCore:
    """One VDA 5050 robot.

    Each call of :meth:`handle` processes one event completely and returns its effects. The caller performs
    them in order, after making :meth:`memory` durable if :attr:`durable_version` has changed.
    """

    def __init__(self, capabilities: Capabilities, memory: Memory | None = None) -> None:
        self._robot = restored(memory, capabilities) if memory else RobotState(capabilities)
        if capabilities.follows_paths:
            self._robot.progress.follow_paths(partial(edge_paths.planned_corners, capabilities=capabilities))
        self._shown = self._visible()

    def handle(self, event: Event, now: float) -> tuple[Effect, ...]:
        """Handle ``event`` at the monotonic time ``now`` in s, and return its effects."""
        robot = self._robot
        robot.now, robot.effects = now, []
        event = power.filter_event(robot, event)
        _note_time(robot, event)
        _HANDLERS[type(event)](robot, event)
        instant_actions.apply_hold(robot)
        zones.expire(robot)
        driving.advance(robot)
        instant_actions.advance_pause(robot)
        orders.advance_clearing(robot)
        orders.advance_mode(robot)
        instant_actions.advance_position(robot)
        power.advance(robot)
        zones.advance(robot)
        zones.keep_out(robot)
        driving.limit_speed(robot)
        route_progress.advance(robot)
        check_conditions(robot)
        shown = self._visible()
        if robot.power.silent:
            return tuple(robot.effects)
        if shown != self._shown or isinstance(event, REQUESTS):
            self._shown = shown
            robot.effects.append(ReportState())
        return tuple(robot.effects)

    def state(self, header: dict[str, Any]) -> State:
        """Return the state message; ``header`` has its five header fields by their neutral names.

        VDA 5050 3.0 section 7.8.
        """
        return make_state(header, self._robot)

    def visualization(self, header: dict[str, Any], state_header_id: int) -> Visualization:
        """Return the visualization message; ``state_header_id`` is that of its state (section 7.9)."""
        return make_visualization(header, self._robot, state_header_id=state_header_id)

    @property
    def robot(self) -> RobotState:
        """Return the robot's state, for reading only."""
        return self._robot

    @property
    def last_position(self) -> Pose | None:
        """Return the position of the last node, None if unknown."""
        node = self._robot.progress.last_node
        position = node.node_position if node else None
        return Pose(position.x, position.y, position.theta or 0.0, position.map_id) if position else None

    @property
    def own_goals(self) -> OwnGoals | None:
        """Return the robot's own goals that navigation last reported, None if there were none."""
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
        """Return the robot's phase of hibernation or shutdown."""
        return self._robot.power

    @property
    def waits(self) -> bool:
        """Return whether a timeout is running; then :class:`TimePassed` events are needed."""
        robot = self._robot
        if robot.power is not PowerPhase.AWAKE:
            return True
        retries = robot.goal.retry_at is not None
        own = robot.goal.halting or retries or robot.link.waits
        return own or robot.position_request is not None or robot.zone_requests.waits

    @property
    def durable_version(self) -> tuple[object, ...]:
        """Return a value that changes whenever :meth:`memory` does."""
        return (*self._durable(), self._robot.header_ids)

    def memory(self) -> Memory:
        """Return the data that must survive the end of the process."""
        return memory_of(self._robot)

    def _durable(self) -> tuple[object, ...]:
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

    def _visible(self) -> tuple[object, ...]:
        """Return the values whose change triggers a state (section 6.6)."""
        robot = self._robot
        pose, battery = robot.reports.pose, robot.reports.battery
        return (
            *self._durable(),
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


def _note_time(robot: RobotState, event: Event) -> None:
    """Record the time of day, if ``event`` contains it."""
    match event:
        case Started(utc) | TimePassed(utc) if utc:
            robot.utc = (utc, robot.now)
        case OrderReceived(_, utc) | InstantActionsReceived(_, utc) | ResponsesReceived(_, utc) if utc:
            robot.utc = (utc, robot.now)
        case _:
            pass


def _time_passed(_robot: RobotState, _event: TimePassed) -> None:
    """Do nothing: only the time has changed."""


def _started(robot: RobotState, _: Started) -> None:
    """Continue interrupted work; what the robot did in the meantime is unknown."""
    robot.link.lost_since = robot.now
    instant_actions.position_interrupted(robot)
    if robot.clearing or robot.paused or driving.has_leftover_goal(robot):
        driving.request_halt(robot)
    power.continue_after_restart(robot)
    actions.continue_after_restart(robot)
    actions.schedule(robot)


def _order_received(robot: RobotState, event: OrderReceived) -> None:
    orders.receive(robot, event.order, dated=event.dated)


def _instant_actions_received(robot: RobotState, event: InstantActionsReceived) -> None:
    instant_actions.receive(robot, event.message)


def _zone_set_received(robot: RobotState, event: ZoneSetReceived) -> None:
    zones.accept(robot, event.message.zone_set)


def _responses_received(robot: RobotState, event: ResponsesReceived) -> None:
    zones.apply_responses(robot, event.message, event.utc)


def _message_refused(robot: RobotState, event: MessageRefused) -> None:
    robot.errors.report(event.error, event.until)


def _action_reported(robot: RobotState, event: ActionReport) -> None:
    if event.zone_set and (problem := zones.accept(robot, event.zone_set)):
        event = ActionReport(event.action_id, ActionStatus.FAILED, problem)
    actions.apply_report(robot, event)
    actions.schedule(robot)


def _load_sensed(robot: RobotState, event: LoadSensed) -> None:
    robot.loads = sensed(robot.loads, loaded=event.loaded)


def _store(robot: RobotState, event: Event) -> None:
    """Store a report that has no other effect."""
    match event:
        case PluginsReport(problems):
            robot.plugin_problems = problems
        case JournalReport(problem):
            robot.journal_problem = problem
        case MapsReport(maps):
            robot.maps = maps
        case SubscriptionsReport(refused):
            robot.refused_topics = refused
        case SafetyReport():
            robot.reports.safety = event
        case PauseButton(pressed):
            robot.reports.pause_button = pressed
        case VelocityReport():
            robot.reports.velocity = event
        case SessionReport():
            robot.reports.session = event
        case PlanReport():
            robot.reports.plan = event


def _link_reported(robot: RobotState, event: LinkReport) -> None:
    robot.link.lost_since = None if event.connected else robot.now
    if event.connected and robot.power.signs_off:
        robot.effects.append(ReportState())  # the last one may not have been sent


def _error_switched(robot: RobotState, event: ErrorSwitched) -> None:
    if event.active:
        robot.errors.report(event.error, Until.WITHDRAWN)
    else:
        robot.errors.withdraw(event.error)


def _local_trigger(robot: RobotState, event: LocalTrigger) -> None:
    actions.release(robot, event.trigger_type)


def _halted(robot: RobotState, _: Halted) -> None:
    driving.halted(robot)


def _pose_reported(robot: RobotState, event: PoseReport) -> None:
    """Store a pose; one with NaN or infinity is ignored."""
    if all(isfinite(each) for each in (event.pose.x, event.pose.y, event.pose.theta)):
        robot.reports.pose = event
        robot.reports.velocity = VelocityReport(event.vx, event.omega)
        route_progress.pose_changed(robot)
        driving.pose_changed(robot)


def _halt_failed(robot: RobotState, event: HaltFailed) -> None:
    """Fail the actions that wait for standstill; a cancelled order is cleared once it is confirmed."""
    driving.halt_failed(robot, event.description)
    for action_type in (CANCEL_ORDER, START_PAUSE):
        robot.end_instant_actions(action_type, ActionStatus.FAILED, event.description)
    power.halt_failed(robot, event.description)


def _battery_reported(robot: RobotState, event: BatteryReport) -> None:
    """Store a battery report; one with a charge outside of 0 to 100 % is ignored."""
    if 0.0 <= event.state_of_charge <= FULL:
        robot.reports.battery = event


def _collision_reported(robot: RobotState, event: CollisionReport) -> None:
    robot.reports.collision = event if event.stops else None


def _progress_reported(robot: RobotState, event: DriveProgress) -> None:
    before = robot.reports.progress
    if event.recoveries > (before.recoveries if before else 0):
        robot.reports.recovered_at = robot.now
    robot.reports.progress = event


def _limits_reported(robot: RobotState, event: DriveLimits) -> None:
    """Record navigation's goal tolerance, and send a factsheet that reports it."""
    if event != robot.reports.limits:
        robot.reports.limits = event
        robot.effects.append(SendFactsheet())


def _blocked_reported(robot: RobotState, event: BlockedReport) -> None:
    robot.reports.blocked = event if event.blocked else None


def _no_route_reported(robot: RobotState, event: NoRouteReport) -> None:
    robot.reports.no_route = event.areas


def _goals_reported(robot: RobotState, event: GoalTable) -> None:
    robot.reports.goals = event
    robot.goal.listed(event.own)


_HANDLERS: dict[type, Callable[[RobotState, Any], None]] = {
    Started: _started,
    OrderReceived: _order_received,
    InstantActionsReceived: _instant_actions_received,
    ZoneSetReceived: _zone_set_received,
    ResponsesReceived: _responses_received,
    MapsReport: _store,
    MessageRefused: _message_refused,
    ActionReport: _action_reported,
    LoadSensed: _load_sensed,
    PluginsReport: _store,
    JournalReport: _store,
    LinkReport: _link_reported,
    SubscriptionsReport: _store,
    OperatingModeSwitched: orders.switch_mode,
    SafetyReport: _store,
    PauseButton: _store,
    ErrorSwitched: _error_switched,
    LocalTrigger: _local_trigger,
    TimePassed: _time_passed,
    SignedOff: power.signed_off,
    PowerReport: power.command_ended,
    Arrived: driving.arrived,
    DriveFailed: driving.failed,
    Halted: _halted,
    HaltFailed: _halt_failed,
    VelocityReport: _store,
    NavigationReport: driving.navigation_changed,
    PlanReport: _store,
    DriveProgress: _progress_reported,
    DriveLimits: _limits_reported,
    BlockedReport: _blocked_reported,
    CollisionReport: _collision_reported,
    NoRouteReport: _no_route_reported,
    PoseReport: _pose_reported,
    BatteryReport: _battery_reported,
    PositionInitialized: instant_actions.position_initialized,
    GoalTable: _goals_reported,
    SessionReport: _store,
}
