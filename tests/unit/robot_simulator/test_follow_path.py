"""The simulated controller follows paths that others than the navigator give it."""

from __future__ import annotations

from math import cos, sin

import pytest

from nena_robot_simulator import faults
from nena_robot_simulator.goals import Action
from nena_robot_simulator.motion import Pose
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.servers import Server
from nena_shared.ros import GoalStatus
from support.timed_robot import A, B, Bench

ARC = tuple(Pose(5 * sin(i / 20), 5 - 5 * cos(i / 20), i / 20) for i in range(32))


def follow(bench: Bench, path: tuple[Pose, ...] = ARC) -> None:
    given = Goal(B, path[-1], "map", path[:-1])
    assert bench.robot.take_goal(given, 1, bench.now, Action.FOLLOW_PATH)


def status(bench: Bench) -> int:
    return int(bench.robot.goals(Action.FOLLOW_PATH)[B])


def test_a_path_is_followed_to_its_end() -> None:
    bench = Bench()
    follow(bench)
    off: list[float] = []

    def ended() -> bool:
        off.append(abs(bench.robot.pose.distance(Pose(0, 5, 0)) - 5.0))
        return status(bench) >= 4

    bench.run(40.0, ended)
    assert status(bench) == GoalStatus.SUCCEEDED
    assert bench.robot.pose.distance(ARC[-1]) <= 0.25
    assert max(off) < 0.15


def test_a_navigator_that_is_dead_is_not_needed() -> None:
    bench = Bench()
    bench.apply(faults.ServerDied(kind="server_died", server=Server.NAVIGATOR))
    follow(bench)
    bench.run(3.0)
    assert status(bench) == GoalStatus.EXECUTING
    assert bench.robot.velocity[0] > 0.3


def test_a_cancel_ends_it_and_the_robot_stands() -> None:
    bench = Bench()
    follow(bench)
    bench.run(2.0)
    assert bench.robot.feedback(Action.FOLLOW_PATH, bench.now) is not None
    assert bench.robot.cancel(B, 0, bench.now, Action.FOLLOW_PATH).code == 0
    bench.run(3.0)
    assert (status(bench), bench.robot.resting) == (GoalStatus.CANCELED, True)


def test_a_controller_that_dies_forgets_it_and_the_robot_stops() -> None:
    bench = Bench()
    follow(bench)
    bench.run(2.0)
    bench.apply(faults.ServerDied(kind="server_died", server=Server.CONTROLLER))
    bench.run(3.0)
    assert bench.robot.goals(Action.FOLLOW_PATH).find(B, bench.now) is None
    assert bench.robot.velocity == (0.0, 0.0)


def test_a_controller_that_hangs_stops_the_robot_and_tells_nothing() -> None:
    bench = Bench()
    follow(bench)
    bench.run(2.0)
    bench.apply(faults.ServerHung(kind="server_hung", server=Server.CONTROLLER))
    bench.run(3.0)
    assert bench.robot.feedback(Action.FOLLOW_PATH, bench.now) is None
    assert bench.robot.velocity == (0.0, 0.0)


@pytest.mark.parametrize("first", [Action.TO_POSE, Action.FOLLOW_PATH])
def test_of_a_goal_and_a_path_the_later_one_drives(first: Action) -> None:
    bench = Bench()
    if first is Action.TO_POSE:
        bench.take(A, 10.0, 0.0)
        bench.run(2.0)
        follow(bench)
        ended, runs = bench.robot.goals(Action.TO_POSE)[A], bench.robot.goals(Action.FOLLOW_PATH)[B]
    else:
        follow(bench)
        bench.run(2.0)
        bench.take(A, 10.0, 0.0)
        ended, runs = bench.robot.goals(Action.FOLLOW_PATH)[B], bench.robot.goals(Action.TO_POSE)[A]
    assert (ended, runs) == (GoalStatus.ABORTED, GoalStatus.EXECUTING)
    bench.run(40.0)
    last = ARC[-1] if first is Action.TO_POSE else Pose(10.0, 0.0, 0.0)
    assert bench.robot.pose.distance(last) <= 0.3


def test_it_is_aborted_halfway_where_that_is_asked_for() -> None:
    bench = Bench()
    bench.apply(faults.AbortHalfway(kind="abort_halfway", fraction=0.5, error_code=105))
    follow(bench)
    bench.run(40.0, lambda: status(bench) >= 4)
    entry = bench.robot.goals(Action.FOLLOW_PATH).find(B, bench.now)
    assert entry is not None
    assert (entry.status, entry.error_code) == (GoalStatus.ABORTED, 105)
