from __future__ import annotations

from nena_edge_agent.ros.standstill import Standstill


def test_knows_nothing_without_odometry() -> None:
    standstill = Standstill()
    assert not standstill.known(0.0)
    assert not standstill.stands(0.0)


def test_stands_after_a_while_of_standing() -> None:
    standstill = Standstill()
    standstill.on_velocity(0.005, -0.005, 10.0)
    assert not standstill.stands(10.1)
    standstill.on_velocity(0.0, 0.0, 10.25)
    assert standstill.stands(10.25)


def test_turning_is_no_standing() -> None:
    standstill = Standstill()
    standstill.on_velocity(0.0, 0.0, 10.0)
    standstill.on_velocity(0.0, 0.05, 10.3)
    standstill.on_velocity(0.0, 0.0, 10.4)
    assert not standstill.stands(10.5)


def test_odometry_that_fell_silent_says_nothing() -> None:
    standstill = Standstill()
    standstill.on_velocity(0.0, 0.0, 10.0)
    standstill.on_velocity(0.0, 0.0, 10.5)
    assert standstill.stands(11.0)
    assert not standstill.known(11.6)
    assert not standstill.stands(11.6)
