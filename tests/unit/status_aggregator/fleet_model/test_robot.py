from __future__ import annotations

from datetime import timedelta

import pytest

from nena_shared.utc import iso
from nena_status_aggregator.fleet_model.condition import Condition
from nena_status_aggregator.fleet_model.instant import Instant
from nena_status_aggregator.fleet_model.robot import Robot
from support.fleet_briefs import state, visualization
from support.fleet_examples import ROBOT, START, connection, factsheet


def at(seconds: float) -> Instant:
    return Instant(1000 + seconds, START + timedelta(seconds=seconds))


def condition_of(robot: Robot, seconds: float) -> Condition:
    robot.judge(at(seconds), None, link_up=True)
    return robot.condition


def test_silence_begins_after_35_s_unless_the_robot_names_a_longer_interval() -> None:
    robot = Robot(ROBOT, at(0))
    assert robot.silence_limit(None) == 35
    robot.factsheet = factsheet(state_interval=5.0)
    assert robot.silence_limit(None) == 35
    robot.factsheet = factsheet(state_interval=30.0)
    assert robot.silence_limit(None) == 90
    assert robot.silence_limit(4.0) == 4


def test_silent_after_the_limit_and_back_with_the_next_state() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_state(state(), at(0), retained=False)
    assert condition_of(robot, 35) is Condition.IDLE
    assert condition_of(robot, 35.1) is Condition.SILENT
    assert robot.condition_since == at(35.1).utc
    robot.on_state(state(2), at(40), retained=False)
    assert condition_of(robot, 41) is Condition.IDLE


def test_falling_silent_is_told_once_per_silence() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_state(state(), at(0), retained=False)
    told = [robot.falls_silent(at(seconds), None) for seconds in (10, 36, 37)]
    robot.on_state(state(2), at(40), retained=False)
    told += [robot.falls_silent(at(seconds), None) for seconds in (41, 80)]
    assert told == [False, True, False, False, True]


def test_a_state_that_the_broker_kept_is_as_old_as_it_says() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_state(state(at=-100), at(0), retained=True)
    assert robot.age(at(5)) == pytest.approx(105)
    assert robot.skew.seconds is None
    assert condition_of(robot, 5) is Condition.SILENT


def test_the_will_breaks_and_the_next_state_after_coming_back_mends() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_connection(connection("ONLINE"), at(0))
    robot.on_state(state(), at(1), retained=False)
    robot.on_connection(connection("CONNECTION_BROKEN"), at(2))
    assert condition_of(robot, 2) is Condition.BROKEN
    assert robot.connection_since == at(2).utc
    robot.on_connection(connection("ONLINE", 2), at(9))
    assert condition_of(robot, 9) is Condition.IDLE


def test_the_kept_connection_heard_again_changes_nothing() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_connection(connection("ONLINE"), at(0))
    robot.on_connection(connection("ONLINE"), at(50))
    assert robot.connection_since == at(0).utc


def test_a_visualization_moves_the_robot_and_proves_no_state() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_state(state(), at(0), retained=False)
    robot.on_visualization(visualization(x=4.0))
    assert robot.position is not None
    assert robot.position.x == 4.0
    assert robot.age(at(10)) == 10


def test_times_are_written_with_milliseconds() -> None:
    assert iso(START) == "2026-01-01T00:00:00.000Z"
    assert iso(START + timedelta(microseconds=123_999)) == "2026-01-01T00:00:00.123Z"
