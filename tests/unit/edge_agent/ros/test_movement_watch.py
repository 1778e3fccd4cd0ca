from __future__ import annotations

import math

from nena_edge_agent.driver.map_port import MapPose
from nena_edge_agent.ros.movement_watch import MovementWatch


def drive(watch: MovementWatch, speed: float, omega: float, *, start: float, seconds: float) -> float:
    """Let a robot move evenly; gives the time at the end."""
    steps = round(seconds / 0.05)
    for step in range(1, steps + 1):
        watch.on_velocity(speed, omega, start + step * 0.05)
    return start + steps * 0.05


def test_robot_that_stands_is_blocked_after_a_while_and_no_more_once_it_moves() -> None:
    watch = MovementWatch(10.0)
    assert not watch.blocked(driving=True, now=100.0)
    now = drive(watch, 0.0, 0.0, start=100.0, seconds=9.9)
    assert not watch.blocked(driving=True, now=now)
    now = drive(watch, 0.0, 0.0, start=now, seconds=0.2)
    assert watch.blocked(driving=True, now=now)
    now = drive(watch, 0.5, 0.0, start=now, seconds=0.3)
    assert not watch.blocked(driving=True, now=now)


def test_turning_on_the_spot_is_movement_and_trembling_is_none() -> None:
    turning, trembling = MovementWatch(10.0), MovementWatch(10.0)
    for watch in (turning, trembling):
        watch.blocked(driving=True, now=0.0)
    drive(turning, 0.0, 0.2, start=0.0, seconds=11.0)
    for step in range(220):
        trembling.on_velocity(0.02 * (-1) ** step, 0.0, step * 0.05)
    assert not turning.blocked(driving=True, now=11.0)
    assert trembling.blocked(driving=True, now=11.0)


def test_without_odometry_the_poses_tell() -> None:
    watch = MovementWatch(10.0)
    watch.blocked(driving=True, now=0.0)
    watch.on_pose(MapPose(1.0, 0.0, 0.0, "hall"), 5.0)
    watch.on_pose(MapPose(1.02, 0.0, 0.0, "hall"), 9.0)
    assert not watch.blocked(driving=True, now=14.9)
    assert watch.blocked(driving=True, now=15.0)


def test_time_without_a_goal_does_not_count() -> None:
    watch = MovementWatch(10.0)
    watch.blocked(driving=True, now=0.0)
    assert not watch.blocked(driving=False, now=100.0)
    assert not watch.blocked(driving=True, now=109.0)
    assert watch.blocked(driving=True, now=110.0)


def test_velocity_that_is_none_and_a_gap_in_the_odometry_are_no_movement() -> None:
    watch = MovementWatch(10.0)
    watch.blocked(driving=True, now=0.0)
    watch.on_velocity(0.0, 0.0, 0.0)
    watch.on_velocity(math.nan, 0.0, 0.5)
    watch.on_velocity(1.0, 0.0, 9.0)
    assert watch.blocked(driving=True, now=10.0)
