"""What is known of a robot's link."""

from __future__ import annotations

from typing import Any

import pytest

from nena_order_service.fleet import FleetSettings, LinkStatus
from nena_order_service.fleet.robot import Robot
from nena_shared.vda5050.connection import ConnectionState
from support.fleet_examples import ROBOT, connection, factsheet, state


@pytest.fixture
def robot() -> Robot:
    return Robot(ROBOT, FleetSettings())


def test_a_robot_that_was_never_heard_of_is_unknown(robot: Robot) -> None:
    assert robot.link(1e9) is LinkStatus.UNKNOWN
    assert not robot.reachable


@pytest.mark.clause("6.5/fleet")
@pytest.mark.parametrize("told", ["OFFLINE", "HIBERNATING", "CONNECTION_BROKEN"])
def test_a_robot_that_is_away_stays_so_and_is_not_called_silent(robot: Robot, told: str) -> None:
    robot.take_state(state(), 0.0)
    robot.take_connection(connection(told), 1.0)
    assert robot.link(1e9) is LinkStatus(told)
    assert not robot.reachable


@pytest.mark.clause("6.5/fleet")
def test_a_robot_whose_last_state_is_too_old_is_silent_without_any_will(robot: Robot) -> None:
    robot.take_connection(connection(), 0.0)
    robot.take_state(state(), 10.0)
    assert robot.link(45.0) is LinkStatus.ONLINE
    assert robot.link(45.1) is LinkStatus.SILENT
    assert robot.reachable, "only the robot itself or its will says that it is away"


@pytest.mark.clause("6.5/fleet")
def test_a_robot_that_is_online_and_never_reports_is_silent(robot: Robot) -> None:
    robot.take_connection(connection(), 0.0)
    assert robot.link(35.1) is LinkStatus.SILENT


def test_a_robot_that_reports_without_a_connection_message_is_online(robot: Robot) -> None:
    robot.take_state(state(), 0.0)
    assert robot.link(1.0) is LinkStatus.ONLINE


@pytest.mark.clause("7.10/interval")
@pytest.mark.parametrize(("interval", "silent_after"), [(1.0, 35.0), (30.0, 90.0), (None, 35.0)])
def test_the_usual_interval_of_the_robot_counts(
    robot: Robot, interval: float | None, silent_after: float
) -> None:
    robot.take_factsheet(factsheet(state_interval=interval))
    robot.take_state(state(), 0.0)
    assert robot.link(silent_after) is LinkStatus.ONLINE
    assert robot.link(silent_after + 0.1) is LinkStatus.SILENT


@pytest.mark.clause("6.5/fleet")
def test_a_state_after_a_will_shows_that_the_robot_is_there(robot: Robot) -> None:
    robot.take_state(state(1), 0.0)
    robot.take_connection(connection("CONNECTION_BROKEN"), 1.0)
    assert robot.take_state(state(2, at=2.0), 2.0)
    assert robot.link(2.0) is LinkStatus.ONLINE


@pytest.mark.clause("7.2/headerId")
def test_an_old_state_changes_nothing(robot: Robot) -> None:
    robot.take_state(state(5, at=5.0, order_id="new"), 5.0)
    assert not robot.take_state(state(4, at=4.0, order_id="old"), 6.0)
    assert robot.state is not None
    assert (robot.state.order_id, robot.state_at) == ("new", 5.0)


@pytest.mark.clause("7.2/headerId")
def test_a_repeated_state_is_no_sign_of_life(robot: Robot) -> None:
    robot.take_state(state(5), 0.0)
    assert not robot.take_state(state(5), 30.0)
    assert robot.link(40.0) is LinkStatus.SILENT


@pytest.mark.clause("6.5/fleet", "7.2/headerId")
def test_a_will_with_an_old_header_counts(robot: Robot) -> None:
    robot.take_connection(connection(number=7, at=100.0), 100.0)
    robot.take_connection(connection("CONNECTION_BROKEN", number=0, at=0.0), 101.0)
    assert robot.connection is ConnectionState.CONNECTION_BROKEN


def test_a_robot_with_a_lost_clock_is_believed_once_it_has_connected(robot: Robot) -> None:
    robot.take_state(state(500, at=500.0), 500.0)
    robot.take_connection(connection(), 501.0)
    fresh: dict[str, Any] = {"order_id": "x"}
    assert robot.take_state(state(0, at=0.0, **fresh), 502.0)
