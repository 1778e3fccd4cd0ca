from __future__ import annotations

from datetime import timedelta

from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet_model.instant import Instant
from nena_status_aggregator.fleet_model.robot_register import RobotRegister
from support.fleet_examples import START

A, B, C = (RobotKey("ACME", name) for name in "abc")


def at(seconds: float) -> Instant:
    return Instant(seconds, START + timedelta(seconds=seconds))


def test_a_robot_is_met_once() -> None:
    register = RobotRegister(2, None)
    first, _ = register.meet(A, at(0))
    assert register.meet(A, at(1)) == (first, None)
    assert len(register) == 1


def test_a_newcomer_is_refused_while_all_are_alive() -> None:
    register = RobotRegister(2, None)
    register.meet(A, at(0))
    register.meet(B, at(0))
    assert register.meet(C, at(30)) == (None, None)
    assert [robot.key for robot in register] == [A, B]


def test_a_newcomer_takes_the_place_of_the_quietest() -> None:
    register = RobotRegister(2, None)
    register.meet(A, at(0))
    register.meet(B, at(0))
    register.meet(A, at(90))
    newcomer, gone = register.meet(C, at(100))
    assert newcomer is not None
    assert gone is not None
    assert gone.key == B
    assert [robot.key for robot in register] == [A, C]
