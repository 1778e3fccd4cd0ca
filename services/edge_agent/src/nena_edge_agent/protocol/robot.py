"""The mobile robot's protocol core: joins the parts, one event at a time."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any

from nena_edge_agent.driver.port import (
    Arrived,
    BatteryReport,
    BlockedReport,
    DriveFailed,
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
from nena_edge_agent.protocol.action_flow import ActionFlow
from nena_edge_agent.protocol.action_states import sensed
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.clearing import Clearing
from nena_edge_agent.protocol.conditions import check_conditions
from nena_edge_agent.protocol.declaration import CANCEL_ORDER, START_PAUSE, WAIT_FOR_TRIGGER
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
    ReportState,
    ResponsesReceived,
    SafetyReport,
    Started,
    SubscriptionsReport,
    TimePassed,
    ZoneSetReceived,
)
from nena_edge_agent.protocol.instant_actions import InstantActionFlow
from nena_edge_agent.protocol.journey import Journey
from nena_edge_agent.protocol.memory import Memory
from nena_edge_agent.protocol.mode_switch import ModeSwitch
from nena_edge_agent.protocol.order_cancel import OrderCancel
from nena_edge_agent.protocol.order_intake import OrderIntake
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.pause import Pause
from nena_edge_agent.protocol.position_setting import PositionSetting
from nena_edge_agent.protocol.recollection import recall, recollect
from nena_edge_agent.protocol.retry import Retry
from nena_edge_agent.protocol.state_report import make_state, make_visualization
from nena_edge_agent.protocol.travel import Travel
from nena_edge_agent.protocol.trigger import Trigger
from nena_edge_agent.protocol.zone_guard import ZoneGuard
from nena_edge_agent.protocol.zone_keeping import ZoneKeeping
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.visualization import Visualization

REQUESTS = (OrderReceived, InstantActionsReceived, MessageRefused)
"""Events that are answered by a state even if nothing has changed: the sender waits for an echo."""

FULL = 100.0
"""Percent."""


class RobotCore:
    """One robot as VDA 5050 sees it.

    Each call of :meth:`handle` takes one event to its end and gives the effects, to be done in their order by
    the shell, after it has made :meth:`memory` durable if :attr:`durable_version` has changed.
    """

    def __init__(self, capabilities: Capabilities, memory: Memory | None = None) -> None:
        parts = recollect(memory, capabilities) if memory else RobotParts(capabilities)
        self._parts = parts
        self._flow = ActionFlow(parts)
        self._zones = ZoneGuard(parts)
        self._zone_keeping = ZoneKeeping(parts)
        self._travel = Travel(parts, self._flow, self._zones)
        self._clearing = Clearing(parts, self._flow, self._travel)
        self._cancel = OrderCancel(parts, self._clearing)
        self._mode = ModeSwitch(parts, self._clearing)
        self._journey = Journey(parts)
        self._pause = Pause(parts, self._flow, self._travel)
        self._position = PositionSetting(parts)
        self._trigger = Trigger(parts, self._flow)
        self._instants = InstantActionFlow(
            parts,
            cancel=self._cancel,
            pause=self._pause,
            position=self._position,
            retry=Retry(parts, self._flow),
            trigger=self._trigger,
            zones=self._zone_keeping,
        )
        self._flow.own |= self._instants.on_nodes | {WAIT_FOR_TRIGGER: lambda _: (ActionStatus.RUNNING, None)}
        self._intake = OrderIntake(parts, self._flow)
        self._handlers = self._make_handlers()
        self._shown = self._visible()

    def handle(self, event: Event, now: float) -> tuple[Effect, ...]:
        """Take in ``event`` at the monotonic time ``now`` in s; gives what is to be done."""
        parts = self._parts
        parts.now, parts.effects = now, []
        self._handlers[type(event)](event)
        self._pause.apply()
        self._zones.expire()
        self._travel.advance()
        self._pause.advance()
        self._clearing.advance()
        self._mode.advance()
        self._position.advance()
        self._zones.advance()
        self._journey.advance()
        check_conditions(parts)
        shown = self._visible()
        if shown != self._shown or isinstance(event, REQUESTS):
            self._shown = shown
            parts.effects.append(ReportState())
        return tuple(parts.effects)

    def state(self, header: dict[str, Any]) -> State:
        """Make the state message under ``header``, its five header fields by their neutral names."""
        asks = self._travel.new_base_request
        return make_state(header, self._parts, self._journey, new_base_request=asks)

    def visualization(self, header: dict[str, Any], state_header_id: int) -> Visualization:
        """Make the visualization message that goes with the state of ``state_header_id``."""
        return make_visualization(header, self._parts, self._journey, state_header_id=state_header_id)

    @property
    def parts(self) -> RobotParts:
        """What the robot is made of, to be read."""
        return self._parts

    @property
    def last_place(self) -> Pose | None:
        """The place of the node that was reached last, None if that is not known."""
        node = self._parts.progress.last_node
        place = node.node_position if node else None
        return Pose(place.x, place.y, place.theta or 0.0, place.map_id) if place else None

    @property
    def own_goals(self) -> OwnGoals | None:
        """The goals that navigation drove to for this robot when last heard, None: there were none."""
        return self._parts.goal.own

    @property
    def header_ids(self) -> tuple[tuple[Topic, int], ...]:
        """The headerId of each topic that the next run of the program begins with."""
        return self._parts.header_ids

    @header_ids.setter
    def header_ids(self, header_ids: tuple[tuple[Topic, int], ...]) -> None:
        self._parts.header_ids = header_ids

    @property
    def waits(self) -> bool:
        """Whether an answer is outstanding that may be overdue; then :class:`TimePassed` is wanted."""
        parts = self._parts
        retries = parts.goal.retry_at is not None
        own = parts.goal.halting or retries or parts.link.waits
        return own or self._position.waits or parts.zone_access.waits

    @property
    def durable_version(self) -> tuple[object, ...]:
        """Something that differs when :meth:`memory` does."""
        return (*self._lasting(), self._parts.header_ids)

    def memory(self) -> Memory:
        """Give what must survive the end of the process."""
        return recall(self._parts)

    def _lasting(self) -> tuple[object, ...]:
        """Give what differs when the memory does, but for the ids of messages."""
        parts = self._parts
        return (
            parts.progress.revision,
            parts.actions.revision,
            parts.instants.revision,
            parts.loads,
            parts.charging,
            parts.paused,
            parts.clearing,
            parts.operating_mode,
            parts.wanted_mode,
            parts.zone_sets.revision,
            parts.zone_access.revision,
            parts.goal.own,
        )

    def _visible(self) -> tuple[object, ...]:
        """Give what a state is sent for when it changes (section 6.6, triggers)."""
        parts = self._parts
        pose, battery = parts.senses.pose, parts.senses.battery
        return (
            *self._lasting(),
            parts.errors.revision,
            parts.goal.moving,
            parts.senses.velocity.moves,
            self._travel.new_base_request,
            pose is not None and pose.localized,
            battery is not None and battery.charging,
            parts.senses.goals.external,
            parts.senses.safety,
            parts.senses.pause_button,
            parts.senses.session,
            parts.maps,
        )

    def _make_handlers(self) -> dict[type, Callable[[Any], object]]:
        return {
            Started: self._started,
            OrderReceived: lambda event: self._intake.take(event.order),
            InstantActionsReceived: lambda event: self._instants.take(event.message),
            ZoneSetReceived: lambda event: self._zone_keeping.take(event.message.zone_set),
            ResponsesReceived: lambda event: self._zones.answered(event.message, event.utc),
            MapsReport: self._maps_reported,
            MessageRefused: lambda event: self._parts.errors.show(event.error, event.until),
            ActionReport: self._action_reported,
            LoadSensed: self._load_sensed,
            PluginsReport: self._plugins_reported,
            JournalReport: self._journal_reported,
            LinkReport: self._link_reported,
            SubscriptionsReport: self._subscriptions_reported,
            OperatingModeSwitched: self._mode.switch,
            SafetyReport: self._safety_reported,
            PauseButton: self._pause_button,
            ErrorSwitched: self._error_switched,
            LocalTrigger: lambda event: self._trigger.pull(event.trigger_type),
            TimePassed: lambda _: None,
            Arrived: self._travel.arrived,
            DriveFailed: self._travel.failed,
            Halted: lambda _: self._travel.halted(),
            HaltFailed: self._halt_failed,
            VelocityReport: self._velocity_reported,
            NavigationReport: self._travel.navigation_changed,
            PlanReport: self._plan_reported,
            DriveProgress: self._progress_reported,
            BlockedReport: self._blocked_reported,
            NoRouteReport: self._no_route_reported,
            PoseReport: self._pose_reported,
            BatteryReport: self._battery_reported,
            PositionInitialized: self._position.answered,
            GoalTable: self._goals_reported,
            SessionReport: self._session_reported,
        }

    def _started(self, event: Started) -> None:
        """Go on with what was going on: nobody knows what the robot did meanwhile."""
        parts = self._parts
        parts.utc = (event.utc, parts.now) if event.utc else None
        parts.link.lost_since = parts.now
        self._position.interrupted()
        if parts.clearing or parts.paused or self._travel.leftover:
            self._travel.resume_halt()
        self._flow.take_up_again()
        self._flow.schedule()

    def _action_reported(self, event: ActionReport) -> None:
        if event.zone_set and (problem := self._zone_keeping.take(event.zone_set)):
            event = ActionReport(event.action_id, ActionStatus.FAILED, problem)
        self._flow.report(event)
        self._flow.schedule()

    def _load_sensed(self, event: LoadSensed) -> None:
        self._parts.loads = sensed(self._parts.loads, loaded=event.loaded)

    def _plugins_reported(self, event: PluginsReport) -> None:
        self._parts.plugin_problems = event.problems

    def _journal_reported(self, event: JournalReport) -> None:
        self._parts.journal_problem = event.problem

    def _maps_reported(self, event: MapsReport) -> None:
        self._parts.maps = event.maps

    def _subscriptions_reported(self, event: SubscriptionsReport) -> None:
        self._parts.refused_topics = event.refused

    def _link_reported(self, event: LinkReport) -> None:
        self._parts.link.lost_since = None if event.connected else self._parts.now

    def _safety_reported(self, event: SafetyReport) -> None:
        self._parts.senses.safety = event

    def _pause_button(self, event: PauseButton) -> None:
        self._parts.senses.pause_button = event.pressed

    def _error_switched(self, event: ErrorSwitched) -> None:
        if event.active:
            self._parts.errors.show(event.error, Until.TAKEN_BACK)
        else:
            self._parts.errors.take_back(event.error)

    def _pose_reported(self, event: PoseReport) -> None:
        """Take a pose; one that is no place at all is passed over."""
        if all(isfinite(each) for each in (event.pose.x, event.pose.y, event.pose.theta)):
            self._parts.senses.pose = event
            self._parts.senses.velocity = VelocityReport(event.vx, event.omega)
            self._journey.pose_changed()
            self._travel.pose_changed()

    def _velocity_reported(self, event: VelocityReport) -> None:
        self._parts.senses.velocity = event

    def _halt_failed(self, event: HaltFailed) -> None:
        """Fail what waits for the robot to stand; the order is cleared once it stands."""
        self._travel.halt_failed(event.description)
        for action_type in (CANCEL_ORDER, START_PAUSE):
            self._parts.end_instants(action_type, ActionStatus.FAILED, event.description)

    def _battery_reported(self, event: BatteryReport) -> None:
        """Take a battery report; one without a charge between 0 and 100 % is passed over."""
        if 0.0 <= event.state_of_charge <= FULL:
            self._parts.senses.battery = event

    def _session_reported(self, event: SessionReport) -> None:
        self._parts.senses.session = event

    def _progress_reported(self, event: DriveProgress) -> None:
        self._parts.senses.progress = event

    def _blocked_reported(self, event: BlockedReport) -> None:
        self._parts.senses.blocked = event if event.blocked else None

    def _plan_reported(self, event: PlanReport) -> None:
        self._parts.senses.plan = event

    def _no_route_reported(self, event: NoRouteReport) -> None:
        self._parts.senses.no_route = event.areas

    def _goals_reported(self, event: GoalTable) -> None:
        self._parts.senses.goals = event
        self._parts.goal.listed(event.own)
