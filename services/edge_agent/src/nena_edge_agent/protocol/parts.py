"""What a robot core is made of: each part owns one piece of its state."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime, timedelta

from nena_edge_agent.driver.port import (
    BatteryReport,
    BlockedReport,
    Circle,
    DriveProgress,
    GoalTable,
    NavigationReport,
    PlanReport,
    Pose,
    PoseReport,
    SessionReport,
    VelocityReport,
)
from nena_edge_agent.protocol.action_states import ActionQueue, ActionStates
from nena_edge_agent.protocol.capabilities import Capabilities, ExternalGoals, LinkWatch
from nena_edge_agent.protocol.driving import GoalInFlight
from nena_edge_agent.protocol.errors import ActiveErrors
from nena_edge_agent.protocol.events import Effect, SafetyReport
from nena_edge_agent.protocol.order_progress import OrderHistory, OrderProgress
from nena_edge_agent.protocol.zone_sets import ZoneAccess, ZoneSets
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.state import EmergencyStop, Load, Map, MapStatus, OperatingMode
from nena_shared.vda5050.topics import Topic

SAFE = SafetyReport()
UNKNOWN_VELOCITY = VelocityReport(None, None)
NO_GOALS = GoalTable()
NOT_REPORTED = NavigationReport(available=False, reason="navigation has not reported yet")


@dataclass(slots=True)
class Senses:
    """What the driver, or a person at the robot, told last."""

    pose: PoseReport | None = None
    velocity: VelocityReport = UNKNOWN_VELOCITY
    battery: BatteryReport | None = None
    navigation: NavigationReport = NOT_REPORTED
    no_route: tuple[Circle, ...] = ()
    goals: GoalTable = NO_GOALS
    blocked: BlockedReport | None = None
    plan: PlanReport | None = None
    progress: DriveProgress | None = None
    safety: SafetyReport = SAFE
    pause_button: bool = False
    session: SessionReport | None = None

    @property
    def unsafe(self) -> bool:
        """Whether an emergency stop or the protective field keeps the robot from moving."""
        return self.safety.field_violation or self.safety.emergency_stop is not EmergencyStop.NONE

    @property
    def trusted_pose(self) -> Pose | None:
        """Where the robot is, if it is sure of it."""
        return self.pose.pose if self.pose and self.pose.localized else None


@dataclass(slots=True)
class RobotParts:
    """The state of one robot, and the effects that the event at hand has had so far.

    ``now`` is the monotonic time in s of the event at hand. ``paused`` is fleet control's own pause,
    ``holding`` that driving and actions were held, for whatever reason. ``clearing``: the order is being
    ended before its end. ``wanted_mode`` is the mode that a person has switched to and the state does not
    show yet. ``utc`` is a time of day with the monotonic time in s at which it was, None: nobody has told.
    ``speed_limit`` in m/s is what the zones ask of the driver. ``maps`` are those that the robot holds.
    ``header_ids`` are those from which the next run of the program counts on.
    """

    capabilities: Capabilities
    progress: OrderProgress = field(default_factory=OrderProgress)
    history: OrderHistory = field(default_factory=OrderHistory)
    actions: ActionStates = field(default_factory=ActionStates)
    queue: ActionQueue = field(default_factory=ActionQueue)
    instants: ActionStates = field(default_factory=ActionStates)
    known_instant_ids: dict[str, None] = field(default_factory=dict)
    errors: ActiveErrors = field(default_factory=ActiveErrors)
    goal: GoalInFlight = field(default_factory=GoalInFlight)
    senses: Senses = field(default_factory=Senses)
    operating_mode: OperatingMode = OperatingMode.AUTOMATIC
    wanted_mode: OperatingMode | None = None
    loads: tuple[Load, ...] = ()
    charging: bool = False
    paused: bool = False
    holding: bool = False
    clearing: bool = False
    journal_problem: str = ""
    header_ids: tuple[tuple[Topic, int], ...] = ()
    refused_topics: tuple[str, ...] = ()
    plugin_problems: tuple[str, ...] = ()
    zone_access: ZoneAccess = field(default_factory=ZoneAccess)
    speed_limit: float | None = None
    utc: tuple[datetime, float] | None = None
    now: float = 0.0
    effects: list[Effect] = field(default_factory=list)
    maps: tuple[Map, ...] = field(init=False)
    zone_sets: ZoneSets = field(init=False)
    link: LinkWatch = field(init=False)

    def __post_init__(self) -> None:
        """Hold the map of the set-up, and no zones."""
        one = Map(
            map_id=self.capabilities.map_id,
            map_version=self.capabilities.map_version,
            map_status=MapStatus.ENABLED,
        )
        self.maps = (one,)
        self.zone_sets = ZoneSets(self.capabilities.zones)
        self.link = LinkWatch(self.capabilities.link_loss, self.capabilities.link_loss_patience)

    @property
    def utc_now(self) -> datetime | None:
        """The time of day of the event at hand, None if it is not known."""
        return self.utc[0] + timedelta(seconds=self.now - self.utc[1]) if self.utc else None

    @property
    def map_ids(self) -> frozenset[str]:
        """The areas that the robot has a map of."""
        return frozenset(each.map_id for each in self.maps)

    @property
    def idle(self) -> bool:
        """Whether nothing of the order is left to do (section 6.6.8)."""
        return not self.progress.nodes and not self.progress.edges and self.actions.all_ended

    @property
    def gives_way(self) -> bool:
        """Whether driving waits for the end of a goal that somebody else gave."""
        pauses = self.capabilities.external_goals is ExternalGoals.PAUSE
        return pauses and bool(self.senses.goals.external)

    @property
    def coming_mode(self) -> OperatingMode:
        """The mode that a person has switched to, also while the state does not show it yet."""
        return self.wanted_mode or self.operating_mode

    @property
    def fatal(self) -> bool:
        """Whether the robot takes no orders: for an error that somebody has shown, or for the disk."""
        return self.errors.worst_reported is ErrorLevel.FATAL or bool(self.journal_problem)

    @property
    def held(self) -> bool:
        """Whether the robot is to stand, and no action is to begin or to go on that can be held."""
        return (
            self.paused
            or self.senses.pause_button
            or self.senses.unsafe
            or self.operating_mode is OperatingMode.INTERVENED
            or self.errors.hindering
        )

    def instants_running(self, action_type: str) -> list[str]:
        """Give the ids of the instant actions of one type that have not ended."""
        return [
            record.action.action_id
            for record in self.instants
            if record.action.action_type == action_type and not record.status.ended
        ]

    def end_instants(self, action_type: str, status: ActionStatus, result: str | None = None) -> None:
        """End all instant actions of one type that have not ended."""
        for action_id in self.instants_running(action_type):
            self.instants.change(action_id, status, result)
