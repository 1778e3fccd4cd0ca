from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nena_edge_agent.driver.port import DriveGoal, Pose
from nena_edge_agent.nav2.poses import PoseReading, has_reached, localized, pose_problem, quaternion_of
from nena_edge_agent.nav2.settings import LocalisationSettings
from nena_shared.ros import wrap, yaw_of

ANGLES = st.floats(-20.0, 20.0)


@given(ANGLES, st.sampled_from([1.0, -1.0]))
def test_the_heading_is_read_from_a_quaternion_of_either_sign(yaw: float, sign: float) -> None:
    z, w = quaternion_of(yaw)
    back = yaw_of(0.0, 0.0, sign * z, sign * w)
    assert back is not None
    assert math.isclose(math.cos(back - yaw), 1.0, abs_tol=1e-9)


def turned(q: tuple[float, float, float, float], v: tuple[float, float, float]) -> tuple[float, float, float]:
    """Turn a vector by a unit quaternion (x, y, z, w), by the rule of Rodrigues."""
    x, y, z, w = q
    a, b, c = v
    s, t, u = y * c - z * b, z * a - x * c, x * b - y * a
    return (
        a + 2 * (w * s + y * u - z * t),
        b + 2 * (w * t + z * s - x * u),
        c + 2 * (w * u + x * t - y * s),
    )


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1))
def test_heading_is_where_the_front_points_whatever_the_signs_of_the_quaternion(
    parts: tuple[float, float, float, float],
) -> None:
    norm = math.hypot(*parts)
    x, y, z, w = (each / norm for each in parts)
    ahead, aside, _ = turned((x, y, z, w), (1.0, 0.0, 0.0))
    assume(math.hypot(ahead, aside) > 0.01)  # a robot that stands on its nose has no heading
    for sign in (1.0, -1.0):
        yaw = yaw_of(sign * x, sign * y, sign * z, sign * w)
        assert yaw is not None
        assert math.isclose(math.cos(yaw - math.atan2(aside, ahead)), 1.0, abs_tol=1e-9)


@given(ANGLES)
def test_quaternion_is_of_unit_length(yaw: float) -> None:
    assert math.isclose(math.hypot(*quaternion_of(yaw)), 1.0)


@given(ANGLES)
def test_wrap_stays_in_one_turn(angle: float) -> None:
    assert -math.pi < wrap(angle) <= math.pi
    assert math.isclose(math.cos(wrap(angle)), math.cos(angle), abs_tol=1e-9)


def test_heading_of_a_robot_on_a_slope() -> None:
    roll, yaw = 0.1, 1.2
    half_roll, half_yaw = roll / 2, yaw / 2
    quaternion = (
        math.sin(half_roll) * math.cos(half_yaw),
        math.sin(half_roll) * math.sin(half_yaw),
        math.cos(half_roll) * math.sin(half_yaw),
        math.cos(half_roll) * math.cos(half_yaw),
    )
    assert yaw_of(*quaternion) == pytest.approx(yaw)


@pytest.mark.parametrize("quaternion", [(0, 0, 0, 0), (0, 0, 1, 1), (0, 0, math.nan, 1), (0, 0, math.inf, 0)])
def test_an_invalid_quaternion_has_no_heading(quaternion: tuple[float, float, float, float]) -> None:
    assert yaw_of(*quaternion) is None


@pytest.mark.parametrize(
    ("variances", "sure"),
    [
        ((0.01, 0.01, 0.01), True),
        ((0.25, 0.25, 0.068), True),
        ((1.0, 0.01, 0.01), False),
        ((0.01, 1.0, 0.01), False),
        ((0.01, 0.01, 0.5), False),
        ((math.nan, 0.01, 0.01), False),
        ((-1.0, 0.01, 0.01), False),
    ],
)
def test_sureness_by_spread(variances: tuple[float, float, float], *, sure: bool) -> None:
    reading = PoseReading(0, 0, 0, "map", 0, *variances)
    assert localized(reading, LocalisationSettings()) is sure


@pytest.mark.parametrize(
    ("pose", "deviation_theta", "there"),
    [
        (Pose(5.4, 0.0, 3.0, "hall"), None, True),
        (Pose(5.6, 0.0, 0.0, "hall"), None, False),
        (Pose(5.0, 0.0, -math.pi + 0.05, "hall"), 0.2, True),
        (Pose(5.0, 0.0, math.pi - 0.4, "hall"), 0.2, False),
    ],
)
def test_agreement_with_a_goal(pose: Pose, deviation_theta: float | None, *, there: bool) -> None:
    goal = DriveGoal(1, Pose(5.0, 0.0, math.pi - 0.05, "hall"), 0.5, deviation_theta)
    assert has_reached(pose, goal) is there


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        (Pose(1.0, 2.0, 0.0, "attic"), "map 'attic'"),
        (Pose(1.0, math.nan, 0.0, "hall"), "is not a valid pose"),
        (Pose(1.0, 2.0, math.inf, "hall"), "is not a valid pose"),
    ],
)
def test_reports_why_a_robot_cannot_be_sent_to_a_pose(pose: Pose, reason: str) -> None:
    assert reason in str(pose_problem(pose, "hall"))


def test_a_pose_on_the_robots_map_can_be_driven_to() -> None:
    assert pose_problem(Pose(1.0, 2.0, 0.0, "hall"), "hall") is None
