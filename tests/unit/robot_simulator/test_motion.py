from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_robot_simulator.motion import GridMap, Limits, Motion, Pose, command_to, hall, obey
from nena_shared.ros import wrap


@pytest.fixture
def place() -> GridMap:
    return hall(min_x=-2.0, min_y=-1.0, max_x=8.0, max_y=4.0, resolution=0.1)


LIMITS = Limits(speed=1.0, acceleration=1.0, yaw_rate=1.5, yaw_acceleration=3.0)
DT = 0.02

motions = st.builds(Pose, st.floats(-20, 20), st.floats(-20, 20), st.floats(-3.1, 3.1))


def step(motion: Motion, target: Pose | None, limits: Limits, dt: float, *, behind: float = 0.0) -> Motion:
    command = (0.0, 0.0) if target is None else command_to(motion.pose, target, limits, behind=behind)
    return obey(motion, command, limits, dt)


def drive(motion: Motion, target: Pose | None, seconds: float) -> list[Motion]:
    track = [motion]
    for _ in range(round(seconds / DT)):
        track.append(step(track[-1], target, LIMITS, DT))
    return track


@settings(max_examples=50)
@given(motions, motions)
def test_every_pose_is_reached_in_the_time_that_the_way_takes(start: Pose, target: Pose) -> None:
    seconds = 15.0 + 1.3 * start.distance(target)
    end = drive(Motion(start), target, seconds)[-1]
    assert end.pose.distance(target) < 0.1
    assert abs(wrap(end.pose.yaw - target.yaw)) < 0.05


@settings(max_examples=50)
@given(motions, st.lists(motions, min_size=1, max_size=4))
def test_no_limit_is_ever_exceeded(start: Pose, targets: list[Pose]) -> None:
    motion = Motion(start)
    for target in targets:
        for after in drive(motion, target, 2.0)[1:]:
            assert 0.0 <= after.speed <= LIMITS.speed
            assert abs(after.yaw_rate) <= LIMITS.yaw_rate + 1e-9
            assert abs(after.speed - motion.speed) <= LIMITS.acceleration * DT + 1e-9
            assert abs(after.yaw_rate - motion.yaw_rate) <= LIMITS.yaw_acceleration * DT + 1e-9
            assert after.pose.distance(motion.pose) <= LIMITS.speed * DT + 1e-9
            motion = after


def test_without_a_target_the_robot_brakes_over_its_braking_distance() -> None:
    track = drive(Motion(Pose(0, 0, 0), speed=1.0), None, 2.0)
    assert not track[40].standing
    assert track[-1].standing
    assert track[-1].pose.x == pytest.approx(0.5, abs=0.02)


def test_a_heavy_base_brakes_longer_than_it_accelerates() -> None:
    heavy = replace(LIMITS, deceleration=0.25)
    motion = Motion(Pose(0, 0, 0))
    for _ in range(round(1.0 / DT)):
        motion = obey(motion, (1.0, 0.0), heavy, DT)
    assert motion.speed == pytest.approx(1.0)
    for _ in range(round(2.0 / DT)):
        motion = obey(motion, (0.0, 0.0), heavy, DT)
    assert motion.speed == pytest.approx(0.5)


def test_a_goal_behind_is_turned_to_before_driving() -> None:
    track = drive(Motion(Pose(0, 0, 0)), Pose(-5, 0.1, math.pi), 1.0)
    assert track[-1].pose.distance(Pose(0, 0, 0)) < 0.1
    assert track[-1].yaw_rate > 1.0


def test_a_new_goal_straight_ahead_keeps_the_speed() -> None:
    cruising = drive(Motion(Pose(0, 0, 0)), Pose(10, 0, 0), 5.0)[-1]
    track = drive(cruising, Pose(20, 0, 0), 8.0)
    assert min(motion.speed for motion in track) == pytest.approx(1.0)


def test_does_not_brake_for_a_place_that_it_passes() -> None:
    place = Pose(0.1, 0.0, 0.0)
    fast = Motion(Pose(0.0, 0.0, 0.0), speed=LIMITS.speed)
    assert step(fast, place, LIMITS, DT).speed < LIMITS.speed
    assert step(fast, place, LIMITS, DT, behind=10.0).speed == LIMITS.speed
