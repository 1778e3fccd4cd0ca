from __future__ import annotations

import math

import pytest
from structlog.testing import capture_logs

from nena_edge_agent.driver.port import BatteryReport, Pose
from nena_edge_agent.nav2.robot_base import Battery, BatteryReading, MovementWatch, Standstill, without_noise
from nena_edge_agent.nav2.settings import BatteryScale


def test_is_unknown_without_odometry() -> None:
    standstill = Standstill()
    assert not standstill.known(0.0)
    assert not standstill.stands(0.0)


def test_stands_after_some_time_at_standstill() -> None:
    standstill = Standstill()
    standstill.on_velocity(0.005, -0.005, 10.0)
    assert not standstill.stands(10.1)
    standstill.on_velocity(0.0, 0.0, 10.25)
    assert standstill.stands(10.25)


def test_turning_is_not_standstill() -> None:
    standstill = Standstill()
    standstill.on_velocity(0.0, 0.0, 10.0)
    standstill.on_velocity(0.0, 0.05, 10.3)
    standstill.on_velocity(0.0, 0.0, 10.4)
    assert not standstill.stands(10.5)


def test_outdated_odometry_is_ignored() -> None:
    standstill = Standstill()
    standstill.on_velocity(0.0, 0.0, 10.0)
    standstill.on_velocity(0.0, 0.0, 10.5)
    assert standstill.stands(11.0)
    assert not standstill.known(11.6)
    assert not standstill.stands(11.6)


def drive(watch: MovementWatch, speed: float, omega: float, *, start: float, seconds: float) -> float:
    """Move a robot evenly; return the time at the end."""
    steps = round(seconds / 0.05)
    for step in range(1, steps + 1):
        watch.on_velocity(speed, omega, start + step * 0.05)
    return start + steps * 0.05


def test_a_robot_at_standstill_is_blocked_after_a_timeout_until_it_moves() -> None:
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


def test_without_odometry_the_poses_decide() -> None:
    watch = MovementWatch(10.0)
    watch.blocked(driving=True, now=0.0)
    watch.on_pose(Pose(1.0, 0.0, 0.0, "hall"), 5.0)
    watch.on_pose(Pose(1.02, 0.0, 0.0, "hall"), 9.0)
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


def recover(watch: MovementWatch, start: float, seconds: float, *, count: bool) -> float:
    """Make a robot spin, wait and back up as Nav2's recoveries do; return the time at the end."""
    now, recoveries = start, 0
    while now < start + seconds:
        for speed, omega, lasts in ((0.0, 1.0, 1.6), (0.0, 0.0, 5.0), (-0.15, 0.0, 2.0)):
            recoveries += 1
            if count:
                watch.on_recoveries(recoveries)
            now = drive(watch, speed, omega, start=now, seconds=lasts)
    return now


def test_recoveries_are_no_progress() -> None:
    watch = MovementWatch(10.0)
    watch.blocked(driving=True, now=0.0)
    now = recover(watch, 0.0, 12.0, count=True)
    assert watch.blocked(driving=True, now=now)
    now = drive(watch, 0.5, 0.0, start=now, seconds=2.0)
    assert not watch.blocked(driving=True, now=now)


def test_uncounted_recoveries_are_eventually_not_progress() -> None:
    watch = MovementWatch(10.0)
    watch.blocked(driving=True, now=0.0)
    now = recover(watch, 0.0, 45.0, count=False)
    assert watch.blocked(driving=True, now=now)


DISCHARGING = 2
CHARGING = 1


@pytest.mark.parametrize(("scale", "percentage"), [("fraction", 0.42), ("percent", 42.0)])
def test_charge_in_percent(scale: BatteryScale, percentage: float) -> None:
    report = Battery(scale).report(BatteryReading(percentage, 24.0, -3.0, DISCHARGING))
    assert report == BatteryReport(42.0, charging=False, voltage=24.0, current=-3.0)


def test_charge_that_was_not_measured_is_no_report() -> None:
    assert Battery("fraction").report(BatteryReading(math.nan, 24.0, 0.0, DISCHARGING)) is None


def test_unmeasured_values_are_omitted() -> None:
    report = Battery("fraction").report(BatteryReading(1.0, math.nan, math.nan, CHARGING))
    assert report == BatteryReport(100.0, charging=True, voltage=None, current=None)


@pytest.mark.parametrize(("percentage", "charge"), [(-0.1, 0.0), (1.02, 100.0)])
def test_charge_stays_between_empty_and_full(percentage: float, charge: float) -> None:
    report = Battery("fraction").report(BatteryReading(percentage, 24.0, 0.0, DISCHARGING))
    assert report is not None
    assert report.state_of_charge == charge


def test_percent_with_scale_fraction_is_reported_once_and_not_guessed() -> None:
    battery = Battery("fraction")
    with capture_logs() as lines:
        reports = [battery.report(BatteryReading(57.0, 24.0, 0.0, DISCHARGING)) for _ in range(3)]
    assert [line["log_level"] for line in lines] == ["warning"]
    assert "ros.battery_scale" in lines[0]["event"]
    assert reports[0] == BatteryReport(100.0, charging=False, voltage=24.0, current=0.0)


def test_percent_with_scale_percent_is_not_reported() -> None:
    with capture_logs() as lines:
        Battery("percent").report(BatteryReading(57.0, 24.0, 0.0, DISCHARGING))
    assert lines == []


@pytest.mark.parametrize(
    ("measured", "velocity"),
    [((0.03, -0.03), (0.0, 0.0)), ((0.031, 0.0), (0.031, 0.0)), ((-0.5, 0.02), (-0.5, 0.0))],
)
def test_odometry_noise_counts_as_standstill(
    measured: tuple[float, float], velocity: tuple[float, float]
) -> None:
    assert without_noise(measured, 0.03) == velocity


def test_a_robot_whose_odometry_drifts_at_rest_is_at_standstill() -> None:
    standstill = Standstill()
    for tick in range(5):
        standstill.on_velocity(*without_noise((0.02, -0.015), 0.03), 0.1 * tick)
    assert standstill.stands(0.4)
