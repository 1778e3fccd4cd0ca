from __future__ import annotations

import math
from dataclasses import replace
from uuid import UUID

import pytest

from nena_robot_simulator import faults
from nena_robot_simulator.goals import Action
from nena_robot_simulator.motion import OCCUPIED, GridMap, Pose
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.servers import Server
from support.timed_robot import A, B, Bench


def code_of(bench: Bench, goal_id: UUID, action: Action = Action.TO_POSE) -> int:
    entry = bench.robot.goals(action).find(goal_id, bench.now)
    assert entry is not None
    return entry.error_code


def test_a_drive_ends_at_the_goal_within_the_tolerance() -> None:
    bench = Bench()
    assert bench.take(A, 4.0, 3.0, 1.0)
    assert bench.until_ended() == 4
    assert bench.robot.pose.distance(Pose(4, 3, 1)) <= 0.25
    assert abs(bench.robot.pose.yaw - 1.0) <= 0.25


def test_the_robot_rests_only_after_it_has_braked() -> None:
    bench = Bench()
    bench.take(A, 5.0, 0.0)
    resting = [bench.robot.resting]
    bench.until_ended()
    assert bench.robot.velocity[0] > 0.1
    resting.append(bench.robot.resting)
    bench.run(2.0)
    resting.append(bench.robot.resting)
    assert resting == [False, False, True]
    assert bench.robot.velocity == (0.0, 0.0)


def test_a_cancelled_drive_ends_before_standstill() -> None:
    bench = Bench()
    bench.take(A, 10.0, 0.0)
    bench.run(3.0)
    assert bench.robot.cancel(A, 0, bench.now).code == 0
    assert 0.02 <= bench.run(1.0, lambda: int(bench.robot.goals(Action.TO_POSE)[A]) == 5) <= 0.08
    assert bench.robot.velocity[0] > 0.8
    bench.run(2.0)
    assert bench.robot.resting


def test_a_new_goal_ahead_takes_over_at_full_speed() -> None:
    bench = Bench()
    bench.take(A, 5.0, 0.0)
    bench.run(3.5)
    bench.take(B, 10.0, 0.0)
    slowest = 1.0
    for _ in range(300):
        bench.run(0.01)
        slowest = min(slowest, bench.robot.velocity[0])
    assert slowest == pytest.approx(1.0)
    assert int(bench.robot.goals(Action.TO_POSE)[A]) == 6
    assert bench.until_ended(B) == 4


def test_the_time_factor_shortens_drives_and_shows_in_the_velocity() -> None:
    slow, fast = Bench(), Bench(time_factor=10.0)
    slow.take(A, 10.0, 0.0)
    fast.take(A, 10.0, 0.0)
    seconds = slow.run(60.0, lambda: int(slow.robot.goals(Action.TO_POSE)[A]) == 4)
    assert fast.run(60.0, lambda: fast.robot.velocity[0] > 9.0) < 1.0
    assert fast.until_ended() == 4
    assert fast.now - 100.0 == pytest.approx(seconds / 10.0, rel=0.2)


def test_the_robot_does_not_jump_after_the_program_was_frozen() -> None:
    bench = Bench()
    bench.take(A, 10.0, 0.0)
    bench.run(2.0)
    before = bench.robot.pose
    bench.now += 5.0
    bench.robot.advance(bench.now)
    assert bench.robot.pose.distance(before) <= 0.2 + 1e-9


MASK = GridMap(
    width=20, height=20, resolution=0.1, origin_x=4.0, origin_y=-1.0, cells=bytes([OCCUPIED]) * 400
)
"""Forbids x from 4 to 6 m and y from -1 to 1 m."""


def test_goals_deep_in_a_keep_out_zone_end_with_208_after_the_recoveries() -> None:
    bench = Bench(recovery_time=18.0)
    bench.robot.keep_out(MASK)
    bench.take(A, 5.0, 0.0)
    assert bench.until_ended() == 6
    assert 17.0 <= bench.now - 100.0 <= 19.0
    assert code_of(bench, A) == 208
    bench.take(B, 8.0, 0.0)
    assert bench.until_ended(B) == 4


def test_a_goal_at_the_border_of_a_keep_out_zone_is_reached_short_of_it() -> None:
    bench = Bench()
    bench.robot.keep_out(MASK)
    bench.take(A, 4.2, 0.0)
    assert bench.until_ended() == 4
    assert 0.3 <= bench.robot.pose.distance(Pose(4.2, 0.0, 0.0)) <= 0.75
    assert not MASK.forbids(bench.robot.pose.x, bench.robot.pose.y)


def test_no_path_leads_through_poses_of_which_one_is_forbidden() -> None:
    bench = Bench()
    bench.robot.keep_out(MASK)
    goal = Goal(A, Pose(8.0, 0.0, 0.0), "map", via=(Pose(5.0, 0.0, 0.0),))
    bench.robot.take_goal(goal, 1, bench.now, Action.THROUGH_POSES)
    bench.run(0.1)
    assert code_of(bench, A, Action.THROUGH_POSES) == 308


@pytest.mark.parametrize("value", [0, 50, 255], ids=["free", "weighted", "unknown"])
def test_a_mask_forbids_only_closed_cells(value: int) -> None:
    assert not replace(MASK, cells=bytes([value]) * 400).forbids(5.0, 0.0)


@pytest.mark.parametrize(
    ("limit", "percentage", "speed"),
    [
        (0.25, False, 0.25),
        (50.0, True, 0.25),
        (0.8, False, 0.8),
        (150.0, True, 0.75),
        (0.02, False, 0.02),
        (-0.3, False, -0.3),
        (0.0, False, 0.5),
        (0.0, True, 0.5),
    ],
)
def test_speed_limits_are_obeyed_as_regulated_pure_pursuit_does(
    limit: float, speed: float, *, percentage: bool
) -> None:
    bench = Bench(drive={"speed": 0.5, "acceleration": 2.5, "approach": 0.6})
    bench.take(A, 15.0, 0.0)
    bench.run(3.0)
    bench.robot.limit_speed(limit, percentage=percentage)
    bench.run(2.0)
    assert bench.robot.velocity[0] == pytest.approx(speed)


@pytest.mark.parametrize(
    ("x", "y", "frame"),
    [(100.0, 0.0, "map"), (math.nan, 0.0, "map"), (1.0, 0.0, "moon"), (1.0, 0.0, "")],
)
def test_goals_that_no_way_leads_to_are_aborted_at_once(x: float, y: float, frame: str) -> None:
    bench = Bench()
    assert bench.take(A, x, y, frame=frame)
    assert bench.until_ended(seconds=0.1) == 6
    assert bench.robot.pose == Pose(0, 0, 0)


def test_a_goal_in_the_wall_ends_beside_it_and_succeeds() -> None:
    bench = Bench()
    bench.take(A, 30.15, 0.0)
    assert bench.until_ended() == 4
    assert bench.robot.pose.x < 30.0


def test_a_goal_in_the_odometry_frame_counts_from_the_start() -> None:
    bench = Bench(start={"x": 2.0, "y": 1.0, "yaw": math.pi / 2})
    bench.take(A, 3.0, 0.0, frame="odom")
    assert bench.until_ended() == 4
    assert bench.robot.pose.distance(Pose(2, 4, 0)) <= 0.3


def test_without_an_initial_pose_goals_are_aborted_and_with_one_they_are_driven() -> None:
    bench = Bench(localisation={"known_at_start": False})
    assert bench.robot.scan() is None
    bench.take(A, 1.0, 0.0)
    assert bench.until_ended(seconds=0.1) == 6
    bench.robot.take_initial_pose(Pose(5.0, 5.0, 0.0))
    estimate = bench.robot.scan()
    assert estimate is not None
    assert estimate.pose.distance(Pose(5, 5, 0)) < 0.2
    bench.take(B, 6.0, 5.0)
    assert bench.until_ended(B) == 4


def test_the_odometry_does_not_jump_with_an_initial_pose() -> None:
    bench = Bench(start={"x": 2.0, "y": 1.0, "yaw": 1.0})
    assert bench.robot.odometry == pytest.approx((0, 0, 0))
    bench.take(A, 5.0, 1.0)
    bench.until_ended()
    before = bench.robot.odometry
    bench.robot.take_initial_pose(Pose(-4.0, 3.0, -2.0))
    assert bench.robot.pose == Pose(-4.0, 3.0, -2.0)
    assert bench.robot.odometry == pytest.approx(before)


def test_rejected_goals_leave_no_trace() -> None:
    bench = Bench()
    bench.apply(faults.RejectGoals(goals=1))
    assert not bench.take(A, 1.0, 0.0)
    bench.run(1.0)
    assert bench.robot.take_unpublished() == []
    assert bench.robot.resting
    assert bench.take(B, 1.0, 0.0)


def test_a_stuck_robot_stands_with_its_goal_executing_and_drives_on_afterwards() -> None:
    bench = Bench()
    bench.take(A, 5.0, 0.0)
    bench.run(2.0)
    bench.apply(faults.Stuck())
    bench.run(2.0)
    stands_at = bench.robot.pose
    bench.run(20.0)
    assert bench.robot.pose == stands_at
    assert int(bench.robot.goals(Action.TO_POSE)[A]) == 2
    bench.apply(faults.Stuck(active=False))
    assert bench.until_ended() == 4


def test_an_inactive_navigator_aborts_and_swallows() -> None:
    bench = Bench()
    bench.take(A, 5.0, 0.0)
    bench.run(1.0)
    bench.apply(faults.Inactive())
    assert not bench.robot.servers.group_active(Server.MANAGER)
    assert bench.until_ended(seconds=0.2) == 6
    assert not bench.take(B, 1.0, 0.0)
    bench.apply(faults.Inactive(active=False))
    assert bench.take(B, 1.0, 0.0)


def test_a_silent_amcl_while_the_robot_drives_well() -> None:
    bench = Bench()
    bench.apply(faults.AmclSilent())
    bench.take(A, 5.0, 0.0)
    assert bench.until_ended() == 4
    assert bench.robot.scan() is None
    bench.apply(faults.AmclSilent(active=False))
    assert bench.robot.scan() is not None


def test_a_lost_localisation_shows_by_its_covariance_and_drives_on() -> None:
    bench = Bench()
    bench.apply(faults.LocalisationLost(xy_deviation=2.0))
    lost = bench.robot.scan()
    assert lost is not None
    assert lost.xy_variance == 4.0
    bench.take(A, 3.0, 0.0)
    assert bench.until_ended() == 4
    bench.apply(faults.LocalisationLost(active=False))
    found = bench.robot.scan()
    assert found is not None
    assert found.xy_variance < 0.01


def test_a_pose_jump_is_seen_in_the_estimates_and_not_in_the_world() -> None:
    bench = Bench()
    bench.apply(faults.PoseJump(x=2.0, y=-1.0))
    estimate = bench.robot.scan()
    assert estimate is not None
    assert (estimate.pose.x, estimate.pose.y) == pytest.approx((2.0, -1.0), abs=0.15)
    assert bench.robot.pose == Pose(0.0, 0.0, 0.0)


def test_an_unconfigured_navigator_forgets_its_goals_and_the_robot_stops() -> None:
    bench = Bench()
    bench.take(A, 20.0, 0.0)
    bench.run(5.0)
    assert bench.robot.velocity[0] > 0.5
    bench.robot.take_unpublished()
    bench.apply(faults.Unconfigured())
    bench.run(5.0)
    assert bench.robot.resting
    assert not bench.robot.servers.group_active(Server.MANAGER)
    assert not bench.take(B, 1.0, 0.0)
    bench.apply(faults.Unconfigured(active=False))
    assert bench.robot.goals(Action.TO_POSE).entries(bench.now) == ()
    assert bench.robot.take_unpublished() == []
    x = bench.robot.pose.x
    assert bench.take(B, x + 1.0, 0.0)
    assert bench.until_ended(B) == 4


def test_a_controller_without_its_navigator_drives_to_the_end_of_its_path() -> None:
    bench = Bench()
    bench.take(A, 10.0, 0.0)
    bench.run(2.0)
    bench.apply(faults.ServerDied(server=Server.NAVIGATOR))
    bench.run(30.0, lambda: bench.robot.resting)
    assert bench.robot.pose.distance(Pose(10, 0, 0)) <= 0.25
    assert bench.robot.goals(Action.TO_POSE).entries(bench.now) == ()


@pytest.mark.parametrize(
    "fault", [faults.ServerDied(server=Server.NAVIGATOR), faults.ServerHung(server=Server.NAVIGATOR)]
)
def test_a_controller_whose_goal_is_cancelled_stands(fault: faults.AnyFault) -> None:
    bench = Bench()
    bench.take(A, 10.0, 0.0)
    bench.run(3.0)
    bench.apply(fault)
    bench.run(0.5)
    assert bench.robot.velocity[0] == pytest.approx(1.0)
    assert bench.robot.cancel_controller()
    bench.run(5.0, lambda: bench.robot.velocity == (0.0, 0.0))
    assert bench.robot.pose.x < 5.0
    assert not bench.robot.cancel_controller()


def test_a_deaf_controller_drives_on() -> None:
    bench = Bench()
    bench.take(A, 10.0, 0.0)
    bench.apply(faults.ControllerDeaf())
    bench.run(3.0)
    assert bench.robot.cancel_controller()
    assert bench.until_ended() == 4
    assert bench.robot.pose.distance(Pose(10, 0, 0)) <= 0.25


def test_a_living_navigator_takes_a_cancelled_controller_for_success() -> None:
    bench = Bench()
    bench.take(A, 10.0, 0.0)
    bench.run(3.0)
    bench.robot.cancel_controller()
    assert bench.until_ended() == 4
    assert bench.robot.pose.x < 5.0


def test_a_new_goal_that_comes_too_late_for_replanning_succeeds_at_the_old_place() -> None:
    bench = Bench(replan_period=1.0)
    bench.take(A, 5.0, 0.0)
    bench.run(30.0, lambda: bench.robot.pose.x >= 4.65)
    bench.take(B, 10.0, 0.0)
    assert bench.until_ended(B) == 4
    assert bench.robot.pose.x < 5.3
    assert int(bench.robot.goals(Action.TO_POSE)[A]) == 6


def test_a_new_goal_that_comes_in_time_for_replanning_is_driven_to() -> None:
    bench = Bench(replan_period=1.0)
    bench.take(A, 5.0, 0.0)
    bench.run(30.0, lambda: bench.robot.pose.x >= 3.5)
    bench.take(B, 10.0, 0.0)
    assert bench.until_ended(B) == 4
    assert bench.robot.pose.distance(Pose(10, 0, 0)) <= 0.25


def test_a_nav2_that_starts_takes_no_goals() -> None:
    bench = Bench()
    bench.apply(faults.BringUp())
    assert not bench.take(A, 5.0, 0.0)
    bench.apply(faults.BringUp(active=False))
    assert bench.take(A, 5.0, 0.0)
