"""The recorded conversations of Nav2's action server, and what must hold in all others."""

from __future__ import annotations

import itertools
from uuid import UUID

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, invariant, multiple, rule

from nena_robot_simulator import goals
from nena_robot_simulator.goals import StatusArray
from nena_robot_simulator.motion import Pose
from nena_robot_simulator.navigator import PLAN_PARTS, Drive, DriveFailure, Goal, Navigator, Progress, Target
from nena_shared.ros import GoalStatus
from support.examples import EXAMPLES

HALTING = 0.03
A, B, C = UUID(int=1), UUID(int=2), UUID(int=3)
NAMES = {A: "A", B: "B", C: "C"}


class Bench:
    """A navigator, and a notebook of the arrays that it makes."""

    def __init__(self) -> None:
        self.now = 0.0
        self.goals = StatusArray(retention=900.0)
        self.navigator = Navigator(goals=self.goals, resolve=self.resolve, halting=lambda: HALTING)
        self.arrays: list[str] = []

    @staticmethod
    def resolve(pose: Pose, frame_id: str) -> Pose | None:
        return pose if frame_id == "map" else None

    def note(self) -> None:
        for snapshot in self.goals.take_unpublished():
            self.arrays.append(" ".join(f"{NAMES[entry.goal_id]}:{entry.status:d}" for entry in snapshot))

    def take(self, goal_id: UUID, frame: str = "map") -> bool:
        taken = self.navigator.take(Goal(goal_id, Pose(goal_id.int, 0, 0), frame), 0, self.now)
        self.note()
        return taken

    def cancel(self, goal_id: UUID = goals.ANY_GOAL) -> int:
        answer = goals.answer_cancel(self.goals.entries(self.now), goal_id, 0)
        if answer.goals:
            self.goals.cancel([goal.goal_id for goal in answer.goals], self.now)
        self.note()
        return int(answer.code)

    def rounds(self, count: int = 1, progress: Progress = Progress.UNDERWAY) -> None:
        for _ in range(count):
            self.now += 0.01
            self.navigator.tick(self.now, progress)
            self.note()

    def reach(self) -> None:
        self.rounds(progress=Progress.REACHED)

    def driving_for(self) -> UUID | None:
        target = self.navigator.target
        return None if target is None else target.goal_id


def driving(goal_id: UUID = A) -> Bench:
    bench = Bench()
    assert bench.take(goal_id)
    bench.rounds()
    assert bench.driving_for() == goal_id
    return bench


def test_a_second_goal_while_driving_takes_over_without_a_stop() -> None:
    bench = driving()
    bench.take(B)
    assert bench.driving_for() == A
    bench.rounds()
    assert bench.driving_for() == B
    bench.rounds(10)
    bench.reach()
    assert bench.arrays == ["A:2", "A:2 B:2", "A:6 B:2", "A:6 B:4"]


def test_a_third_goal_pushes_the_pending_one_out() -> None:
    bench = driving()
    bench.take(B)
    bench.take(C)
    bench.rounds()
    bench.reach()
    assert bench.arrays[2:] == [
        "A:2 B:2 C:2",
        "A:2 B:6 C:2",
        "A:6 B:6 C:2",
        "A:6 B:6 C:4",
    ]


def test_cancel_all_while_driving_and_the_robot_stops_before_the_goal_ends() -> None:
    bench = driving()
    assert bench.cancel() == 0
    assert bench.arrays == ["A:2", "A:3"]
    assert bench.driving_for() == A
    bench.rounds()
    assert bench.driving_for() is None
    assert bench.arrays == ["A:2", "A:3"]
    bench.rounds(3)
    assert bench.arrays == ["A:2", "A:3", "A:5"]
    assert not bench.navigator.busy


def test_a_goal_in_an_unknown_frame_is_aborted_in_the_first_round() -> None:
    bench = Bench()
    bench.take(A, "moon")
    bench.rounds()
    assert bench.arrays == ["A:2", "A:6"]
    assert not bench.navigator.busy


def test_cancel_and_a_new_goal_directly_after_kills_the_new_goal() -> None:
    bench = driving()
    bench.cancel(A)
    bench.rounds()
    bench.take(B)
    bench.rounds(4)
    assert bench.arrays == ["A:2", "A:3", "A:3 B:2", "A:5 B:2", "A:5 B:6"]
    assert not bench.navigator.busy


def test_cancel_and_a_new_goal_before_the_loop_looked_is_a_pre_emption() -> None:
    bench = driving()
    bench.cancel(A)
    bench.take(B)
    bench.rounds(5)
    assert bench.arrays == ["A:2", "A:3", "A:3 B:2", "A:6 B:2"]
    assert bench.driving_for() == B


def test_cancelling_the_pending_goal_ends_the_running_one_with_it() -> None:
    bench = driving()
    bench.take(B)
    bench.cancel(B)
    bench.rounds(5)
    assert bench.arrays[-2:] == ["A:6 B:3", "A:6 B:5"]
    assert not bench.navigator.busy


def test_deactivated_while_driving_aborts_and_swallows_what_comes() -> None:
    bench = driving()
    bench.navigator.set_active(active=False)
    assert not bench.take(B)
    bench.rounds(5)
    assert bench.arrays == ["A:2", "A:6"]
    bench.navigator.set_active(active=True)
    assert bench.take(C)
    assert bench.arrays[-1] == "A:6 C:2"


def test_an_unknown_frame_while_driving_makes_the_new_goal_end_at_the_old_place() -> None:
    bench = driving()
    bench.take(B, "moon")
    bench.rounds()
    target = bench.navigator.target
    assert target is not None
    assert (target.goal_id, target.pose.x) == (B, A.int)
    bench.reach()
    assert bench.arrays[-1] == "A:6 B:4"


@pytest.mark.parametrize(("progress", "status"), [(Progress.REACHED, 4), (Progress.FAILED, 6)])
def test_a_goal_that_comes_with_the_end_of_a_drive_gets_its_result(progress: Progress, status: int) -> None:
    bench = driving()
    bench.take(B)
    bench.rounds(progress=progress)
    assert bench.arrays[2:] == ["A:6 B:2", f"A:6 B:{status}"]
    assert not bench.navigator.busy


def test_a_goal_that_cannot_begin_makes_room_for_the_pending_one() -> None:
    bench = Bench()
    bench.take(A, "moon")
    bench.take(B)
    bench.rounds(2)
    assert bench.arrays == ["A:2", "A:2 B:2", "A:6 B:2"]
    assert bench.driving_for() == B


def test_a_cancel_that_comes_with_the_arrival_still_halts() -> None:
    bench = driving()
    bench.cancel(A)
    bench.reach()
    bench.rounds(5)
    assert bench.arrays == ["A:2", "A:3", "A:5"]


class AnyConversation(RuleBasedStateMachine):
    """Requests of all kinds in any order: each accepted goal ends exactly once, with a status that fits."""

    ids = Bundle("ids")

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0
        self.goals = StatusArray(retention=1e9)
        self.navigator = Navigator(goals=self.goals, resolve=Bench.resolve, halting=lambda: HALTING)
        self.accepted: list[UUID] = []
        self.asked_to_cancel: set[UUID] = set()
        self.ended: dict[UUID, GoalStatus] = {}

    @rule(target=ids, frame=st.sampled_from(["map", "map", "map", "moon"]))
    def take(self, frame: str) -> object:
        goal_id = UUID(int=len(self.accepted) + 1)
        active = self.navigator.active
        taken = self.navigator.take(Goal(goal_id, Pose(1, 1, 0), frame), len(self.accepted), self.now)
        assert taken is active
        if not taken:
            return multiple()
        self.accepted.append(goal_id)
        return goal_id

    @rule(goal_id=ids, stamp=st.integers(0, 3))
    def cancel_one(self, goal_id: UUID, stamp: int) -> None:
        self.request_cancel(goal_id, stamp)

    @rule(stamp=st.integers(0, 3))
    def cancel_many(self, stamp: int) -> None:
        self.request_cancel(goals.ANY_GOAL, stamp)

    def request_cancel(self, goal_id: UUID, stamp: int) -> None:
        answer = goals.answer_cancel(self.goals.entries(self.now), goal_id, stamp)
        self.asked_to_cancel.update(goal.goal_id for goal in answer.goals)
        if answer.goals:
            self.goals.cancel([goal.goal_id for goal in answer.goals], self.now)

    @rule(active=st.booleans())
    def set_active(self, active: bool) -> None:  # noqa: FBT001 - hypothesis fills it
        self.navigator.set_active(active=active)

    @rule(progress=st.sampled_from(Progress), seconds=st.sampled_from([0.01, 0.1]))
    def go_round(self, progress: Progress, seconds: float) -> None:
        self.now += seconds
        driving = self.navigator.target is not None
        self.navigator.tick(self.now, progress if driving else Progress.UNDERWAY)

    @invariant()
    def each_goal_ends_once_and_rightly(self) -> None:
        for snapshot in self.goals.take_unpublished():
            assert [entry.goal_id for entry in snapshot] == self.accepted[: len(snapshot)]
            assert sum(not entry.ended for entry in snapshot) <= 3
            for entry in snapshot:
                if entry.ended:
                    assert self.ended.setdefault(entry.goal_id, entry.status) is entry.status
                else:
                    assert entry.goal_id not in self.ended
                if entry.status is GoalStatus.CANCELED:
                    assert entry.goal_id in self.asked_to_cancel

    @invariant()
    def at_most_one_goal_runs_and_one_waits(self) -> None:
        running = [entry.goal_id for entry in self.goals.entries(self.now) if not entry.ended]
        assert len(running) <= 2
        assert self.navigator.busy is bool(running)
        if self.navigator.target is not None:
            assert self.navigator.target.goal_id == running[0]

    def teardown(self) -> None:
        self.navigator.set_active(active=False)
        for _ in range(20):
            self.now += 0.1
            self.navigator.tick(self.now, Progress.UNDERWAY)
        assert all(entry.ended for entry in self.goals.entries(self.now))
        assert len(self.goals.entries(self.now)) == len(self.accepted)


TestAnyConversation = AnyConversation.TestCase
TestAnyConversation.settings = settings(max_examples=EXAMPLES // 10, stateful_step_count=40, deadline=None)


GOAL = Pose(10.0, 0.0, 1.0)
TARGET = Target(UUID(int=1), GOAL)
START = Pose(0.0, 0.0, 0.0)


def progress_at(drive: Drive, pose: Pose) -> Progress:
    drive.move_to(pose)
    return drive.progress(pose, 0.0)


def test_the_end_of_the_way_counts_and_not_the_goal() -> None:
    drive = Drive(TARGET, START, Pose(9.5, 0.0, 1.0))
    assert progress_at(drive, Pose(9.3, 0.0, 1.0)) is Progress.REACHED


def test_without_a_way_the_drive_fails_and_has_no_plan() -> None:
    drive = Drive(TARGET, START, None)
    assert progress_at(drive, GOAL) is Progress.FAILED
    assert drive.plan(START) == []


def test_a_drive_is_given_up_after_a_part_of_the_way() -> None:
    drive = Drive(TARGET, START, GOAL, failure=DriveFailure(abort_after=0.25))
    assert progress_at(drive, Pose(2.4, 0.0, 0.0)) is Progress.UNDERWAY
    assert progress_at(drive, Pose(2.6, 0.0, 0.0)) is Progress.FAILED


def test_the_plan_leads_straight_from_the_robot_to_the_end() -> None:
    plan = Drive(TARGET, START, GOAL).plan(Pose(8.0, 0.0, 0.5))
    assert plan[0] == pytest.approx((8.0, 0.0, 0.0))
    assert plan[-1] == GOAL
    assert [a.distance(b) for a, b in itertools.pairwise(plan)] == pytest.approx([0.25] * 8)


@pytest.mark.parametrize("x", [1e7, 1e308])
def test_the_plan_of_a_robot_that_was_put_far_away_is_bounded(x: float) -> None:
    poses = Drive(TARGET, START, GOAL).plan(Pose(x, 0.0, 0.0))
    assert len(poses) == PLAN_PARTS + 1
    assert poses[-1] == GOAL


def test_places_on_the_way_are_passed_one_after_the_other() -> None:
    drive = Drive(Target(UUID(int=1), GOAL, (Pose(4.0, 0.0, 0.0), Pose(7.0, 0.0, 0.0))), START, GOAL)
    assert (drive.next_place, drive.behind, drive.places_left) == (Pose(4.0, 0.0, 0.0), 6.0, 3)
    assert progress_at(drive, Pose(3.5, 0.0, 0.0)) is Progress.UNDERWAY
    assert (drive.next_place, drive.behind, drive.places_left) == (Pose(7.0, 0.0, 0.0), 3.0, 2)
    assert drive.left(Pose(3.5, 0.0, 0.0)) == 6.5
    drive.move_to(Pose(7.0, 0.0, 0.0))
    assert (drive.next_place, drive.behind, drive.places_left) == (GOAL, 0.0, 1)


def test_the_end_counts_only_after_the_places_before_it() -> None:
    drive = Drive(Target(UUID(int=1), GOAL, (Pose(10.0, 4.0, 0.0),)), START, GOAL)
    assert progress_at(drive, GOAL) is Progress.UNDERWAY
    drive.move_to(Pose(10.0, 3.5, 0.0))
    assert progress_at(drive, GOAL) is Progress.REACHED


def test_the_plan_goes_over_the_places() -> None:
    plan = Drive(Target(UUID(int=1), GOAL, (Pose(5.0, 5.0, 0.0),)), START, GOAL).plan(START)
    assert max(pose.y for pose in plan) == 5.0
    assert plan[-1] == GOAL
