from __future__ import annotations

import random

import pytest

from nena_robot_simulator.motion import Pose
from nena_robot_simulator.sensors import Battery, Localisation


def make_battery(charge: float = 1.0) -> Battery:
    return Battery(charge=charge, per_metre=0.001, per_second=0.0001)


def test_driving_and_time_take_their_share() -> None:
    battery = make_battery()
    battery.drain(100.0, 50.0)
    assert battery.charge == pytest.approx(1.0 - 0.1 - 0.005)


def test_an_empty_battery_stays_empty() -> None:
    battery = make_battery(0.01)
    battery.drain(1000.0, 1.0)
    assert battery.charge == 0.0


def test_both_scales_say_the_same() -> None:
    assert make_battery(0.42).percentage("fraction") == pytest.approx(0.42)
    assert make_battery(0.42).percentage("percent") == pytest.approx(42.0)


def test_driving_draws_more_current_and_the_voltage_falls_with_the_charge() -> None:
    battery = make_battery()
    battery.drain(0.0, 1.0)
    resting, full = battery.current, battery.voltage
    battery.drain(100.0, 1.0)
    assert battery.current < resting < 0.0
    assert battery.voltage < full


def make_localisation(*, known: bool, deviation: float = 0.0) -> Localisation:
    return Localisation(
        known=known, xy_deviation=deviation, yaw_deviation=deviation / 2, noise=random.Random(1)
    )


def test_nothing_is_said_before_an_initial_pose_however_far_the_robot_drives() -> None:
    amcl = make_localisation(known=False)
    assert not amcl.known
    assert [amcl.scan(Pose(x, 0, 0)) for x in range(5)] == [None] * 5
    amcl.force()
    assert amcl.scan(Pose(9, 0, 0)) is None


def test_an_initial_pose_is_answered_once() -> None:
    amcl = make_localisation(known=False)
    amcl.initialise()
    assert amcl.known
    estimate = amcl.scan(Pose(1, 2, 0.5))
    assert estimate is not None
    assert estimate.pose == pytest.approx((1, 2, 0.5))
    assert amcl.scan(Pose(1, 2, 0.5)) is None


@pytest.mark.parametrize(
    ("pose", "said"),
    [
        (Pose(0.24, 0, 0), False),
        (Pose(0.26, 0, 0), True),
        (Pose(0, 0, 0.19), False),
        (Pose(0, 0, -0.21), True),
        (Pose(0.2, 0, 0.15), False),
    ],
)
def test_a_standing_robot_is_silent_until_it_has_moved_enough(pose: Pose, *, said: bool) -> None:
    amcl = make_localisation(known=True)
    assert amcl.scan(Pose(0, 0, 0)) is not None
    assert (amcl.scan(pose) is not None) is said


def test_distance_counts_from_the_last_estimate() -> None:
    amcl = make_localisation(known=True)
    said = [amcl.scan(Pose(0.1 * step, 0, 0)) is not None for step in range(10)]
    assert said == [True, False, False, True, False, False, True, False, False, True]


def test_an_estimate_is_forced_without_motion() -> None:
    amcl = make_localisation(known=True)
    amcl.scan(Pose(0, 0, 0))
    amcl.force()
    assert amcl.scan(Pose(0, 0, 0)) is not None
    assert amcl.scan(Pose(0, 0, 0)) is None


def test_estimates_scatter_as_the_variances_say() -> None:
    amcl = make_localisation(known=True, deviation=0.1)
    errors = []
    for step in range(400):
        estimate = amcl.scan(Pose(float(step), 0, 0))
        assert estimate is not None
        assert (estimate.xy_variance, estimate.yaw_variance) == pytest.approx((0.01, 0.0025))
        errors.append(estimate.pose.x - step)
    assert sum(error**2 for error in errors) / len(errors) == pytest.approx(0.01, rel=0.3)
