"""Between the tracker and an honest action server, each drive has one end, whatever happens.

The server below follows Nav2's SimpleActionServer: a current goal, a pending one, a loop that checks cancel
requests of the pending goal first. Goals get lost, arrays are late and merged, cancel calls go unanswered,
other clients send and cancel goals, the server is restarted, the network breaks.
"""

from __future__ import annotations

from itertools import count

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveGoal,
    DriverEvent,
    GoalTable,
    Halted,
    HaltFailed,
    NavigationReport,
    Pose,
)
from nena_edge_agent.nav2.commands import CancelGoal, Command, PublishGoal, Report, RequestPose, StopMotion
from nena_edge_agent.nav2.goal_tracker import GoalTracker
from nena_edge_agent.nav2.goals import GoalEntry, GoalIdPrefix
from nena_edge_agent.nav2.settings import GoalSettings
from nena_shared.ros import GoalStatus
from support.examples import EXAMPLES

EXTERNAL = 0
"""Generation of goals that somebody else gives."""


class HonestServer:
    def __init__(self) -> None:
        self.statuses: dict[str, GoalStatus] = {}
        self.generations: dict[str, int] = {}
        self.current: str | None = None
        self.pending: str | None = None
        self.arrays: list[list[GoalEntry]] = []
        self._numbers = count(1)

    def accept(self, generation: int) -> None:
        goal_id = f"{next(self._numbers):032x}"
        self.generations[goal_id] = generation
        self._set(goal_id, GoalStatus.EXECUTING)
        if self.current is None:
            self.current = goal_id
            return
        if self.pending is not None:
            self._terminate(self.pending)
        self.pending = goal_id

    def loop(self) -> None:
        if self.current is None:
            return
        if self.statuses[self.pending or self.current] is GoalStatus.CANCELING:
            ending = [goal_id for goal_id in (self.current, self.pending) if goal_id is not None]
            self.current = self.pending = None
            for goal_id in ending:
                self._terminate(goal_id)
        elif self.pending is not None:
            self._terminate(self.current, preempted=True)
            self.current, self.pending = self.pending, None

    def finish(self, *, success: bool, together: bool = False) -> int | None:
        """End the current goal, ``together`` with a pending one; its generation where it succeeded."""
        if self.current is None:
            return None
        ended, waiting = self.current, self.pending
        status = GoalStatus.SUCCEEDED if success else GoalStatus.ABORTED
        self.current, self.pending = waiting, None
        self._set(ended, status)
        if waiting is not None and together:
            self.current = None
            self._set(waiting, status)
        return self.generations[ended] if success else None

    def cancel(self, goal_id: str) -> int:
        if goal_id not in self.statuses:
            return 2
        if self.statuses[goal_id] is not GoalStatus.EXECUTING:
            return 3
        self._set(goal_id, GoalStatus.CANCELING)
        return 0

    def cancel_all(self) -> None:
        for goal_id in self.running():
            self.cancel(goal_id)

    def restart(self) -> None:
        self.statuses.clear()
        self.arrays.clear()
        self.current = self.pending = None

    def running(self) -> list[str]:
        return [goal_id for goal_id, status in self.statuses.items() if not status.terminal]

    def _terminate(self, goal_id: str, *, preempted: bool = False) -> None:
        asked = self.statuses[goal_id] is GoalStatus.CANCELING and not preempted
        self._set(goal_id, GoalStatus.CANCELED if asked else GoalStatus.ABORTED)

    def _set(self, goal_id: str, status: GoalStatus) -> None:
        self.statuses[goal_id] = status
        self.show()

    def show(self) -> None:
        self.arrays.append([GoalEntry(known, state) for known, state in self.statuses.items()])


class TrackedRobot(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.tracker = GoalTracker(GoalSettings(), GoalIdPrefix("agent"))
        self.server = HonestServer()
        self.now = 0.0
        self.generation = 0
        self.wanted: int | None = None
        self.halting = False
        self.place = 0.0
        self.goals_to_lose = 0
        self.cancels_to_lose = 0
        self.gids = count(1)
        self.gid = "gid 0"

    @initialize()
    def appear(self) -> None:
        self._do(self.tracker.on_servers(frozenset({self.gid}), self.now))
        self._do(self.tracker.on_navigation(NavigationReport(available=True, reason=""), self.now))

    @rule()
    def go_to(self) -> None:
        self.generation += 1
        self.wanted = self.generation
        goal = DriveGoal(self.generation, Pose(10.0 * self.generation, 0.0, 0.0, "hall"), deviation_xy=0.5)
        self._do(self.tracker.go_to(goal, self.now))

    @rule()
    def halt(self) -> None:
        self.wanted, self.halting = None, True
        self._do(self.tracker.halt(self.now))

    @rule()
    def drop(self) -> None:
        self.wanted = None
        self._do(self.tracker.drop(self.now))

    @rule()
    def loop(self) -> None:
        self.server.loop()

    @rule(success=st.booleans(), at_place=st.booleans(), together=st.booleans())
    def finish(self, *, success: bool, at_place: bool, together: bool) -> None:
        reached = self.server.finish(success=success, together=together)
        if reached is not None:
            self.place = 10.0 * reached if at_place else -100.0

    @rule(number=st.integers(1, 4))
    def deliver(self, number: int) -> None:
        for _ in range(min(number, len(self.server.arrays))):
            self._do(self.tracker.on_statuses(self.server.arrays.pop(0), self.now))

    @rule()
    def merge_arrays(self) -> None:
        del self.server.arrays[:-1]

    @rule(steps=st.sampled_from([1, 10, 80]))
    def wait(self, steps: int) -> None:
        for _ in range(steps):
            self._deliver_all()
            self.now += 0.1
            self._do(self.tracker.tick(self.now))

    @rule(goals=st.integers(1, 5))
    def lose_goals(self, goals: int) -> None:
        self.goals_to_lose = goals

    @rule()
    def lose_a_cancel(self) -> None:
        self.cancels_to_lose = 1

    @precondition(lambda self: self._all_goals_accounted_for())
    @rule()
    def somebody_gives_a_goal(self) -> None:
        self.server.accept(EXTERNAL)
        self._deliver_all()

    @rule()
    def somebody_cancels_all(self) -> None:
        self.server.cancel_all()

    @rule()
    def restart_server(self) -> None:
        self.server.restart()
        self.gid = f"gid {next(self.gids)}"
        self._do(self.tracker.on_servers(frozenset({self.gid}), self.now))

    @precondition(lambda self: self._all_goals_accounted_for())
    @rule()
    def break_the_network(self) -> None:
        """Lose sight of the server, and find it again as it was."""
        self._do(self.tracker.on_servers(frozenset(), self.now))
        self._do(self.tracker.on_servers(frozenset({self.gid}), self.now))
        if self.server.statuses:
            self.server.show()

    @invariant()
    def quiet_tracker_wants_nothing(self) -> None:
        if not self.tracker.busy:
            assert not self.halting

    def teardown(self) -> None:
        """Let the server continue without faults: within a minute every request has its one end."""
        self.goals_to_lose = self.cancels_to_lose = 0
        for _ in range(600):
            self.server.loop()
            self._deliver_all()
            if self.wanted is not None and self.server.pending is None and not self.halting:
                self.finish(success=True, at_place=True, together=False)
            self.wait(1)
        assert self.wanted is None, "a drive without an end"
        assert not self.halting, "a halt without an answer"
        assert not [g for g in self.server.running() if self.server.generations[g] != EXTERNAL]

    def _all_goals_accounted_for(self) -> bool:
        """Whether no goal of ours is active to being listed; another's would be mistaken for it."""
        return self.tracker._registry._claims == 0 and not self.server.arrays

    def _deliver_all(self) -> None:
        while self.server.arrays:
            self._do(self.tracker.on_statuses(self.server.arrays.pop(0), self.now))

    def _do(self, commands: list[Command]) -> None:
        for command in commands:
            match command:
                case PublishGoal(goal):
                    self._give(goal)
                case CancelGoal(goal_id):
                    self._cancel(goal_id)
                case RequestPose():
                    self._do(self.tracker.on_pose(Pose(self.place, 0.0, 0.0, "hall"), self.now))
                case StopMotion():
                    self._do(self.tracker.on_stop_answer(self.now, answered=True))
                case Report(event):
                    self._check(event)

    def _give(self, goal: DriveGoal) -> None:
        assert goal.generation == self.wanted, "a goal that are not wanted any more is given"
        assert not self.halting, "a goal is given while another is stopped"
        if self.goals_to_lose:
            self.goals_to_lose -= 1
        else:
            self.server.accept(goal.generation)

    def _cancel(self, goal_id: str) -> None:
        assert self.server.generations[goal_id] != EXTERNAL, "somebody else's goal is cancelled"
        code = None if self.cancels_to_lose else self.server.cancel(goal_id)
        self.cancels_to_lose = 0
        self._do(self.tracker.on_cancel_answer(goal_id, code, self.now))

    def _check(self, event: DriverEvent) -> None:
        match event:
            case Arrived(generation) | DriveFailed(generation=generation):
                assert generation == self.wanted, "an end for a goal that is not wanted, or a second end"
                self.wanted = None
                if isinstance(event, Arrived):
                    assert self.place == 10.0 * generation, "arrived elsewhere"
            case Halted():
                assert self.halting, "an answer to no halt"
                self.halting = False
                ours = [g for g in self.server.running() if self.server.generations[g] != EXTERNAL]
                assert not ours, "halted while a goal of ours runs"
            case HaltFailed():
                assert self.halting, "an answer to no halt"
            case GoalTable(goals):
                for goal in goals:
                    assert goal.external == (self.server.generations[goal.goal_id] == EXTERNAL)
            case _:
                raise AssertionError(event)


TestTrackedRobot = TrackedRobot.TestCase
TestTrackedRobot.settings = settings(max_examples=EXAMPLES // 4, stateful_step_count=40, deadline=None)
