"""The drives of one robot: to goals by Nav2's navigator, and along paths of our own by its controller.

A path needs neither planner nor behaviour tree, so it is sent to the controller's action. Each server has its
own tracker; one drives at a time, and the other starts once the earlier goals have ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

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
from nena_edge_agent.nav2.commands import Command, Report, Server
from nena_edge_agent.nav2.goal_tracker import GoalTracker
from nena_edge_agent.nav2.goals import GoalIdPrefix
from nena_edge_agent.nav2.settings import GoalSettings


class Trackers:
    """The trackers of the navigator and of the controller; ``current`` is that of the last goal.

    Whatever concerns both, or decides which of them drives, is a method here.
    """

    def __init__(self, settings: GoalSettings, prefix: GoalIdPrefix) -> None:
        self.controller = GoalTracker(settings, prefix, Server.CONTROLLER)
        self.controller.by_action = True
        self.navigator = GoalTracker(settings, prefix, halts_after=self.controller)
        self.controller_takes_paths = False
        """Whether the controller's action is available; set by the driver."""
        self.current = self.navigator
        self._next: DriveGoal | None = None

    def update(
        self, server: Server, change: Callable[[GoalTracker], list[Command]], now: float
    ) -> list[Command]:
        """Tell the tracker of one server what its server has sent, and begin a waiting goal."""
        tracker = self.controller if server is Server.CONTROLLER else self.navigator
        return [*self._as_reported(tracker, change(tracker)), *self._begin_next(now)]

    @property
    def busy(self) -> bool:
        """Return whether something is awaited, so that :meth:`tick` is needed."""
        return self._next is not None or self.navigator.busy or self.controller.busy

    @property
    def wanted(self) -> DriveGoal | None:
        """Return the active or waiting goal."""
        return self._next or self.current.wanted

    @property
    def may_drive(self) -> bool:
        """Return whether Nav2 drives for us, or may still accept a sent goal."""
        return self.navigator.may_drive or self.controller.may_drive

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
        if wanted is self.current:
            self._next = None
            return self._as_reported(wanted, wanted.go_to(goal, now))
        self._next = goal
        return [*self._as_reported(self.current, self.current.drop(now)), *self._begin_next(now)]

    def drop(self, now: float) -> list[Command]:
        """Cancel the current goal, without an answer."""
        self._next = None
        return self._as_reported(self.current, self.current.drop(now))

    def halt(self, now: float) -> list[Command]:
        """Drop the goal and stop; answered by ``Halted`` or ``HaltFailed``."""
        self._next = None
        commands: list[Command] = []
        # Another run of the program may have left a path to the controller.
        if self.current is self.navigator and self.controller.may_drive_earlier(now):
            commands += self.controller.halt(now)
        return [
            *self._as_reported(self.controller, commands),
            *self._as_reported(self.current, self.current.halt(now)),
        ]

    def on_servers(
        self, navigators: frozenset[str], controllers: frozenset[str], now: float
    ) -> list[Command]:
        """Handle the endpoint IDs of the publishers of the status arrays."""
        return [
            *self.navigator.on_servers(navigators, now),
            *self._as_reported(self.controller, self.controller.on_servers(controllers, now)),
        ]

    def on_navigation(self, report: NavigationReport, now: float) -> list[Command]:
        """Record whether goals can be sent; the controller follows its path even without a navigator."""
        own = report
        if not self.controller_takes_paths:
            own = NavigationReport(available=False, reason="no controller takes paths")
        elif self.controller.may_drive:
            # The path goes on although bt_navigator is gone: the controller needs nothing of it.
            own = NavigationReport(available=True, reason="")
        return [
            *self.navigator.on_navigation(report, now),
            *self._as_reported(self.controller, self.controller.on_navigation(own, now)),
        ]

    def on_stop_answer(self, now: float, *, answered: bool) -> list[Command]:
        """Record whether the controller has answered that its goals are cancelled."""
        return self._tell_both(lambda tracker: tracker.on_stop_answer(now, answered=answered), now)

    def on_silence(self, seconds: float, now: float) -> list[Command]:
        """Record that the server which drives for us has sent no feedback for ``seconds``."""
        return self._as_reported(self.current, self.current.on_silence(seconds, now))

    def on_pose(self, pose: Pose, now: float) -> list[Command]:
        """Handle a pose of the localisation."""
        return self._tell_both(lambda tracker: tracker.on_pose(pose, now), now)

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
        return self._tell_both(lambda tracker: tracker.tick(now), now)

    def _tell_both(self, call: Callable[[GoalTracker], list[Command]], now: float) -> list[Command]:
        commands = [*call(self.navigator), *self._as_reported(self.controller, call(self.controller))]
        return [*commands, *self._begin_next(now)]

    def _begin_next(self, now: float) -> list[Command]:
        """Send the waiting goal once the previous ones have ended."""
        if self._next is None or self.current.may_drive or self.current.awaits_goal(now):
            return []
        # controller_server drives one path at a time: a navigator's goal would take it over, or be aborted
        # by it.
        goal, self._next = self._next, None
        self.current = self.controller if goal.path else self.navigator
        return self._as_reported(self.current, self.current.go_to(goal, now))

    def _as_reported(self, tracker: GoalTracker, commands: Iterable[Command]) -> list[Command]:
        """Return the commands of a tracker, with what its reports mean for the robot.

        Only the navigator's goals are reported: they show which other clients drive.
        """
        if tracker is self.navigator:
            return list(commands)
        reported: list[Command] = []
        for command in commands:
            match command:
                case Report(GoalTable()):
                    pass
                case Report(Halted()) if self.navigator.halting:
                    pass  # the navigator's tracker answers for both
                case Report(DriveFailed(failure=DriveFailure.ABORTED) as event) if self.navigator.others_run:
                    text = "the path was replaced by another program's goal"
                    taken = replace(event, failure=DriveFailure.TAKEN_OVER, description=text)
                    reported.append(Report(taken))
                case _:
                    reported.append(command)
        return reported
