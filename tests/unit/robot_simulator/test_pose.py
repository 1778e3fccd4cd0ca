from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_robot_simulator.pose import Pose, wrap, yaw_of

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
