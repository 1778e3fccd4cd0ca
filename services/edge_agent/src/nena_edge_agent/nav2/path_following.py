"""Paths that Nav2's controller follows directly, without planner and behaviour tree.

A goal with a path is sent to the controller's action, any other to the navigator. Each has its own tracker;
one drives at a time, and the other starts once the earlier goals have ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from nena_edge_agent.driver.port import (
    DriveFailed,
    DriveFailure,
    DriveGoal,
    GoalTable,
    Halted,
    NavigationReport,
    OwnGoals,
    Pose,
)
from nena_edge_agent.nav2.action_tracker import ActionSide, ActionTracker
from nena_edge_agent.nav2.commands import CancelGoal, Command, OnPath, Report, RequestResult, SendGoal
from nena_edge_agent.nav2.goal_tracker import GoalDrive
from nena_edge_agent.nav2.goals import FeedbackReading, GoalEntry, GoalIdPrefix
from nena_edge_agent.nav2.settings import GoalSettings, RosSettings
from nena_shared.clock import Clock
from nena_shared.log import get_logger

if TYPE_CHECKING:
    from nena_edge_agent.nav2.path_client import PathClient

log = get_logger(__name__)


EARLIER = "earlier"
"""Represents a path of an earlier run: its goal ID is not journalled, but has the agent's prefix."""


class PathTracker(ActionTracker):
    """Sends paths to the controller's action and tracks them."""

    server = "controller_server"

    def __init__(self, settings: GoalSettings, prefix: GoalIdPrefix) -> None:
        super().__init__(settings, prefix)
        self.by_action = True

    def expect_earlier(self) -> None:
        """Assume a path of an earlier run until the controller's status array shows whether there is one."""
        self._registry.reclaim((EARLIER,))

    def may_drive_earlier(self, now: float) -> bool:
        """Return whether the controller may follow a path, also one of an earlier run."""
        registry = self._registry
        return bool(registry.live) or (registry.orphaned and not registry.settled(now))

    def _refusal(self, drive: GoalDrive) -> str:
        return (
            f"Nav2's controller has not accepted the path, sent {drive.times_sent} times: "
            "is controller_server active?"
        )


class Trackers:
    """The trackers of the navigator and of the controller, with one interface."""

    def __init__(self, settings: GoalSettings, prefix: GoalIdPrefix) -> None:
        self.controller = PathTracker(settings, prefix)
        self.navigator = ActionTracker(settings, prefix, halts_after=self.controller)
        self.controller_takes_paths = False
        """Whether the controller's action is available; set by the driver."""
        self._current: ActionTracker = self.navigator
        self._next: DriveGoal | None = None

    @property
    def busy(self) -> bool:
        """Return whether something is awaited, so that :meth:`tick` is needed."""
        return self._next is not None or self.navigator.busy or self.controller.busy

    @property
    def driving(self) -> bool:
        """Return whether Nav2 drives to the current goal."""
        return self._current.driving

    @property
    def active(self) -> bool:
        """Return whether a goal of ours has not ended at the driving server."""
        return self._current.active

    @property
    def live(self) -> tuple[str, ...]:
        """Return our goals that have not ended at the driving server."""
        return self._current.live

    @property
    def goal_id(self) -> str | None:
        """Return the goal that Nav2 drives to for us, once it has accepted it."""
        return self._current.goal_id

    @property
    def wanted(self) -> DriveGoal | None:
        """Return the active or waiting goal."""
        return self._next or self._current.wanted

    @property
    def may_drive(self) -> bool:
        """Return whether Nav2 drives for us, or may still accept a sent goal."""
        return self.navigator.may_drive or self.controller.may_drive

    @property
    def by_action(self) -> bool:
        """Return whether goals are sent to the navigator by its action."""
        return self.navigator.by_action

    def wants(self, place: tuple[float, float]) -> bool:
        """Return whether a plan that ends at ``place`` (m) is for the goal that the navigator drives to."""
        return self.navigator.wants(place)

    def reclaim(self, goals: OwnGoals, *, paths: bool = False) -> None:
        """Treat the goals of an earlier run as ours; a path of that run is ended and resent.

        ``paths``: the earlier run may have followed one.
        """
        self.navigator.reclaim(goals)
        if paths:
            self.controller.expect_earlier()

    def go_to(self, goal: DriveGoal, now: float) -> list[Command]:
        """Drive to ``goal``; a current goal at the same server is replaced without a stop."""
        wanted = self.controller if goal.path else self.navigator
        if wanted is self._current:
            self._next = None
            return self._of(wanted, wanted.go_to(goal, now))
        self._next = goal
        return [*self._of(self._current, self._current.drop(now)), *self._begin_next(now)]

    def drop(self, now: float) -> list[Command]:
        """Cancel the current goal, without an answer."""
        self._next = None
        return self._of(self._current, self._current.drop(now))

    def halt(self, now: float) -> list[Command]:
        """Drop the goal and stop; answered by ``Halted`` or ``HaltFailed``."""
        self._next = None
        commands: list[Command] = []
        if self._current is self.navigator and self.controller.may_drive_earlier(now):
            commands += self.controller.halt(now)
        return [*self._of(self.controller, commands), *self._of(self._current, self._current.halt(now))]

    def on_statuses(self, entries: Sequence[GoalEntry], now: float) -> list[Command]:
        """Handle the navigator's status array."""
        return [*self.navigator.on_statuses(entries, now), *self._begin_next(now)]

    def on_servers(
        self, navigators: frozenset[str], controllers: frozenset[str], now: float
    ) -> list[Command]:
        """Handle the endpoint IDs of the publishers of the status arrays."""
        return [
            *self.navigator.on_servers(navigators, now),
            *self._of(self.controller, self.controller.on_servers(controllers, now)),
        ]

    def on_planner_gone(self, now: float) -> list[Command]:
        """Stop the navigator's drive; a path of our own needs no planner."""
        return self.navigator.on_planner_gone(now)

    def on_navigation(self, report: NavigationReport, now: float) -> list[Command]:
        """Record whether goals can be sent; the controller follows its path even without a navigator."""
        own = report
        if not self.controller_takes_paths:
            own = NavigationReport(available=False, reason="no controller takes paths")
        elif self.controller.may_drive:
            own = NavigationReport(available=True, reason="")
        return [
            *self.navigator.on_navigation(report, now),
            *self._of(self.controller, self.controller.on_navigation(own, now)),
        ]

    def on_cancel_answer(self, goal_id: str, code: int | None, now: float) -> list[Command]:
        """Handle the code of the navigator's answer to a cancel call; None: no answer."""
        return self.navigator.on_cancel_answer(goal_id, code, now)

    def on_stop_answer(self, now: float, *, answered: bool) -> list[Command]:
        """Record whether the controller has answered that its goals are cancelled."""
        return self._both(lambda tracker: tracker.on_stop_answer(now, answered=answered), now)

    def on_silence(self, seconds: float, now: float) -> list[Command]:
        """Record that the server which drives for us has sent no feedback for ``seconds``."""
        return self._of(self._current, self._current.on_silence(seconds, now))

    def on_feedback(self) -> None:
        """Record that the server which drives for us works."""
        self._current.on_feedback()

    def on_pose(self, pose: Pose, now: float) -> list[Command]:
        """Handle a pose of the localisation."""
        return self._both(lambda tracker: tracker.on_pose(pose, now), now)

    def forget_pose(self) -> None:
        """Discard the robot's pose: the localisation has lost it."""
        self.navigator.forget_pose()
        self.controller.forget_pose()

    def on_velocity(self, speed: float, omega: float, now: float) -> None:
        """Handle a velocity of the odometry, m/s and rad/s."""
        self.navigator.on_velocity(speed, omega, now)
        self.controller.on_velocity(speed, omega, now)

    def tick(self, now: float) -> list[Command]:
        """Advance the time."""
        return self._both(lambda tracker: tracker.tick(now), now)

    def of_controller(self, commands: Iterable[Command]) -> list[Command]:
        """Return the commands of the controller's tracker for the driver."""
        return self._of(self.controller, commands)

    def _both(self, call: Callable[[ActionTracker], list[Command]], now: float) -> list[Command]:
        commands = [*call(self.navigator), *self._of(self.controller, call(self.controller))]
        return [*commands, *self._begin_next(now)]

    def _begin_next(self, now: float) -> list[Command]:
        """Send the waiting goal once the previous ones have ended."""
        if self._next is None or self._current.may_drive or self._current.awaits_goal(now):
            return []
        goal, self._next = self._next, None
        self._current = self.controller if goal.path else self.navigator
        return self._of(self._current, self._current.go_to(goal, now))

    def _of(self, tracker: ActionTracker, commands: Iterable[Command]) -> list[Command]:
        """Return the commands of a tracker; those of the controller's are directed to its own action.

        Only the navigator's goals are reported: they show which other clients drive.
        """
        if tracker is self.navigator:
            return list(commands)
        found: list[Command] = []
        for command in commands:
            match command:
                case SendGoal() | RequestResult() | CancelGoal():
                    found.append(OnPath(command))
                case Report(GoalTable()):
                    pass
                case Report(Halted()) if self.navigator.halting:
                    pass  # the navigator's tracker answers for both
                case Report(DriveFailed(failure=DriveFailure.ABORTED) as event) if self.navigator.others_run:
                    text = "the path was replaced by another program's goal"
                    taken = replace(event, failure=DriveFailure.TAKEN_OVER, description=text)
                    found.append(Report(taken))
                case _:
                    found.append(command)
        return found


class PathSide(ActionSide):
    """Executes the tracker's commands on the controller's action, and passes the responses to the tracker."""

    def __init__(
        self,
        trackers: Trackers,
        *,
        apply: Callable[[Iterable[Command]], None],
        on_feedback: Callable[[FeedbackReading], None],
        clock: Clock,
    ) -> None:
        super().__init__(
            trackers.controller,
            apply=lambda commands: apply(trackers.of_controller(commands)),
            on_feedback=on_feedback,
            clock=clock,
        )
        self._trackers = trackers
        self._path_client: PathClient | None = None

    def new_path_client(self, settings: RosSettings) -> PathClient:
        """Return the client, which extends a new node."""
        from nena_edge_agent.nav2.path_client import PathClient  # noqa: PLC0415 - loads rclpy

        self._client = self._path_client = PathClient(
            settings,
            on_result=self._on_result,
            on_feedback=self._take_feedback,
            on_statuses=self._on_statuses,
        )
        return self._path_client

    def servers(self) -> frozenset[str]:
        """Check whether the controller is available; return the endpoint IDs of its status publishers."""
        client = self._path_client
        self._trackers.controller_takes_paths = client is not None and client.ready
        return client.servers() if client is not None else frozenset()

    async def do(self, command: SendGoal | RequestResult | CancelGoal) -> None:
        """Execute a command of the tracker."""
        match command:
            case SendGoal(goal, goal_id):
                await self._send_path(goal, goal_id)
            case RequestResult(goal_id):
                self.request_result(goal_id)
            case CancelGoal(goal_id):
                log.info("path cancelled", goal=goal_id)
                code = await self._path_client.cancel(goal_id) if self._path_client else None
                self._apply(self._tracker.on_cancel_answer(goal_id, code, self._clock.monotonic()))

    async def _send_path(self, goal: DriveGoal, goal_id: str) -> None:
        log.info("path sent", generation=goal.generation, goal=goal_id, poses=len(goal.path))
        accepted = await self._path_client.send_path(goal_id, goal.path) if self._path_client else None
        self._apply(self._tracker.on_goal_answer(goal_id, self._clock.monotonic(), accepted=accepted))

    def _on_statuses(self, entries: list[GoalEntry]) -> None:
        self._apply(self._tracker.on_statuses(entries, self._clock.monotonic()))
