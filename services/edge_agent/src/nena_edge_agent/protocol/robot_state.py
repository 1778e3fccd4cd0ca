"""The state of one robot: everything that the protocol core keeps and changes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from enum import StrEnum
from math import hypot

from nena_edge_agent.driver import port
from nena_edge_agent.protocol.action_states import STOPS_DRIVING, ActionQueue, ActionRecord, ActionStates
from nena_edge_agent.protocol.capabilities import Capabilities, ExternalGoals, LinkLossPolicy
from nena_edge_agent.protocol.declaration import WAIT_FOR_TRIGGER
from nena_edge_agent.protocol.errors import ActiveErrors
from nena_edge_agent.protocol.events import Effect, Halt, SafetyReport
from nena_edge_agent.protocol.order_progress import OrderHistory, OrderProgress
from nena_edge_agent.protocol.zone_sets import ZoneRequests, ZoneSets
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import NodePosition
from nena_shared.vda5050.state import EmergencyStop, Load, Map, MapStatus, OperatingMode
from nena_shared.vda5050.topics import Topic

INSTANT_ACTION_LIMIT = 200
"""Maximum number of instant action states; beyond it, ended ones are dropped, then new ones are refused."""
SAFE = SafetyReport()
UNKNOWN_VELOCITY = port.VelocityReport(None, None)
NO_GOALS = port.GoalTable()
NOT_REPORTED = port.NavigationReport(
    available=False, reason="the agent is starting; navigation has not reported yet", starting=True
)


@dataclass(slots=True)
class Reports:
    """The latest reports of the driver and of people at the robot.

    ``recovered_at`` is the monotonic time, s, at which navigation last started a recovery.
    """

    pose: port.PoseReport | None = None
    velocity: port.VelocityReport = UNKNOWN_VELOCITY
    battery: port.BatteryReport | None = None
    navigation: port.NavigationReport = NOT_REPORTED
    no_route: tuple[port.Circle, ...] = ()
    goals: port.GoalTable = NO_GOALS
    blocked: port.BlockedReport | None = None
    collision: port.CollisionReport | None = None
    keep_out: port.KeepOutReport | None = None
    plan: port.PlanReport | None = None
    progress: port.DriveProgress | None = None
    recovered_at: float | None = None
    limits: port.DriveLimits | None = None
    safety: SafetyReport = SAFE
    pause_button: bool = False
    session: port.SessionReport | None = None

    @property
    def localized_pose(self) -> port.Pose | None:
        """Return the robot's pose, None if it is not localised."""
        return self.pose.pose if self.pose and self.pose.localized else None


@dataclass(slots=True)
class CurrentGoal:
    """The driver's goal, its failures, and a requested halt. Times are monotonic, s.

    Attributes:
        generation: number of the last goal.
        target: sequenceId of the node that the robot drives to, None without a goal.
        halting_since: time of a requested halt that is not confirmed yet.
        halt_problem: why standstill cannot be confirmed, if the driver has reported that.
        stood: the driver has confirmed a standstill since the last goal, own or another program's.
        failed_at: sequenceId of a node that was not reached; it is not retried until the order changes.
        failures: number of failed drives to the next node.
        retries: maximum number of retries after the last failure.
        retry_at: time of the next retry.
        problem: reason of the last failure.
        pose: pose of the last goal.
        ahead: poses after it.
        path: path to follow; empty: navigation plans one.
        own: own goals that navigation has or may have.
        listed_ids: IDs of own goals that navigation last listed.
        result_pending: the result of ``own`` has not been reported yet.
    """

    generation: int = 0
    target: int | None = None
    halting_since: float | None = None
    halt_problem: str = ""
    stood: bool = False
    failed_at: int | None = None
    failures: int = 0
    retries: int = 0
    retry_at: float | None = None
    problem: str = ""
    pose: port.Pose | None = None
    ahead: tuple[port.Pose, ...] = ()
    path: tuple[tuple[float, float], ...] = ()
    own: port.OwnGoals | None = None
    listed_ids: tuple[str, ...] = ()
    result_pending: bool = False

    def record_listed(self, goal_ids: tuple[str, ...]) -> None:
        """Record which own goals navigation lists; a new one is the goal that was sent last."""
        own, self.listed_ids = self.own, goal_ids
        if not goal_ids:
            self.own = own if self.result_pending else None  # the result follows in a moment
        elif own and set(goal_ids) <= set(own.goal_ids):
            self.own = replace(own, goal_ids=goal_ids)
        else:
            self.own = port.OwnGoals(goal_ids, self.pose) if self.pose else None

    def record_sent(self, pose: port.Pose, behind: str) -> None:
        """Record that a goal to ``pose`` is about to be sent; ``behind`` is the last goal listed before that.

        If an earlier run has already sent it, it is listed after the goal that was the last one then. A goal
        with a path is never listed: after a restart, the last goal in the list is another client's.
        """
        own = self.own or port.OwnGoals((), pose)
        if self.path:
            self.own = port.OwnGoals(own.goal_ids, own.pose)
        else:
            given = own.given if self.result_pending else None
            again = given and (given.x, given.y, given.map_id) == (pose.x, pose.y, pose.map_id)
            self.own = port.OwnGoals(own.goal_ids, own.pose, pose, own.behind if again else behind)
        self.pose, self.result_pending = pose, True

    def record_end(self) -> None:
        """Record the end of the drive; goals that navigation still lists remain own goals."""
        self.result_pending = False
        if self.own:
            self.own = port.OwnGoals(self.listed_ids, self.own.pose) if self.listed_ids else None

    def forget_failures(self) -> None:
        """Reset the failures, because the next node or the order has changed."""
        self.failed_at, self.failures, self.retry_at, self.problem = None, 0, None, ""

    def retry(self, at: float, problem: str, retries: int) -> None:
        """Record that the drive has failed and is retried at the monotonic time ``at``, s."""
        self.target, self.failures, self.retry_at, self.problem = None, self.failures + 1, at, problem
        self.retries = retries

    def restore(self, own: port.OwnGoals) -> None:
        """Restore the goals of an earlier run, whose result is pending."""
        self.own, self.pose, self.result_pending = own, own.given or own.pose, True

    @property
    def moving(self) -> bool:
        """Return whether the robot has a goal or a halt that is not confirmed."""
        return self.target is not None or self.halting_since is not None

    @property
    def pending(self) -> bool:
        """Return whether the result of an own goal is pending, possibly of an earlier run."""
        return self.own is not None and self.result_pending

    @property
    def halting(self) -> bool:
        """Return whether a halt is not confirmed yet."""
        return self.halting_since is not None

    def is_current(self, generation: int) -> bool:
        """Return whether an event of ``generation`` is about the current goal."""
        return self.target is not None and generation == self.generation


@dataclass(frozen=True, slots=True)
class EdgeEnd:
    """The end of a traversed edge with a speed limit, m/s: the robot was at ``pose`` when it was traversed.

    Within ``radius`` m of the node the robot counts as there (section 6.6.2), but may still be on the edge.
    """

    maximum_speed: float
    node: NodePosition
    pose: port.Pose
    radius: float

    def is_ahead_of(self, pose: port.Pose) -> bool:
        """Return whether a robot at ``pose`` has neither passed the node nor left its surroundings."""
        node, since = self.node, self.pose
        x, y = pose.x - node.x, pose.y - node.y
        ahead = x * (node.x - since.x) + y * (node.y - since.y) < 0
        return ahead and hypot(x, y) <= self.radius and pose.map_id == node.map_id


@dataclass(slots=True)
class LinkWatch:
    """The connection to the broker (section 4.1); ``lost_since`` is monotonic, s, None while connected.

    Without the broker, the robot may drive for ``timeout`` seconds.
    """

    policy: LinkLossPolicy
    timeout: float
    lost_since: float | None = None

    @property
    def waits(self) -> bool:
        """Return whether the timeout of a lost link is running."""
        return self.lost_since is not None and self.policy is not LinkLossPolicy.ASSERTIVE

    def out_of_reach(self, now: float) -> bool:
        """Return whether the robot must not begin to drive to another node."""
        since = self.lost_since
        return self.waits and since is not None and now - since >= self.timeout

    def must_stop(self, now: float) -> bool:
        """Return whether the robot must stop where it is."""
        return self.policy is LinkLossPolicy.PREVENTIVE_AT_ONCE and self.out_of_reach(now)


@dataclass(slots=True)
class RouteProgress:
    """Distances driven since the last node and since the start of the order, m (section 6.6.2)."""

    pose: port.Pose | None = None
    node: tuple[str, int] | None = None
    order_id: str = ""
    since_node: float = 0.0
    in_order: float = 0.0


@dataclass(frozen=True, slots=True)
class PositionRequest:
    """A pose sent to the localisation, at the node ``node_id``; ``requested_at`` is monotonic, s."""

    node_id: str
    requested_at: float


@dataclass(frozen=True, slots=True)
class ZoneSetRequest:
    """A running enableZoneSet; ``requested_at`` is monotonic, s."""

    action_id: str
    zone_set_id: str
    requested_at: float


class PowerPhase(StrEnum):
    """The phase of hibernation or shutdown (section 6.2.3)."""

    AWAKE = "AWAKE"
    FALLING_ASLEEP = "FALLING_ASLEEP"
    """startHibernation is running: the order is being cleared, the robot stops."""
    SIGNING_OFF = "SIGNING_OFF"
    """startHibernation is FINISHED; the state that reports this has not been sent."""
    HIBERNATING = "HIBERNATING"
    WAKING = "WAKING"
    """The wake command is running."""
    SHUTTING_DOWN = "SHUTTING_DOWN"
    """shutdown is FINISHED; the state that reports this has not been sent."""

    @property
    def silent(self) -> bool:
        """Return whether the robot sends no states (section 6.5)."""
        return self in (PowerPhase.HIBERNATING, PowerPhase.WAKING)

    @property
    def signs_off(self) -> bool:
        """Return whether the next state is the last one."""
        return self in (PowerPhase.SIGNING_OFF, PowerPhase.SHUTTING_DOWN)


@dataclass(slots=True)
class RobotState:
    """The state of one robot, and the effects of the current event.

    Attributes:
        queue: actions of reached nodes and entered edges that have not ended.
        instant_queue: instant actions that have not ended and during which the robot must not drive.
        restarts: active actions that start again as soon as they may: a restart of the agent has interrupted
            them, or fleet control retries them.
        standstill_by: monotonic time, s, by which the robot must stand for an action that waits for it to;
            infinite while the robot waits for something else to end; None: no action waits.
        moves_since: monotonic time, s, since which it moves although nothing drives it; None: it does not.
        known_instant_ids: recent actionIds of instant actions, oldest first.
        wanted_mode: mode that a person has selected and the state does not report yet.
        paused: fleet control's own pause.
        hold_applied: driving and actions are paused, for any reason.
        clearing: the order is being ended early.
        wake_up_at: end of the hibernation.
        kept_awake_since: monotonic time, s, since which something other than the order prevents hibernation;
            None: nothing does.
        header_ids: first headerId of each topic for the next run of the program.
        zones_checked: zones were relevant at the last event.
        speed_limit: speed limit of zones and edges, m/s.
        edge_ends: ends of traversed edges whose speed limits still hold.
        zone_set_requests: zone sets to enable once navigation plans around their BLOCKED zones.
        areas: areas that navigation plans around, by the zone sets and requests of ``areas_revision``.
        utc: time of day with the monotonic time, s, at which it was read; None: unknown.
        now: monotonic time of the current event, s.
        effects: effects of the current event.
    """

    capabilities: Capabilities
    progress: OrderProgress
    history: OrderHistory = field(default_factory=OrderHistory)
    actions: ActionStates = field(default_factory=ActionStates)
    queue: ActionQueue = field(default_factory=ActionQueue)
    instant_queue: ActionQueue = field(default_factory=ActionQueue)
    restarts: set[str] = field(default_factory=set)
    standstill_by: float | None = None
    moves_since: float | None = None
    instant_actions: ActionStates = field(default_factory=ActionStates)
    known_instant_ids: dict[str, None] = field(default_factory=dict)
    errors: ActiveErrors = field(default_factory=ActiveErrors)
    goal: CurrentGoal = field(default_factory=CurrentGoal)
    route: RouteProgress = field(default_factory=RouteProgress)
    reports: Reports = field(default_factory=Reports)
    position_request: PositionRequest | None = None
    operating_mode: OperatingMode = OperatingMode.AUTOMATIC
    wanted_mode: OperatingMode | None = None
    loads: tuple[Load, ...] = ()
    charging: bool = False
    paused: bool = False
    hold_applied: bool = False
    clearing: bool = False
    power: PowerPhase = PowerPhase.AWAKE
    wake_up_at: datetime | None = None
    kept_awake_since: float | None = None
    journal_problem: str = ""
    header_ids: tuple[tuple[Topic, int], ...] = ()
    refused_topics: tuple[str, ...] = ()
    plugin_problems: tuple[str, ...] = ()
    zone_requests: ZoneRequests = field(default_factory=ZoneRequests)
    zones_checked: bool = False
    speed_limit: float | None = None
    edge_ends: tuple[EdgeEnd, ...] = ()
    zone_set_requests: tuple[ZoneSetRequest, ...] = ()
    areas: tuple[port.Area, ...] = ()
    areas_revision: tuple[int, tuple[ZoneSetRequest, ...]] = (0, ())
    utc: tuple[datetime, float] | None = None
    now: float = 0.0
    effects: list[Effect] = field(default_factory=list)
    maps: tuple[Map, ...] = field(init=False)
    zone_sets: ZoneSets = field(init=False)
    link: LinkWatch = field(init=False)

    def __post_init__(self) -> None:
        """Add what depends on the capabilities: the configured map, zone sets and the link."""
        configured = Map(
            map_id=self.capabilities.map_id,
            map_version=self.capabilities.map_version,
            map_status=MapStatus.ENABLED,
        )
        self.maps = (configured,)
        self.zone_sets = ZoneSets(self.capabilities.zones)
        self.link = LinkWatch(self.capabilities.link_loss, self.capabilities.link_loss_timeout)

    @property
    def utc_now(self) -> datetime | None:
        """Return the time of day of the current event, None if it is unknown."""
        return self.utc[0] + timedelta(seconds=self.now - self.utc[1]) if self.utc else None

    @property
    def map_ids(self) -> frozenset[str]:
        """Return the mapIds of the maps on the robot."""
        return frozenset(robot_map.map_id for robot_map in self.maps)

    @property
    def idle(self) -> bool:
        """Return whether the robot is idle: nothing of the order is left to do (section 6.6.8)."""
        # A robot at its decision point with a horizon left is not idle: it waits for an update. Instant
        # actions do not count (6.6.8).
        return not self.progress.nodes and not self.progress.edges and self.actions.all_ended

    def is_in_horizon(self, record: ActionRecord) -> bool:
        """Return whether an action of the order is not released yet."""
        # sequenceIds rise along the order, of nodes and edges alike (7.3).
        decision_point = self.progress.decision_point
        return decision_point is not None and record.sequence_id > decision_point[1]

    @property
    def base_actions(self) -> list[ActionRecord]:
        """Return the actions of the order that are released."""
        return [record for record in self.actions if not self.is_in_horizon(record)]

    @property
    def waits_for_external_goal(self) -> bool:
        """Return whether the order waits until another program's goal has ended."""
        pauses = self.capabilities.external_goals is ExternalGoals.PAUSE
        return pauses and bool(self.reports.goals.external)

    @property
    def driving_allowed(self) -> bool:
        """Return whether no SOFT or HARD action is left, of the order or instant (section 6.2.2)."""
        return self.queue.driving_allowed and self.instant_queue.driving_allowed

    @property
    def moves(self) -> bool:
        """Return whether the robot drives for us, or moves by its odometry for nobody else.

        Others are a program with a goal of its own, and a person in a mode without fleet control.
        """
        explained = self.reports.goals.external or not self.next_mode.fleet_controls
        return self.goal.moving or (self.reports.velocity.moves and not explained)

    @property
    def stands(self) -> bool:
        """Return whether it is known that the robot stands and that nothing drives it."""
        if self.goal.moving or self.reports.goals.external:
            return False
        velocity = self.reports.velocity
        # Without odometry only the driver's answer to a halt tells.
        return self.goal.stood if velocity.vx is None else not velocity.moves

    @property
    def action_may_move(self) -> bool:
        """Return whether a SOFT or HARD action is running: such an action may move the robot (section 6.2.2).

        While one does, the robot must not be told to stop: the action would lose its goal.
        """
        return any(
            record.status in (ActionStatus.INITIALIZING, ActionStatus.RUNNING)
            and record.action.action_id not in self.restarts
            and record.action.action_type != WAIT_FOR_TRIGGER
            for record in (*self.actions, *self.instant_actions)
            if self.needs_standstill(record)
        )

    def needs_standstill(self, record: ActionRecord) -> bool:
        """Return whether the robot must not drive during the action (section 6.2.2)."""
        if record.scope is ActionScope.INSTANT:
            return record.action.action_id in self.instant_queue
        return record.action.blocking_type in STOPS_DRIVING

    def holds_for(self, instant_action: Action) -> bool:
        """Return whether the robot must not drive during an instant action (2.x section 6.12).

        3.0 reads each of them as NONE, and so does the factsheet with those that are never part of an order.
        """
        declaration = self.capabilities.actions.get(instant_action.action_type)
        blocks = instant_action.blocking_type in STOPS_DRIVING
        return blocks and declaration is not None and not declaration.only_instant

    def request_halt(self) -> None:
        """Stop the robot even without a known goal: after a restart or a failure, what it does is unknown."""
        self.goal.halting_since = self.now
        self.effects.append(Halt())

    @property
    def next_mode(self) -> OperatingMode:
        """Return the selected mode, even before the state reports it (section 6.6.6)."""
        return self.wanted_mode or self.operating_mode

    @property
    def fatal(self) -> bool:
        """Return whether a reported error or a failed disk prevents new orders (section 6.6.5.1)."""
        return self.errors.worst_reported is ErrorLevel.FATAL or bool(self.journal_problem)

    @property
    def held(self) -> bool:
        """Return whether the robot must stop and pause its actions, for any reason."""
        safety = self.reports.safety
        return (
            self.paused
            or self.reports.pause_button
            or safety.field_violation
            or safety.emergency_stop is not EmergencyStop.NONE
            or self.operating_mode is OperatingMode.INTERVENED
            # A CRITICAL error needs fleet control, a FATAL one a person; both stop the robot (6.6.5.1).
            or self.errors.worst_reported in (ErrorLevel.CRITICAL, ErrorLevel.FATAL)
        )

    @property
    def instant_actions_running(self) -> int:
        """Return the number of instant actions that have not ended."""
        return sum(not record.status.ended for record in self.instant_actions)

    def running_instant_actions(self, action_type: str) -> list[str]:
        """Return the IDs of the instant actions of one type that have not ended."""
        return [
            record.action.action_id
            for record in self.instant_actions
            if record.action.action_type == action_type and not record.status.ended
        ]

    def end_instant_actions(self, action_type: str, status: ActionStatus, result: str | None = None) -> None:
        """End all instant actions of one type that have not ended."""
        for action_id in self.running_instant_actions(action_type):
            self.instant_actions.change(action_id, status, result)
