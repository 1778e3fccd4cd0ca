from __future__ import annotations

import math

import pytest
from structlog.testing import capture_logs

from nena_edge_agent.driver.port import BatteryReport
from nena_edge_agent.ros.battery import Battery, BatteryReading, BatteryScale

DISCHARGING = 2
CHARGING = 1


@pytest.mark.parametrize(("scale", "percentage"), [("fraction", 0.42), ("percent", 42.0)])
def test_charge_in_percent(scale: BatteryScale, percentage: float) -> None:
    report = Battery(scale).report(BatteryReading(percentage, 24.0, -3.0, DISCHARGING))
    assert report == BatteryReport(42.0, charging=False, voltage=24.0, current=-3.0)


def test_charge_that_was_not_measured_is_no_report() -> None:
    assert Battery("fraction").report(BatteryReading(math.nan, 24.0, 0.0, DISCHARGING)) is None


def test_what_was_not_measured_is_left_out() -> None:
    report = Battery("fraction").report(BatteryReading(1.0, math.nan, math.nan, CHARGING))
    assert report == BatteryReport(100.0, charging=True, voltage=None, current=None)


@pytest.mark.parametrize(("percentage", "charge"), [(-0.1, 0.0), (1.02, 100.0)])
def test_charge_stays_between_empty_and_full(percentage: float, charge: float) -> None:
    report = Battery("fraction").report(BatteryReading(percentage, 24.0, 0.0, DISCHARGING))
    assert report is not None
    assert report.state_of_charge == charge


def test_percent_under_fraction_is_told_once_and_not_guessed() -> None:
    battery = Battery("fraction")
    with capture_logs() as lines:
        reports = [battery.report(BatteryReading(57.0, 24.0, 0.0, DISCHARGING)) for _ in range(3)]
    assert [line["log_level"] for line in lines] == ["warning"]
    assert "ros.battery_scale" in lines[0]["event"]
    assert reports[0] == BatteryReport(100.0, charging=False, voltage=24.0, current=0.0)


def test_percent_under_percent_is_nothing_to_tell() -> None:
    with capture_logs() as lines:
        Battery("percent").report(BatteryReading(57.0, 24.0, 0.0, DISCHARGING))
    assert lines == []
