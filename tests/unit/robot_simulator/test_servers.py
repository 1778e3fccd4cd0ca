"""Processes of Nav2 that die, hang and are deactivated one by one."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any
from uuid import UUID

import pytest

from nena_robot_simulator import faults
from nena_robot_simulator.goals import Action
from nena_robot_simulator.motion import Pose
from nena_robot_simulator.robot import Feedback
from nena_robot_simulator.servers import BOND_TIMEOUT, LifecycleState, Server, Servers, Transition
from support.timed_robot import A, B, Bench

WALLED_IN = faults.Unreachable(error_code=208)


def driving(goal_id: UUID = A, **settings: Any) -> Bench:
    bench = Bench(**settings)
    bench.take(goal_id, 15.0, 0.0)
    bench.run(3.0)
    return bench


def ended(bench: Bench, goal_id: UUID = A) -> tuple[int, int]:
    """Return status and error code of a goal."""
    entry = bench.robot.goals(Action.TO_POSE).find(goal_id, bench.now)
    assert entry is not None
    return int(entry.status), entry.error_code


def stands(bench: Bench) -> Callable[[], bool]:
    return lambda: bench.robot.velocity == (0.0, 0.0)


def at_least(bench: Bench, x: float) -> bool:
    return bench.robot.pose.x >= x


def feedback(bench: Bench) -> Feedback:
    found = bench.robot.feedback(Action.TO_POSE, bench.now)
    assert found is not None
    return found


@pytest.mark.parametrize("fault", [faults.ServerDied, faults.ServerHung])
def test_without_a_controller_the_base_stops_after_its_own_timeout(
    fault: type[faults.ServerDied | faults.ServerHung],
) -> None:
    bench = driving()
    bench.apply(fault(server=Server.CONTROLLER))
    bench.run(0.6)
    assert bench.robot.velocity[0] == pytest.approx(1.0), "its last command still counts"
    assert bench.run(5.0, stands(bench)) < 1.3
    assert bench.until_ended(seconds=BOND_TIMEOUT) == 6, "the lifecycle manager has deactivated Nav2"


def test_without_a_planner_the_drive_ends_at_the_next_replanning() -> None:
    bench = driving(replan_period=1.0)
    bench.apply(faults.ServerDied(server=Server.PLANNER))
    assert bench.until_ended(seconds=1.1) == 6
    assert ended(bench) == (6, 0)


def test_without_a_localisation_the_controller_gives_up_after_a_second() -> None:
    bench = driving()
    bench.apply(faults.ServerDied(server=Server.LOCALISATION))
    assert 0.9 < bench.run(5.0, lambda: ended(bench)[0] == 6) < 1.1
    assert ended(bench) == (6, 102)


def test_a_localisation_that_comes_back_knows_no_pose() -> None:
    bench = Bench()
    assert bench.robot.scan() is not None
    bench.apply(faults.ServerDied(server=Server.LOCALISATION))
    bench.apply(faults.ServerDied(server=Server.LOCALISATION, active=False))
    bench.robot.force_estimate()
    assert bench.robot.scan() is None
    bench.take(A, 3.0, 0.0)
    bench.run(0.1)
    assert ended(bench)[0] == 6
    bench.robot.take_initial_pose(Pose(0, 0, 0))
    assert bench.robot.scan() is not None


def test_behaviours_that_die_end_the_drive_by_the_bond_alone() -> None:
    bench = driving()
    bench.apply(faults.ServerDied(server=Server.BEHAVIOURS))
    bench.run(BOND_TIMEOUT - 0.2)
    assert ended(bench)[0] == 2
    assert bench.until_ended(seconds=0.5) == 6


def test_a_lifecycle_manager_that_dies_ends_nothing() -> None:
    bench = driving()
    bench.apply(faults.ServerDied(server=Server.MANAGER))
    bench.apply(faults.ServerDied(server=Server.BEHAVIOURS))
    assert bench.until_ended() == 4


def test_a_server_that_comes_back_has_its_group_activated() -> None:
    bench = driving()
    bench.apply(faults.ServerDied(server=Server.CONTROLLER))
    bench.run(BOND_TIMEOUT + 0.5)
    assert not bench.robot.servers.group_active(Server.MANAGER)
    assert not bench.take(B, 20.0, 0.0)
    bench.apply(faults.ServerDied(server=Server.CONTROLLER, active=False))
    bench.run(0.1)
    assert bench.robot.servers.group_active(Server.MANAGER)
    assert bench.take(B, 20.0, 0.0)
    assert bench.until_ended(B) == 4


def test_a_robot_without_a_way_spins_waits_and_backs_up_before_208() -> None:
    bench = Bench(recovery_time=18.0)
    bench.apply(WALLED_IN)
    bench.take(A, 5.0, 0.0)
    turned = bench.run(5.0, lambda: bench.robot.velocity[1] > 0.5)
    backed = bench.run(20.0, lambda: bench.robot.velocity[0] < -0.1)
    assert turned + backed < 10.0
    assert feedback(bench).left == 0.0
    assert feedback(bench).recoveries >= 4
    assert bench.until_ended() == 6
    assert ended(bench) == (6, 208)
    assert 17.0 <= bench.now - 100.0 <= 21.0


def test_recoveries_count_to_a_dozen() -> None:
    bench = Bench(recovery_time=18.0)
    bench.apply(WALLED_IN)
    bench.take(A, 5.0, 0.0)
    bench.run(17.9)
    assert 12 <= feedback(bench).recoveries <= 15


def test_a_recovery_can_be_cancelled_at_the_behaviours() -> None:
    bench = Bench(recovery_time=18.0)
    bench.apply(WALLED_IN)
    bench.take(A, 5.0, 0.0)
    bench.run(1.0)
    assert not bench.robot.cancel_controller()
    assert bench.robot.cancel_recovery()
    assert bench.run(3.0, stands(bench)) < 1.0


def test_a_goal_is_approached_as_regulated_pure_pursuit_does() -> None:
    bench = Bench(drive={"speed": 0.5, "approach": 0.6})
    bench.take(A, 6.0, 0.0)
    speeds = []
    for place in (5.0, 5.5, 5.7):
        bench.run(60.0, partial(at_least, bench, place))
        speeds.append(bench.robot.velocity[0])
    assert speeds == pytest.approx([0.5, 0.41, 0.25], abs=0.03)


def test_a_new_goal_is_known_to_the_feedback_at_the_next_replanning() -> None:
    bench = Bench(replan_period=1.0)
    bench.take(A, 15.0, 0.0)
    bench.run(0.01)
    assert feedback(bench).left == 0.0, "no path yet"
    bench.run(3.0)
    bench.take(B, 25.0, 0.0)
    bench.run(0.05)
    assert feedback(bench).goal_id == B
    assert feedback(bench).left < 13.0, "still the old path"
    bench.run(1.0)
    assert feedback(bench).left > 20.0


def test_lifecycle_transitions_follow_their_states() -> None:
    servers = Servers()
    assert not servers.change(Server.PLANNER, Transition.ACTIVATE)
    assert servers.change(Server.PLANNER, Transition.DEACTIVATE)
    assert not servers.group_active(Server.MANAGER)
    assert servers.change(Server.PLANNER, Transition.CLEANUP)
    assert servers.state(Server.PLANNER) is LifecycleState.UNCONFIGURED
    assert not servers.change(Server.PLANNER, 99)
