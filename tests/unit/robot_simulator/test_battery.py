from __future__ import annotations

import pytest

from nena_robot_simulator.battery import Battery


def make(charge: float = 1.0) -> Battery:
    return Battery(charge=charge, per_metre=0.001, per_second=0.0001)


def test_driving_and_time_take_their_share() -> None:
    battery = make()
    battery.drain(100.0, 50.0)
    assert battery.charge == pytest.approx(1.0 - 0.1 - 0.005)


def test_an_empty_battery_stays_empty() -> None:
    battery = make(0.01)
    battery.drain(1000.0, 1.0)
    assert battery.charge == 0.0


def test_both_scales_say_the_same() -> None:
    assert make(0.42).percentage("fraction") == pytest.approx(0.42)
    assert make(0.42).percentage("percent") == pytest.approx(42.0)


def test_driving_draws_more_current_and_the_voltage_falls_with_the_charge() -> None:
    battery = make()
    battery.drain(0.0, 1.0)
    resting, full = battery.current, battery.voltage
    battery.drain(100.0, 1.0)
    assert battery.current < resting < 0.0
    assert battery.voltage < full
