"""One robot's agent: one task that connects the MQTT link, protocol core, driver, actions and journal."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ParamSpec

from structlog.contextvars import bind_contextvars

from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.run import ActionRunner
from nena_edge_agent.driver.port import (
    DriveFailed,
    DriveFailure,
    Driver,
    Pose,
)
from nena_edge_agent.extension import Extension, Robot
from nena_edge_agent.factsheet import make_capabilities
from nena_edge_agent.journal import Journal, Recorder, check_frame, read_journal
from nena_edge_agent.messages import COMMANDS, OF_ZONES, InboxCounts, RobotMessages, client_id_of
from nena_edge_agent.nav2.offers import NO_OFFERS, Nav2Offers
from nena_edge_agent.power import WAKE_UP_VARIABLE, run_command
from nena_edge_agent.protocol import events
from nena_edge_agent.protocol.conditions import journal_lost
from nena_edge_agent.protocol.errors import error_key
from nena_edge_agent.protocol.robot import RobotCore
from nena_edge_agent.protocol.robot_state import PowerPhase
from nena_edge_agent.protocol.state import with_recorded_fields
from nena_edge_agent.queues import Mailbox, Postponed, StateSchedule, VisualizationSchedule
from nena_edge_agent.settings import EdgeAgentSettings
from nena_edge_agent.statistics import AgentStatistics
from nena_shared.clock import Clock, iso
from nena_shared.histogram import Histogram
from nena_shared.log import get_logger
from nena_shared.mqtt import BrokerLink, Inbound, LinkHooks, MqttLink, Outbound
from nena_shared.mqtt.link import LinkState
from nena_shared.tasks import StartError, Supervisor, report_failure
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import codec_for

log = get_logger(__name__)
P = ParamSpec("P")

DISCONNECT_TIMEOUT = 2.0
"""Timeout for the last messages to reach the broker, seconds."""
COMMANDS_WAITING = 2
"""Maximum waiting power commands: the wake command waits for the end of the hibernate command."""
TIMEOUT_INTERVAL = 1.0
"""Seconds between two checks of running timeouts."""
MAXIMUM_BATCH_DELAY = 0.2
"""Maximum time that a due state waits for the handling of queued events, seconds."""
DRIVER_EFFECTS = (events.Drive, events.Halt, events.LimitSpeed, events.KeepOut, events.SetPosition)
"""Effects that need not wait for the disk, because a power failure would also end them."""

DriverMaker = Callable[[Callable[[events.Event], None], Pose | None], Driver]
"""Creates a driver, given the receiver of its events and the robot's last known pose."""


@dataclass(frozen=True, slots=True)
class AgentSnapshot:
    """Current values of a robot's agent, for its metrics."""

    link: LinkState
    inbox: InboxCounts
    dropped: int
    """Messages of fleet control dropped because too many arrived at once."""
    statistics: AgentStatistics
    journal_problem: str
    journal_seconds: Histogram
    errors: tuple[ErrorEntry, ...]


class RobotAgent:
    """One robot. Only its own task changes its state; all other tasks put events into its mailbox.

    The rule is *durable before visible*. A change is written to the journal before the driver gets a command,
    so that it survives the process. It is synchronised to disk before any other effect, including the state
    that reports it.
    """

    _logged_ends: frozenset[str] = frozenset()
    """Actions of the current order whose end has been logged."""
    _greeting = False
    """Whether the first state of a connection is still to be published."""
    _shuts_down = False
    """Whether fleet control shuts the robot down."""

    def __init__(
        self,
        settings: EdgeAgentSettings,
        robot: Robot,
        make_driver: DriverMaker,
        registry: ActionRegistry,
        *,
        clock: Clock,
        offers: Nav2Offers = NO_OFFERS,
        extensions: Sequence[Extension] = (),
        make_link: Callable[..., BrokerLink] = MqttLink,
        make_journal: Callable[..., Journal] = Journal,
        codec: Codec | None = None,
    ) -> None:
        """Prepare the agent; ``codec``: instead of the one of its version."""
        self._settings = settings
        self._clock = clock
        self._robot, self.robot = robot, robot.key
        self._extensions = extensions
        self._log = log.bind(robot=str(self.robot))
        self._registry = registry
        self._capabilities = make_capabilities(settings, registry, offers)
        journal = None
        if settings.journal.enabled:
            journal = make_journal(settings.journal.folder, self.robot, on_record=self._observe_record)
        memory, self._journal_loss = read_journal(journal)
        check_frame(memory, self._capabilities.frame)
        self._core = RobotCore(self._capabilities, memory)
        self._messages = RobotMessages(
            settings,
            self.robot,
            self._capabilities,
            codec=codec or codec_for(settings.version),
            clock=clock,
            reserved=self._core.header_ids,
        )
        self._mailbox, self._statistics = Mailbox(), AgentStatistics()
        self._recorder = Recorder(
            None if self._journal_loss else journal,
            self._core.durable_version,
            on_record=self._on_journal_record,
            wake=self._mailbox.wake,
        )
        self._drives, self._others = Postponed(), Postponed()
        self._inbox = self._messages.make_inbox(self._mailbox.put, clock, lambda: self._core.robot.map_ids)
        self._driver = make_driver(self._mailbox.put, self._core.last_position)
        # Nav2 may still drive to a goal of an earlier run, which the driver must know to continue or end it.
        if own_goals := self._core.own_goals:
            self._driver.reclaim(own_goals)
        self._runner = ActionRunner(registry, self._mailbox.put, settings.actions.timeouts)
        self._states = StateSchedule(
            minimum=settings.interval.state_minimum, maximum=settings.interval.state_maximum
        )
        self._visualizations = VisualizationSchedule(
            interval=settings.interval.visualization, now=clock.monotonic()
        )
        self._commands: asyncio.Queue[events.Hibernate | events.Wake] = asyncio.Queue(COMMANDS_WAITING)
        self._ending = asyncio.Event()
        self._logged_errors: tuple[ErrorEntry, ...] = ()
        self._shown = self._core.state(self._messages.headers.form(0))
        self._link = self._make_connection(make_link)

    async def run(self, stop: asyncio.Event) -> None:
        """Run until ``stop`` is set or fleet control shuts the robot down, then disconnect in order.

        Raises:
            StartError: the driver cannot work here, or the shutdown command failed.
            TaskFailedError: a task of the robot failed.
        """
        bind_contextvars(robot=str(self.robot))  # for the logs of all called code
        for extension in self._extensions:
            self._isolate_errors(self._start_extension, extension)
        if self._journal_loss:
            self._log.error("no orders are accepted: the journal is lost", reason=self._journal_loss)
            self._mailbox.put(events.ErrorSwitched(journal_lost(self._journal_loss), active=True))
        if self._registry.problems:
            self._mailbox.put(events.PluginsReport(self._registry.problems))
        self._mailbox.put(events.Started(self._clock.now()))  # before the driver's events
        await self._write_record()  # the headerIds of the first messages: none is used twice (7.2)
        await self._recorder.sync()
        try:
            async with Supervisor() as supervisor:
                supervisor.start(f"link {self.robot}", self._link.run())
                try:
                    await self._driver.start()  # meanwhile the link connects; messages wait in the mailbox
                    supervisor.start(f"robot {self.robot}", self._serve_events())
                    ending = stop
                    if self._settings.power_actions:
                        # A robot that fleet control shuts down must not stop the others of the program.
                        ending = self._ending
                        supervisor.start(f"power {self.robot}", self._run_power_commands())
                        supervisor.start(f"stop {self.robot}", self._end_with(stop), vital=False)
                    await supervisor.wait(ending)
                except Exception:
                    # OFFLINE would tell fleet control that the robot has left in order (6.5).
                    await self._publish_disconnection(ConnectionState.CONNECTION_BROKEN)
                    raise
                # Before the DISCONNECT, with which the broker discards the will (MQTT 3.1.1, 3.14.4).
                await self._publish_disconnection(ConnectionState.OFFLINE)
        finally:
            self._runner.close()
            for extension in self._extensions:
                self._isolate_errors(extension.on_end, self._robot)
            await self._driver.stop()
        if self._shuts_down:  # only now: the robot is offline, and its driver has ended
            self._log.info("shutting down")
            if problem := await run_command(self._settings.power, events.PowerCommand.SHUT_DOWN):
                raise StartError(
                    f"the robot could not be shut down: {problem}; check power.shutdown_command"
                )  # which starts the robot again

    def snapshot(self) -> AgentSnapshot:
        """Return the current values for metrics."""
        return AgentSnapshot(
            self._link.state,
            self._inbox.counts,
            self._mailbox.dropped,
            self._statistics,
            self._journal_loss or self._core.robot.journal_problem,
            self._recorder.seconds,
            self._core.robot.errors.entries,
        )

    async def _serve_events(self) -> None:
        while True:
            await self._mailbox.wait(self._next_due_time() - self._clock.monotonic())
            effects = self._handle_events(self._mailbox.take_all())
            await self._write_record()
            # Durable before visible: drives wait until the record survives the process, all else until it
            # is on disk.
            to_driver = (effect for effect in effects if isinstance(effect, DRIVER_EFFECTS))
            written = self._recorder.has_written(self._core.durable_version)
            self._perform_all(self._drives.select_ready(to_driver, recorded=written))
            await self._recorder.sync()
            others = (effect for effect in effects if not isinstance(effect, DRIVER_EFFECTS))
            self._perform_all(self._others.select_ready(others, recorded=self._is_recorded))
            self._isolate_errors(self._publish_due_messages)

    async def _end_with(self, stop: asyncio.Event) -> None:
        await stop.wait()
        self._ending.set()

    async def _run_power_commands(self) -> None:
        """Run the commands that hibernate and wake the robot, one after the other."""
        settings = self._settings.power
        while True:
            effect = await self._commands.get()
            kind, environment = events.PowerCommand.WAKE, {}
            if isinstance(effect, events.Hibernate):
                kind = events.PowerCommand.HIBERNATE
                if effect.wake_up_at:
                    environment = {WAKE_UP_VARIABLE: iso(effect.wake_up_at)}
                await self._link.drain(DISCONNECT_TIMEOUT)  # the command may slow down the network
            self._mailbox.put(events.PowerReport(kind, await run_command(settings, kind, environment)))

    def _handle_events(self, received: list[events.Event]) -> list[events.Effect]:
        now = self._clock.monotonic()
        if self._core.power is not PowerPhase.AWAKE:
            # With the time of day: the monotonic clock stops during a suspend.
            received.append(events.TimePassed(self._clock.now()))
        elif not received and self._core.waits:
            received = [events.TimePassed()]
        effects: list[events.Effect] = []
        for event in received:
            self._statistics.count_event(event, now)
            try:
                followed = self._core.handle(event, now)
            except Exception as error:  # noqa: BLE001 - it is reported
                # One event that the core cannot handle must not stop the robot in the middle of a hall.
                kind = type(event).__name__
                report_failure("event not handled", error, robot=str(self.robot), event_type=kind)
                continue
            effects.extend(followed)
            for extension in self._extensions:
                self._isolate_errors(extension.on_event, self._robot, event, followed, self._core.robot)
        self._log_new_errors()
        return effects

    def _log_new_errors(self) -> None:
        """Log each new error in the state; an error whose text changes is logged once."""
        shown = self._core.robot.errors.entries
        if shown is self._logged_errors:
            return
        logged = {error_key(error) for error in self._logged_errors}
        self._logged_errors = shown
        for entry in shown:
            if error_key(entry) not in logged:
                self._log.warning(
                    "error reported",
                    error_type=entry.error_type,
                    level=entry.error_level.value,
                    description=entry.error_description,
                )

    @property
    def _is_recorded(self) -> bool:
        """Return whether everything that must survive a power failure is on disk."""
        return self._recorder.has_synced(self._core.durable_version)

    async def _write_record(self) -> None:
        self._core.header_ids = self._messages.headers.reserve()
        await self._recorder.write(self._core.durable_version, self._core.memory)

    def _on_journal_record(self, problem: str) -> None:
        """Report it when the journal fails or works again."""
        if problem != self._core.robot.journal_problem:
            self._log.warning("journal", works=not problem, problem=problem)
            self._mailbox.put(events.JournalReport(problem))

    def _perform_all(self, effects: Iterable[events.Effect]) -> None:
        for effect in effects:
            self._isolate_errors(self._perform_effect, effect)

    def _perform_effect(self, effect: events.Effect) -> None:  # noqa: C901, PLR0912 - a case for each effect
        match effect:
            case events.ReportState():
                self._states.request(self._clock.monotonic())
            case events.Drive(goal):
                try:
                    self._driver.go_to(goal)
                except Exception as error:
                    # Without this report, the core would wait for the end of a drive that never began.
                    log.exception("the driver refused a goal", robot=str(self.robot), goal=goal.generation)
                    text = f"the driver failed: {error}"
                    self._mailbox.put(DriveFailed(goal.generation, DriveFailure.NOT_TAKEN_UP, text))
            case events.Halt():
                self._driver.halt()
            case events.LimitSpeed(speed):
                self._driver.limit_speed(speed)
            case events.KeepOut(areas):
                self._driver.keep_out(areas)
            case events.SetPosition(pose):
                self._driver.initialize_position(pose)
            case events.SendFactsheet():
                self._publish_message(self._messages.factsheet(self._core.robot.reports.limits))
            case events.StartAction():
                self._runner.start(effect)
            case events.PauseAction():
                self._runner.pause(effect)
            case events.ResumeAction():
                self._runner.resume(effect)
            case events.CancelAction():
                self._runner.cancel(effect)
            case events.Hibernate(wake_up_at):
                self._log.info("hibernating", wake_up_at=wake_up_at and iso(wake_up_at))
                self._publish_message(self._messages.connection(ConnectionState.HIBERNATING))
                self._commands.put_nowait(effect)
            case events.Wake():
                self._commands.put_nowait(effect)
            case events.GoOnline():
                self._log.info("awake")
                self._publish_message(self._messages.connection(ConnectionState.ONLINE))
            case events.ShutDown():
                self._shuts_down = True
                self._ending.set()
            case events.LogIgnored(message):
                self._log.info("ignored while hibernating or shutting down", message=message)

    def _isolate_errors(self, step: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        """Run ``step``; if it fails, log that, and continue the robot's task."""
        try:
            step(*args, **kwargs)
        except Exception as error:  # noqa: BLE001 - it is reported
            report_failure("a step failed", error, robot=str(self.robot))

    def _next_due_time(self) -> float:
        """Return when the next message or check of a timeout is due, monotonic, s."""
        if self._core.power.silent:
            return self._clock.monotonic() + TIMEOUT_INTERVAL
        due = min(self._states.due, self._visualizations.due)
        waits = self._core.waits or not self._is_recorded
        return min(due, self._clock.monotonic() + TIMEOUT_INTERVAL) if waits else due

    def _publish_due_messages(self) -> None:
        now = self._clock.monotonic()
        if self._core.power.silent:
            self._greeting = False
            return
        # The next state would report the effects of the events that wait: send one instead of two. Not longer
        # than this, because a robot that is never idle must report as well (6.6.1).
        if not self._mailbox.is_empty and now - self._states.due < MAXIMUM_BATCH_DELAY:
            return
        if self._greeting or self._states.due <= now:
            self._publish_state()
            self._states.record_sent(now)
            ends = self._core.power is PowerPhase.SHUTTING_DOWN  # a restart is awake, so it needs no record
            # Only once fleet control can know why the robot is silent from now on.
            if self._link.state.connected and (ends or (self._core.power.signs_off and self._is_recorded)):
                self._mailbox.put(events.SignedOff())
        if self._visualizations.due <= now:
            if self._link.state.connected and self._core.robot.reports.pose is not None:
                headers = self._messages.headers
                # Since 3.0, a visualization names the state that it belongs to (referenceStateHeaderId, 7.9).
                header, state_id = headers.make(Topic.VISUALIZATION), headers.last_id(Topic.STATE)
                self._publish_message(
                    self._messages.visualization(self._core.visualization(header, state_id))
                )
            self._visualizations.record_sent(now)

    def _publish_state(self) -> None:
        """Publish the state; the first one on a connection is queued until the link sends it."""
        if not (self._greeting or self._link.state.connected):
            return
        state = self._core.state(self._messages.headers.make(Topic.STATE))
        # What is not on disk must not be visible: after a power failure, the robot would contradict it.
        if not self._is_recorded:
            ends = self._core.power is PowerPhase.SHUTTING_DOWN
            state = with_recorded_fields(state, self._shown, last=ends)
        self._publish_message(self._messages.state(state, keep=self._greeting))
        self._shown, self._greeting = state, False
        # A state repeats the end of an action until the next order: log it once.
        ended = {action.action_id: action for action in state.action_states if action.action_status.ended}
        for action_id in ended.keys() - self._logged_ends:
            self._log.info(
                "action ended",
                order=state.order_id,
                action=action_id,
                type=ended[action_id].action_type,
                status=ended[action_id].action_status.value,
            )
        self._logged_ends = frozenset(ended)

    def _make_connection(self, make_link: Callable[..., BrokerLink]) -> BrokerLink:
        link = make_link(
            self._settings.mqtt,
            client_id=client_id_of(self.robot, self._messages.topics, self._settings.mqtt),
            hooks=LinkHooks(
                # VDA 5050 3.0 (6.5) requires a will, and 2.x (6.14) allows one: each version gets it.
                will=lambda: self._messages.connection(ConnectionState.CONNECTION_BROKEN),
                on_connected=self._first_messages,
                on_subscribed=self._on_subscribed,
                on_lost=self._on_lost,
            ),
        )
        for topic in (*COMMANDS, *(OF_ZONES if self._capabilities.zones else ())):
            handler = partial(self._handle_message, topic)
            link.subscribe(self._messages.topic(topic), handler, qos=self._settings.qos)
        self._robot.link.use_link(link)
        return link

    def _handle_message(self, topic: Topic, message: Inbound) -> None:
        self._observe_message(message)
        self._inbox.take_message(topic, message)

    def _publish_message(self, message: Outbound) -> None:
        self._observe_message(message)
        self._link.publish(message)

    def _observe_message(self, message: Inbound | Outbound) -> None:
        for extension in self._extensions:
            self._isolate_errors(extension.on_message, self._robot, message)

    def _observe_record(self, record: bytes) -> None:
        for extension in self._extensions:
            self._isolate_errors(extension.on_record, self._robot, record)

    def _start_extension(self, extension: Extension) -> None:
        for event in extension.on_start(self._robot):
            self._mailbox.put(event)

    def _add_greetings(self, extension: Extension, greetings: list[Outbound]) -> None:
        greetings.extend(extension.on_connect(self._robot))

    def _first_messages(self) -> Iterator[Outbound]:
        """Yield the first messages of a connection; the robot's task publishes the state after them."""
        state = ConnectionState.HIBERNATING if self._core.power.silent else ConnectionState.ONLINE
        greetings = [
            self._messages.connection(state),
            # Also without a request, so that fleet control finds it retained before it asks (2.1: 6.15).
            self._messages.factsheet(self._core.robot.reports.limits),
        ]
        for message in greetings:
            self._observe_message(message)
        for extension in self._extensions:
            self._isolate_errors(self._add_greetings, extension, greetings)
        yield from greetings
        self._greeting = True
        self._mailbox.wake()

    def _on_lost(self) -> None:
        self._greeting = False  # a state of now would be outdated after the next connection
        self._mailbox.put(events.LinkReport(connected=False))

    def _on_subscribed(self) -> None:
        self._mailbox.put(events.SubscriptionsReport(self._link.state.refused))
        self._mailbox.put(events.LinkReport(connected=True))

    async def _publish_disconnection(self, state: ConnectionState) -> None:
        self._publish_message(self._messages.connection(state))
        if not await self._link.drain(DISCONNECT_TIMEOUT):
            self._log.warning("the connection ended before the last messages were sent")
