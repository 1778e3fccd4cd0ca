from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_robot_simulator.motion import OCCUPIED, GridMap, Limits, Motion, Pose, command_to, hall, obey
from nena_shared.ros import wrap, yaw_of

metres = st.floats(-1000, 1000)
poses = st.builds(Pose, metres, metres, st.floats(-10, 10).map(wrap))


@given(st.floats(-100, 100))
def test_a_wrapped_angle_is_the_same_direction_in_range(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0)


@given(poses)
def test_a_pose_and_its_inverse_cancel(pose: Pose) -> None:
    assert pose.then(pose.inverse()).distance(Pose(0, 0, 0)) == pytest.approx(0.0, abs=1e-9)
    assert math.cos(pose.then(pose.inverse()).yaw) == pytest.approx(1.0)


def test_a_pose_ahead_of_a_turned_one() -> None:
    x, y, yaw = Pose(1.0, 2.0, math.pi / 2).then(Pose(3.0, 0.0, math.pi / 2))
    assert (x, y, yaw) == pytest.approx((1.0, 5.0, math.pi))


@given(st.floats(-math.pi + 1e-6, math.pi), st.sampled_from([1.0, -1.0]))
def test_yaw_is_right_for_either_sign_of_the_quaternion(yaw: float, sign: float) -> None:
    found = yaw_of(0.0, 0.0, sign * math.sin(yaw / 2), sign * math.cos(yaw / 2))
    assert found is not None
    assert found == pytest.approx(yaw, abs=1e-6)


@pytest.mark.parametrize("quaternion", [(0, 0, 0, 0), (0, 0, 1, 1), (0, 0, math.nan, 1), (0, 0, math.inf, 0)])
def test_what_is_no_unit_quaternion_has_no_yaw(quaternion: tuple[float, float, float, float]) -> None:
    assert yaw_of(*quaternion) is None


@pytest.fixture
def place() -> GridMap:
    return hall(min_x=-2.0, min_y=-1.0, max_x=8.0, max_y=4.0, resolution=0.1)


def test_the_cells_fill_the_grid_with_walls_around(place: GridMap) -> None:
    assert (place.width, place.height) == (104, 54)
    assert len(place.cells) == 104 * 54
    assert place.cells.count(OCCUPIED) == 104 * 54 - 100 * 50
    assert (place.origin_x, place.origin_y) == pytest.approx((-2.2, -1.2))


@pytest.mark.parametrize(
    ("x", "y", "free", "covered"),
    [
        (0.0, 0.0, True, True),
        (7.95, 3.95, True, True),
        (8.05, 0.0, False, True),
        (0.0, -1.1, False, True),
        (8.5, 0.0, False, False),
        (0.0, -9.0, False, False),
        (math.nan, 0.0, False, False),
        (0.0, math.inf, False, False),
        (1e308, -1e308, False, False),
    ],
)
def test_inside_wall_and_outside(place: GridMap, x: float, y: float, *, free: bool, covered: bool) -> None:
    assert place.is_free(x, y) is free
    assert place.covers(x, y) is covered


def test_a_free_goal_stays_where_it_is(place: GridMap) -> None:
    assert place.free_near(Pose(1.0, 1.0, 0.3), 0.5) == Pose(1.0, 1.0, 0.3)


def test_a_goal_in_the_wall_moves_to_the_nearest_free_place(place: GridMap) -> None:
    near = place.free_near(Pose(8.15, 1.0, 0.3), 0.5)
    assert near is not None
    assert place.is_free(near.x, near.y)
    assert near.x == pytest.approx(7.95)
    assert (near.y, near.yaw) == pytest.approx((1.0, 0.3))


def test_a_goal_too_deep_in_the_wall_or_outside_has_no_place(place: GridMap) -> None:
    assert place.free_near(Pose(8.15, 1.0, 0.0), 0.1) is None
    assert place.free_near(Pose(8.3, 1.0, 0.0), 0.5) is None


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
