"""The driver for Nav2; of ROS, it only needs rclpy and the common interfaces.

Everything here runs in the event loop; pure cores (goal tracker, initial position, presence) decide what to
do, and the node sends and receives.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Sequence
from contextlib import AsyncExitStack, suppress
from dataclasses import replace
from functools import partial
from math import inf
from typing import TYPE_CHECKING

from nena_edge_agent.driver.plant_frame import NO_TRANSFORMS, PlantFrame
from nena_edge_agent.driver.port import (
    Area,
    BlockedReport,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    DriverEvent,
    Emit,
    Halted,
    KeepOutReport,
    NavigationReport,
    OwnGoals,
    PlanReport,
    Pose,
    PoseReport,
    PositionInitialized,
    SessionError,
    SessionReport,
    SessionState,
)
from nena_edge_agent.nav2 import presence
from nena_edge_agent.nav2.commands import (
    CancelGoal,
    Command,
    PublishGoal,
    Report,
    RequestPose,
    RequestResult,
    SendGoal,
    Server,
    StopMotion,
)
from nena_edge_agent.nav2.feedback import GIVEN_UP_AFTER, FeedbackFilter, SilenceWatch
from nena_edge_agent.nav2.goal_tracker import STALE_XY, GoalTracker
from nena_edge_agent.nav2.goals import FeedbackReading, GoalEntry, GoalIdPrefix, GoalResult
from nena_edge_agent.nav2.keep_out import KeepOutMask
from nena_edge_agent.nav2.localisation import (
    InitialPosition,
    Localisation,
    LocaliserWatch,
    PoseWatch,
    PublishInitialPose,
    Repetition,
)
from nena_edge_agent.nav2.map_server import MakeMapServer, no_map_server
from nena_edge_agent.nav2.offers import COLLISION_MONITOR, interface, nav2_offers
from nena_edge_agent.nav2.poses import PoseReading, pose_problem, thinned
from nena_edge_agent.nav2.robot_base import (
    Battery,
    BatteryReading,
    CollisionMonitor,
    MovementWatch,
    without_noise,
)
from nena_edge_agent.nav2.session_control import (
    NodeExtension,
    SessionManager,
    prepare_environment,
)
from nena_edge_agent.nav2.settings import Navigation, RosAddress, RosSettings
from nena_edge_agent.nav2.speed_limit import SpeedLimiter
from nena_edge_agent.nav2.trackers import Trackers
from nena_edge_agent.nav2.transforms import TransformWatch
from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.tasks import StartError, Supervisor, forever, set_within

if TYPE_CHECKING:
    from nena_edge_agent.nav2.node import Nav2Node
    from nena_edge_agent.nav2.parameters import ParameterReader

TICK = 0.05
"""Interval between checks of timeouts while something is awaited, seconds."""
FEEDBACK_TIMEOUT = GIVEN_UP_AFTER
"""Seconds without feedback of a drive after which bt_navigator counts as dead also without odometry."""
HELD_UP = 0.3
"""Tolerated delay of the event loop, seconds; beyond it, unread feedback and poses may be waiting."""
GLANCE = 0.2
"""Interval between checks that the driving server is still in the ROS graph, seconds."""
READINGS = 5
"""Maximum number of attempts to read Nav2's parameters while one of them is unknown."""


def _unless_prevented(problem: str, report: NavigationReport) -> NavigationReport:
    """Return ``report``, with ``problem`` as the reason if navigation is otherwise available."""
    return NavigationReport(available=False, reason=problem) if problem and report.available else report


class Nav2Driver:
    """One robot with Nav2, within in the frame of its map; goals and events are in the plant's frame.

    Events are emitted by the event loop, never during a method call.
    """

    def __init__(
        self,
        settings: RosSettings,
        map_id: str,
        emit: Emit,
        clock: Clock,
        *,
        frame: PlantFrame = NO_TRANSFORMS,
        extensions: Sequence[NodeExtension] = (),
        limiter: SpeedLimiter | None = None,
        make_map_server: MakeMapServer = no_map_server,
    ) -> None:
        self._settings = settings
        self._frame = frame
        self._extensions, self._limiter = extensions, limiter
        self._map_server = map_server = make_map_server(self)
        self._too_fast = ""
        self._areas: tuple[Area, ...] = ()
        self._keep_out = KeepOutMask(settings) if nav2_offers(settings).keeps_out else None
        self._kept_out: KeepOutReport | None = None
        self._map_id = map_server.map_id if map_server is not None else map_id
        self._unplaced = map_server is not None and map_server.unplaced
        self._emit, self._clock, self._log = emit, clock, get_logger(__name__)
        self.session = SessionManager(
            RosAddress.of(settings),
            begin=self._open_node,
            end=self._close_node,
            on_change=self._on_session,
            clock=clock,
            retry=settings.session_retry,
        )
        self._tracker = Trackers(settings.goals, GoalIdPrefix(settings.node_name))
        self._follows_paths = nav2_offers(settings).follows_paths
        self._silence, self._planner = SilenceWatch(), presence.PlannerWatch()
        self._feedback = FeedbackFilter()
        self._initial_position = InitialPosition(settings.localisation)
        self._battery, self._readings = Battery(settings.battery_scale), READINGS
        self._looking_since, self._blocked = -inf, False
        self._forget_position()
        self._navigation: NavigationReport | None = None
        self._node: Nav2Node | None = None
        self._transforms = TransformWatch(settings, self._on_pose)
        self._parameters: ParameterReader | None = None
        self._collision: CollisionMonitor | None = None
        self._tasks, self._stack = Supervisor(), AsyncExitStack()
        self._ticking: asyncio.TimerHandle | None = None
        self._listening: asyncio.TimerHandle | None = None
        self._halted, self._stopped = asyncio.Event(), False

    async def start(self) -> None:
        """Join the ROS graph, if the settings say so, and start to search for Nav2; it may appear later.

        Raises:
            StartError: rclpy is missing, or another package that the settings require.
        """
        self._loop = asyncio.get_running_loop()
        prepare_environment()
        try:
            # rclpy reads the environment now; in a thread, because meanwhile the agent connects to the broker
            await asyncio.to_thread(__import__, "nena_edge_agent.nav2.node")
        except ImportError as error:
            raise StartError(
                f"ROS 2 for Python cannot be loaded ({error}): source the robot's ROS installation before "
                "the start, or install nena-edge-agent[ros]"
            ) from error
        from nena_edge_agent.nav2.action_client import action_type  # noqa: PLC0415 - loads rclpy

        if self._settings.by_action_only and action_type(self._settings.navigation) is None:
            raise StartError(
                "nav2_msgs cannot be loaded: source the robot's ROS installation with Nav2 before the start, "
                "or set ros.navigation = topics"
            )
        self._transforms.check()
        if self._settings.start_session:
            with suppress(SessionError):  # reported, and retried
                await self.session.start()
        else:
            self.session.report_stopped()
        await self._stack.enter_async_context(self._tasks)
        self._tasks.start("watch Nav2", forever("watch Nav2", self._watch_nav2), vital=False)
        self._tasks.start("watch the drive", forever("watch the drive", self._check_servers), vital=False)

    async def stop(self) -> None:
        """Stop the robot if it still drives for us, then leave the ROS graph; no more events follow."""
        # The core has ended: what the robot does from here on only concerns its standstill.
        self._emit = lambda _event: None
        if self._node is not None:
            await self._stop_robot()
        self._stopped = True
        for timer in (self._ticking, self._listening):
            if timer is not None:
                timer.cancel()
        await self._stack.aclose()
        await self.session.stop()

    def reclaim(self, goals: OwnGoals) -> None:
        """Continue with a goal of an earlier run, if Nav2 still drives to it."""
        if self._limiter is not None:
            self._limiter.reclaim()
        self._tracker.reclaim(self._frame.own_goals_to_map(goals), paths=self._follows_paths)

    def go_to(self, goal: DriveGoal) -> None:
        """Drive to ``goal``; a current goal is replaced without a stop."""
        goal, now = self._frame.goal_to_map(goal), self._clock.monotonic()
        problem = pose_problem(goal.pose, self._map_id)
        if self._limiter is not None:
            if reason := self._limiter.problem(goal.maximum_speed):
                self._execute_all(self._tracker.drop(now))
                if goal.generation < 0:  # a plug-in's drive, which is not resent
                    self._report_event(DriveFailed(goal.generation, DriveFailure.NOT_TAKEN_UP, reason))
                    return
                self._too_fast = reason
                self._report_navigation(NavigationReport(available=False, reason=reason))
                return
            # Before the goal: the limit must be there when the robot starts (VDA 5050, edge.maximumSpeed).
            self._limiter.limit_goal(goal.maximum_speed)
        if goal.behavior_tree and not self._tracker.navigator.by_action:
            needed = self._settings.action
            problem = f"the behaviour tree '{goal.behavior_tree}' needs {needed}, which is not available"
        if problem is None:
            self._execute_all(self._tracker.go_to(goal, now))
            if len(goal.path) > 1:
                places = tuple((pose.x, pose.y) for pose in goal.path)
                self._report_event(PlanReport(thinned(places), self._map_id))
        else:
            self._execute_all(self._tracker.drop(now))
            self._report_event(DriveFailed(goal.generation, DriveFailure.NOT_TAKEN_UP, problem))

    def halt(self) -> None:
        """Cancel the current goal; ``Halted`` follows at standstill."""
        self._too_fast = ""
        self._halted.clear()
        self._execute_all(self._tracker.halt(self._clock.monotonic()))

    def limit_speed(self, speed: float | None) -> None:
        """Limit the speed of Nav2's controller, m/s; called only if it accepts a limit."""
        if self._limiter is not None:
            self._limiter.limit_place(speed)

    def keep_out(self, areas: tuple[Area, ...]) -> None:
        """Make Nav2 plan around areas; called only if it accepts a mask."""
        self._areas = tuple(map(self._frame.area_to_map, areas))
        if not areas:
            self._kept_out = None
        self._show_areas()

    def _show_areas(self) -> None:
        if self._keep_out is not None:
            shown = self._keep_out.show(self._areas, self._map_id)
            self._tasks.start("draw the keep-out mask", shown, vital=False)

    def initialize_position(self, pose: Pose) -> None:
        """Set the robot's pose in the localisation.

        Answered by ``PositionInitialized``; a newer call replaces an older one, and one event answers both.
        """
        pose = self._frame.to_map(pose)
        problem = pose_problem(pose, self._map_id)
        if problem is not None:
            self._report_event(PositionInitialized(succeeded=False, description=problem))
            return
        self._execute_all(self._initial_position.start(pose, self._clock.monotonic()))

    @property
    def drives(self) -> bool:
        """Return whether a goal of ours is active, or may be."""
        return self._tracker.may_drive

    def await_map(self, reason: str) -> None:
        """Send no goal until Nav2 has the map being loaded; :meth:`_watch_nav2` detects it."""
        report = NavigationReport(available=False, reason=reason)
        self._execute_all(self._tracker.on_navigation(report, self._clock.monotonic()))
        self._report_navigation(report)

    def use_map(self, map_id: str) -> None:
        """Use another map: an initial position must set the robot's pose on it.

        A waiting goal is dropped: it is on the previous map. The core resends the order's goal once
        navigation is available.
        """
        waiting = self._tracker.wanted
        if waiting is not None:
            self._execute_all(self._tracker.drop(self._clock.monotonic()))
            if waiting.generation < 0:  # a plug-in's drive, which is not resent
                text = f"the map '{map_id}' was enabled before the drive began"
                self._report_event(DriveFailed(waiting.generation, DriveFailure.NOT_TAKEN_UP, text))
        report = self._localisation.report()
        self._map_id, self._unplaced = map_id, True
        self._forget_position()
        self._show_areas()
        self._report_unplaced(report)

    def _report_unplaced(self, report: PoseReport | None) -> None:
        if report is not None:
            problem = f"the map '{self._map_id}' was enabled, but the position on it is not set"
            pose = replace(report.pose, map_id=self._map_id)
            lost = PoseReport(pose, localized=False, vx=report.vx, omega=report.omega, problem=problem)
            self._report_event(lost)

    async def _open_node(self, address: RosAddress) -> None:
        from nena_edge_agent.nav2.action_client import ActionHandlers  # noqa: PLC0415 - needs rclpy
        from nena_edge_agent.nav2.node import Nav2Node  # noqa: PLC0415 - needs rclpy
        from nena_edge_agent.nav2.parameters import ParameterReader  # noqa: PLC0415 - needs rclpy

        self._settings = address.applied(self._settings)
        self._parameters = ParameterReader(self._settings)
        parts = (self._transforms, self._parameters, self._limiter, self._map_server, self._keep_out)
        own: list[NodeExtension] = [part for part in parts if part is not None]
        if interface(COLLISION_MONITOR) is not None:
            self._collision = CollisionMonitor(self._settings.names.collision_monitor, self._report_event)
            own.append(self._collision)
        actions = {
            Server.NAVIGATOR: ActionHandlers(
                partial(self._on_statuses, Server.NAVIGATOR),
                partial(self._on_result, Server.NAVIGATOR),
                self._on_feedback,
            )
        }
        if self._follows_paths:
            actions[Server.CONTROLLER] = ActionHandlers(
                partial(self._on_statuses, Server.CONTROLLER),
                partial(self._on_result, Server.CONTROLLER),
                self._on_path_feedback,
            )
        node = Nav2Node(
            self._settings,
            (*self._extensions, *own),
            actions=actions,
            on_other_statuses=self._on_other_statuses,
            on_pose=self._on_published_pose,
            on_velocity=self._on_velocity,
            on_battery=self._on_battery,
            on_plan=self._on_plan,
        )
        await node.start(self._on_failure)
        # What is known of the previous node's servers does not hold at another address.
        self._silence = SilenceWatch()  # this one's robot may have no odometry
        self._planner = presence.PlannerWatch()
        self._node, self._looking_since = node, self._clock.monotonic()
        if self._tracker.busy:  # it may have to stop a goal of an earlier run
            node.prepare_stop()

    async def _close_node(self) -> None:
        """Leave the graph after the robot has stopped."""
        if (self._tracker.busy or self._tracker.current.driving) and not self._stopped:
            await self._stop_robot()
        node, self._node = self._node, None
        if node is not None:
            await node.stop()

    def _lose_position(self, problem: str, *, moves: bool = False) -> None:
        """Report that the robot's position is unknown; ``moves``: the odometry still shows its velocity."""
        previous, report = self._localisation, self._localisation.report_lost(problem, moves=moves)
        self._forget_position()
        self._tracker.forget_pose()
        if moves:
            self._localisation.keep_velocity(previous)
        if report is not None:
            self._log.warning("the robot's position is no longer known", reason=problem)
            self._report_event(report)
        elif not moves:
            self._report_event(self._localisation.velocity)

    def _forget_position(self) -> None:
        """Discard the robot's position: it may be another robot, or may have been moved."""
        settings = self._settings
        self._localisation = Localisation(settings, self._map_id)
        self._localiser_watch, self._repetition = LocaliserWatch(), Repetition()
        self._movement = MovementWatch(settings.goals.blocked_after)
        self._pose_watch = PoseWatch(
            timeout=settings.localisation.pose_timeout, wait=settings.goals.pose_wait
        )

    def _watch_localiser(self, seen: presence.Presence) -> None:
        """Forget the pose of a localisation that has gone or was restarted, and request a new one."""
        watch, inactive = self._localiser_watch, seen.localiser is presence.Lifecycle.INACTIVE
        problem = watch.find_problem(seen.localisers, inactive=inactive)
        if problem is not None:
            self._lose_position(problem, moves=True)
            self._localiser_watch = watch
            self._execute_all([RequestPose()])

    async def _stop_robot(self) -> None:
        self.halt()
        if not await set_within(self._halted, self._settings.stop_timeout):
            self._log.warning(
                "the robot may still drive: Nav2 did not stop it in time", seconds=self._settings.stop_timeout
            )

    async def _watch_nav2(self) -> None:
        """Check Nav2 once, after restarting a failed session."""
        await self.session.retry_failed()
        async with self.session.step:
            if self._node is not None:
                lost = bool(self._transforms.problem)
                self._transforms.choose_source()
                if self._transforms.problem:
                    self._tracker.forget_pose()
                if lost or self._transforms.problem:
                    self._report_pose()
                # The bond of Nav2's lifecycle manager takes 4 s; a planner is missed only at the next
                # replanning.
                self._check_planner(self._node)
                if (seen := await self._node.presence()) is not None:
                    await self._report_presence(seen)
        await asyncio.sleep(self._settings.watch_period)

    async def _report_presence(self, seen: presence.Presence) -> None:
        """Report what the ROS graph shows of Nav2."""
        # In this order: what is missing, then what the next goal or the map still lacks, then the limits.
        seen = replace(seen, action=self._check_action(), planner_gone=self._planner.gone)
        report = presence.judge_navigation(
            seen,
            self._settings,
            pose_known=self._localisation.known,
            seconds=self._clock.monotonic() - self._looking_since,
        )
        # A goal with a path waits for a controller that accepts paths, one with a limit for one that obeys.
        wanted = self._tracker.wanted
        if wanted is not None and wanted.path and not self._tracker.controller_takes_paths:
            action = self._settings.names.follow_path
            problem = f"no node serves the action {action}: is controller_server running?"
            report = _unless_prevented(problem, report)
        if self._limiter is not None:
            self._limiter.check_controllers()
            if self._limiter.listened:
                self._too_fast = ""
            report = _unless_prevented(self._too_fast, report)
        report = self._with_map(report)
        await self._read_limits(report)
        self._on_navigation(seen.servers, self._while_map_stays(report))
        self._watch_localiser(seen)
        kept_out = (
            self._keep_out.check_use(self._clock.monotonic()) if self._keep_out and self._areas else None
        )
        if kept_out is not None and kept_out != self._kept_out:
            self._kept_out = kept_out
            self._log.info("keep-out mask is used" if not kept_out.problem else "keep-out mask is not used")
            self._report_event(kept_out)
        self._watch_drive()
        if self._collision is not None:
            self._collision.report_silent()

    def _check_action(self) -> bool:
        """Check whether a server accepts goals by the action; if so, the next goal is sent to it."""
        ready = self._node is not None and self._node.clients[Server.NAVIGATOR].is_ready
        by_action = ready and self._settings.navigation is not Navigation.TOPICS
        self._tracker.navigator.by_action = by_action
        return by_action

    async def _check_servers(self) -> None:
        """Check the driving servers more often than the rest of Nav2, to stop soon after a crash."""
        await asyncio.sleep(GLANCE)
        if self._node is not None and self._tracker.current.active:
            self._update_servers(self._node.clients[Server.NAVIGATOR].server_ids())
            self._check_planner(self._node)

    def _check_planner(self, node: Nav2Node) -> None:
        if self._planner.has_just_gone(node.planners()):
            self._execute_all(self._tracker.navigator.on_planner_gone(self._clock.monotonic()))

    def _with_map(self, report: NavigationReport) -> NavigationReport:
        """Wait for Nav2 to load the enabled map."""
        # A map_server that was restarted has the map of its own settings.
        if self._map_server is not None and self._map_server.needs_load():
            self._tasks.start("load the map", self._map_server.load_again(), vital=False)
        return self._while_map_stays(report)

    def _while_map_stays(self, report: NavigationReport) -> NavigationReport:
        """Return an up-to-date report: another map may have been enabled since the report."""
        return _unless_prevented(self._map_server.problem if self._map_server is not None else "", report)

    async def _read_limits(self, report: NavigationReport) -> None:
        """Read Nav2's goal tolerance and limits each time that it becomes available.

        A server that is starting or busy may not report all of them yet; they are read again later.
        """
        # Nav2 may have been restarted with other parameters while it was unavailable.
        was_available = self._navigation is not None and self._navigation.available
        if not was_available:
            self._readings = READINGS
        if not report.available or self._readings == 0 or self._parameters is None:
            return
        parameters = await self._parameters.read()
        complete = parameters.complete and parameters.speed is not None
        self._readings = 0 if complete else self._readings - 1
        if self._limiter is not None and parameters.speed is not None:
            self._limiter.controller_drives(parameters.speed)
        # with topics, and on a path of our own, the robot's position is rarely updated
        known_each = 0.0 if self._check_action() and not self._follows_paths else STALE_XY
        self._report_event(parameters.limits(self._settings.goals.goal_tolerance, known_each, self._map_id))

    def _on_navigation(self, servers: frozenset[str], report: NavigationReport) -> None:
        self._update_servers(servers)
        self._execute_all(self._tracker.on_navigation(report, self._clock.monotonic()))
        if report.available:
            self._looking_since = -inf
        self._report_navigation(report)

    def _update_servers(self, servers: frozenset[str]) -> None:
        controllers: frozenset[str] = frozenset()
        if self._node is not None and (controller := self._node.clients.get(Server.CONTROLLER)):
            self._tracker.controller_takes_paths = controller.is_ready
            controllers = controller.server_ids()
        self._execute_all(self._tracker.on_servers(servers, controllers, self._clock.monotonic()))

    def _report_navigation(self, report: NavigationReport) -> None:
        if report != self._navigation:
            self._navigation = report
            self._log.info("navigation", available=report.available, reason=report.reason)
            self._report_event(report)

    def _watch_drive(self) -> None:
        """Check whether the robot makes progress, and whether poses still arrive."""
        now, driving = self._clock.monotonic(), self._tracker.current.driving
        if self._localisation.forget_stale_velocity(now):
            self._report_event(self._localisation.velocity)
        blocked = self._movement.blocked(driving=driving, now=now)
        if blocked != self._blocked:
            self._blocked = blocked
            self._log.info("movement", blocked=blocked)
            self._report_event(BlockedReport(blocked, self._settings.goals.blocked_after))
        report, lost = self._localisation.report(), self._pose_watch.lost
        unsure = report is not None and not report.localized
        if self._pose_watch.wants_pose(driving=driving, unsure=unsure, now=now):
            self._execute_all([RequestPose()])
        if self._pose_watch.lost:
            self._tracker.forget_pose()  # also one from feedback: goals wait for the localisation
            if not lost:
                self._report_pose()

    def _on_failure(self, reason: str) -> None:
        self._node = None
        self.session.failed(reason)

    def _on_session(self, report: SessionReport) -> None:
        """Report the session; without one Nav2 is unavailable, and with a new one it is searched for."""
        self._report_event(report)
        if report.state in (SessionState.NOT_ACTIVE, SessionState.FAILED):
            self._lose_position("its ROS session is not active")
            text = f"its ROS session is {report.state}"
            reason = f"{text}: {report.reason}" if report.reason else text
            self._on_navigation(frozenset(), NavigationReport(available=False, reason=reason))

    def _on_statuses(self, server: Server, entries: list[GoalEntry]) -> None:
        self._tell_tracker(server, lambda tracker, now: tracker.on_statuses(entries, now))

    def _on_other_statuses(self, entries: list[GoalEntry]) -> None:
        """Handle the statuses of the action that only other clients use."""
        self._tell_tracker(Server.NAVIGATOR, lambda tracker, now: tracker.on_other_statuses(entries, now))

    def _on_result(self, server: Server, result: GoalResult) -> None:
        self._tell_tracker(server, lambda tracker, now: tracker.on_result(result, now))

    def _tell_tracker(self, server: Server, change: Callable[[GoalTracker, float], list[Command]]) -> None:
        """Tell the tracker of a server what the server has sent."""
        now = self._clock.monotonic()
        self._execute_all(self._tracker.update(server, lambda tracker: change(tracker, now), now))

    def _on_published_pose(self, reading: PoseReading) -> None:
        self._localiser_watch.on_pose()
        self._on_pose(reading)

    def _on_pose(self, reading: PoseReading) -> None:
        now = self._clock.monotonic()
        old = self._tracker.current.driving and self._feedback.is_fresh(now)
        pose = self._localisation.on_reading(reading, old=old)
        if pose is None:
            return
        confirmed = self._initial_position.on_pose(pose)
        if self._unplaced and not confirmed:
            report = self._localisation.report()
            self._forget_position()  # a position on the previous map
            self._report_unplaced(report)
            return
        if self._unplaced and self._map_server is not None:
            self._map_server.record_placed()
        self._unplaced = False
        self._movement.on_pose(pose, now)
        self._pose_watch.on_pose(now)
        self._report_pose()
        self._execute_all(self._tracker.on_pose(pose, now))
        self._execute_all(confirmed)

    def _on_feedback(self, reading: FeedbackReading) -> None:
        """Handle feedback: position, more often than the localisation, and remaining distance."""
        self._tracker.navigator.on_places(reading.goal_id, reading.places_left)
        now = self._clock.monotonic()
        if not self._is_of_goal(reading, now):
            return
        if self._feedback.has_moved(reading, now):
            pose = self._localisation.on_nearer(reading.x, reading.y, reading.yaw, reading.frame)
            if pose is not None:
                self._movement.on_pose(pose, now)
                self._report_pose()
                self._execute_all(self._tracker.on_pose(pose, now))
        self._movement.on_recoveries(reading.recoveries)
        self._report_progress(reading, now)

    def _on_path_feedback(self, reading: FeedbackReading) -> None:
        """Handle feedback on a path of our own: remaining distance."""
        self._tracker.controller.on_places(reading.goal_id, reading.places_left)
        now = self._clock.monotonic()
        if self._is_of_goal(reading, now):
            self._report_progress(reading, now)

    def _report_progress(self, reading: FeedbackReading, now: float) -> None:
        if progress := self._feedback.progress(reading, self._map_id, now):
            self._report_event(progress)

    def _is_of_goal(self, reading: FeedbackReading, now: float) -> bool:
        """Return whether feedback is of the current goal; any of our goals counts as a sign of life."""
        tracker = self._tracker.current
        if reading.goal_id in tracker.live:
            self._silence.on_feedback(reading.goal_id, now)
            tracker.on_feedback()
            if self._listening is None and not self._silence.by_odometry:
                self._await_feedback(FEEDBACK_TIMEOUT)
        if reading.goal_id != tracker.goal_id:
            return False
        if self._limiter is not None:
            self._limiter.repeat_while_driving(now)
        return True

    def _await_feedback(self, seconds: float) -> None:
        """Check after ``seconds`` whether feedback still arrives."""
        due = self._loop.time() + seconds
        self._listening = self._loop.call_at(due, self._check_feedback, due)

    def _check_feedback(self, due: float) -> None:
        """Stop a robot without odometry if the navigator is silent; if the loop was delayed, wait again."""
        self._listening = None
        now = self._clock.monotonic()
        if self._silence.by_odometry or self._stopped:
            return
        silent = self._silence.silent_for(now, self._tracker.current.live)
        if self._loop.time() - due > HELD_UP:
            self._await_feedback(HELD_UP)
        elif silent >= FEEDBACK_TIMEOUT:
            self._execute_all(self._tracker.on_silence(silent, now))
        elif silent > 0.0:
            self._await_feedback(FEEDBACK_TIMEOUT - silent)

    def _on_velocity(self, measured: tuple[float, float]) -> None:
        now = self._clock.monotonic()
        velocity = without_noise(measured, self._settings.goals.standstill_noise)
        for watcher in (self._tracker, self._movement, self._pose_watch):
            watcher.on_velocity(*velocity, now)
        if silent := self._silence.on_velocity(now, self._tracker.current.live):
            self._execute_all(self._tracker.on_silence(silent, now))
        if self._localisation.on_velocity(velocity, now):
            self._report_event(self._localisation.velocity)
            self._report_pose()

    def _on_battery(self, reading: BatteryReading) -> None:
        report = self._battery.report(reading)
        if report is not None:
            self._report_event(report)

    def _on_plan(self, plan: tuple[str, tuple[tuple[float, float], ...]]) -> None:
        """Report a plan for our own drive; its end distinguishes it from plans of other clients."""
        frame, points = plan
        # planner_server publishes the plans of all clients, also of the docking server and operators' tools.
        ours = frame.removeprefix("/") == self._settings.frame
        if ours and len(points) > 1 and self._tracker.navigator.is_own_plan(points[-1]):
            self._report_event(PlanReport(points, self._map_id))

    def _report_pose(self) -> None:
        report = self._localisation.report()
        if report is not None and self._transforms.problem:
            report = replace(report, localized=False, problem=self._transforms.problem)
        elif report is not None and self._pose_watch.lost:
            seconds = self._settings.localisation.pose_timeout
            problem = f"the localisation has sent no pose for more than {seconds:g} s of driving"
            report = replace(report, localized=False, problem=problem)
        awaited = self._tracker.busy or self._tracker.current.driving or self._initial_position.busy
        if report and (not self._repetition.repeats(report, self._clock.monotonic()) or awaited):
            self._report_event(report)

    def _execute_all(self, commands: Iterable[Command | PublishInitialPose]) -> None:
        for command in commands:
            self._execute_command(command)
        busy = self._tracker.busy or self._initial_position.busy
        if busy and self._ticking is None and not self._stopped:
            due = self._loop.time() + TICK
            self._ticking = self._loop.call_at(due, self._check_timeouts, due)

    def _execute_command(self, command: Command | PublishInitialPose) -> None:
        if isinstance(command, Report):
            self._report_event(command.event)
            return
        node = self._node
        if node is None:
            return
        match command:
            case PublishGoal(goal):
                # bt_navigator subscribes best effort (Fast DDS, Jazzy): the goal may be lost, and is resent.
                node.publish_goal(goal.pose)
                self._log.info("goal published", generation=goal.generation, x=goal.pose.x, y=goal.pose.y)
                self._loop.call_soon(node.prepare_stop)
            case SendGoal():
                self._tasks.start("send a goal", self._send_goal(node, command), vital=False)
                self._loop.call_soon(node.prepare_stop)
            case RequestResult(goal_id, server):
                node.clients[server].request_result(goal_id)
            case PublishInitialPose(pose):
                node.publish_initial_pose(pose)
            case CancelGoal():
                self._tasks.start("cancel a goal", self._cancel_goal(node, command), vital=False)
            case StopMotion():
                self._log.warning("cancelled the goals of controller, behaviours and docking")
                self._tasks.start("stop the robot", self._stop_motion(node), vital=False)
            case RequestPose():
                self._tasks.start("ask for a pose", self._request_pose(node), vital=False)

    async def _send_goal(self, node: Nav2Node, command: SendGoal) -> None:
        goal, goal_id, server = command.goal, command.goal_id, command.server
        if goal.path:
            self._log.info("path sent", generation=goal.generation, goal=goal_id, poses=len(goal.path))
        else:
            self._log.info(
                "goal sent", generation=goal.generation, goal=goal_id, x=goal.pose.x, y=goal.pose.y
            )
        accepted = await node.clients[server].send_goal(goal, goal_id)
        self._tell_tracker(
            server, lambda tracker, now: tracker.on_goal_answer(goal_id, now, accepted=accepted)
        )

    async def _request_pose(self, node: Nav2Node) -> None:
        if await node.request_pose():
            self._pose_watch.on_answer(self._clock.monotonic())

    async def _stop_motion(self, node: Nav2Node) -> None:
        answered = await node.stop_motion()
        self._execute_all(self._tracker.on_stop_answer(self._clock.monotonic(), answered=answered))

    async def _cancel_goal(self, node: Nav2Node, command: CancelGoal) -> None:
        path = command.server is Server.CONTROLLER
        self._log.info("path cancelled" if path else "goal cancelled", goal=command.goal_id)
        code = await node.clients[command.server].cancel_goal(command.goal_id)
        self._tell_tracker(
            command.server, lambda tracker, now: tracker.on_cancel_answer(command.goal_id, code, now)
        )

    def _check_timeouts(self, due: float) -> None:
        """Check the timeouts; if the loop was delayed during a drive, first read what has arrived."""
        self._ticking = None
        # Status arrays and poses that arrived meanwhile are not read yet: a timeout would be premature.
        if self._tracker.wanted is not None and self._loop.time() - due > HELD_UP:
            self._ticking = self._loop.call_later(HELD_UP, self._check_timeouts, inf)
            return
        now = self._clock.monotonic()
        self._execute_all([*self._initial_position.tick(now), *self._tracker.tick(now)])

    def _report_event(self, event: DriverEvent) -> None:
        if isinstance(event, Halted):
            self._halted.set()
        if self._limiter is not None:
            self._limiter.on_event(event)
        self._loop.call_soon(self._emit, self._frame.event_to_plant(event))
