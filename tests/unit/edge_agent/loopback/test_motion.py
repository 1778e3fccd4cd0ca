from __future__ import annotations

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.loopback.motion import Motion, braking

METRES = st.floats(-100, 100)
POSES = st.builds(Pose, METRES, METRES, st.floats(-pi, pi), st.just("m"))


def motion(start: Pose, goal: Pose, *, turn_at_end: bool = True) -> Motion:
    return Motion(start=start, goal=goal, begin=10.0, speed=2.0, rate=1.0, turn_at_end=turn_at_end)


def test_it_turns_drives_and_turns() -> None:
    way = motion(Pose(0, 0, 0, "m"), Pose(0, 4, pi, "m"))

    assert way.end == pytest.approx(10 + pi / 2 + 2 + pi / 2)
    pose, vx, omega = way.at(10 + pi / 4)
    assert (pose.x, pose.y, pose.theta, vx, omega) == pytest.approx((0, 0, pi / 4, 0, 1))
    pose, vx, omega = way.at(10 + pi / 2 + 1)
    assert (pose.x, pose.y, pose.theta, vx, omega) == pytest.approx((0, 2, pi / 2, 2, 0), abs=1e-9)
    pose, vx, omega = way.at(10 + pi / 2 + 2 + pi / 4)
    assert (pose.y, pose.theta, vx, omega) == pytest.approx((4, 3 * pi / 4, 0, 1))


def test_without_a_demand_it_keeps_its_heading() -> None:
    way = motion(Pose(0, 0, 0, "m"), Pose(4, 0, 2.0, "m"), turn_at_end=False)

    assert way.at(way.end)[0].theta == 0.0
    assert way.end == 12.0


@given(POSES, POSES)
def test_it_begins_at_its_start_and_ends_on_its_goal(start: Pose, goal: Pose) -> None:
    way = motion(start, goal)

    first, _, _ = way.at(9.0)
    last, vx, omega = way.at(way.end + 1.0)

    assert (first.x, first.y) == pytest.approx((start.x, start.y))
    assert (last.x, last.y, vx, omega) == (goal.x, goal.y, 0.0, 0.0)
    assert abs((last.theta - goal.theta + pi) % (2 * pi) - pi) < 1e-6


def test_it_brakes_evenly_to_a_stand() -> None:
    way = motion(Pose(0, 0, 0, "m"), Pose(100, 0, 0, "m"))
    stop = braking(way, 20.0, 0.5)

    assert stop is not None
    assert stop.end == 24.0
    assert stop.at(20.0)[:2] == (Pose(20, 0, 0, "m"), 2.0)
    pose, vx, _ = stop.at(22.0)
    assert (pose.x, vx) == (23, 1)
    assert stop.at(30.0) == (Pose(24, 0, 0, "m"), 0.0, 0.0)


def test_near_its_goal_it_brakes_harder_and_never_goes_beyond() -> None:
    way = motion(Pose(0, 0, 0, "m"), Pose(21, 0, 0, "m"))
    stop = braking(way, 20.0, 0.5)

    assert stop is not None
    assert stop.at(stop.end)[0].x == pytest.approx(21)


def test_without_a_deceleration_or_while_it_turns_it_stops_on_the_spot() -> None:
    ahead, aside = Pose(100, 0, 0, "m"), Pose(0, 100, 0, "m")

    assert braking(motion(Pose(0, 0, 0, "m"), ahead), 20.0, 0.0) is None
    assert braking(motion(Pose(0, 0, 0, "m"), aside), 10.5, 0.5) is None
