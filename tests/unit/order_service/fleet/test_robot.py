"""What is known of a robot's link."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from nena_order_service.fleet.order_execution import read_progress
from nena_order_service.fleet.robot import LinkStatus, MessageOrder, Robot
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.vda5050.connection import ConnectionState
from support.fleet import make_vda_order
from support.fleet_examples import ROBOT, connection, factsheet, state


@pytest.fixture
def robot() -> Robot:
    return Robot(ROBOT, FleetSettings())


def test_a_robot_without_messages_is_unknown(robot: Robot) -> None:
    assert robot.link_status(1e9) is LinkStatus.UNKNOWN
    assert not robot.is_reachable


@pytest.mark.clause("6.5/fleet")
@pytest.mark.parametrize("told", ["OFFLINE", "HIBERNATING", "CONNECTION_BROKEN"])
def test_an_offline_robot_does_not_become_silent(robot: Robot, told: str) -> None:
    robot.take_state(state(), 0.0)
    robot.take_connection(connection(told), 1.0)
    assert robot.link_status(1e9) is LinkStatus(told)
    assert not robot.is_reachable


@pytest.mark.clause("6.5/fleet")
def test_a_robot_with_an_old_state_is_silent_even_without_a_will(robot: Robot) -> None:
    robot.take_connection(connection(), 0.0)
    robot.take_state(state(), 10.0)
    assert robot.link_status(45.0) is LinkStatus.ONLINE
    assert robot.link_status(45.1) is LinkStatus.SILENT
    assert robot.is_reachable, "only the robot itself or its will says that it is away"


@pytest.mark.clause("6.5/fleet")
def test_a_robot_that_is_online_and_never_reports_is_silent(robot: Robot) -> None:
    robot.take_connection(connection(), 0.0)
    assert robot.link_status(35.1) is LinkStatus.SILENT


def test_a_robot_that_reports_without_a_connection_message_is_online(robot: Robot) -> None:
    robot.take_state(state(), 0.0)
    assert robot.link_status(1.0) is LinkStatus.ONLINE


@pytest.mark.clause("7.10/interval")
@pytest.mark.parametrize(("interval", "silent_after"), [(1.0, 35.0), (30.0, 90.0), (None, 35.0)])
def test_the_usual_interval_of_the_robot_counts(
    robot: Robot, interval: float | None, silent_after: float
) -> None:
    robot.take_factsheet(factsheet(state_interval=interval))
    robot.take_state(state(), 0.0)
    assert robot.link_status(silent_after) is LinkStatus.ONLINE
    assert robot.link_status(silent_after + 0.1) is LinkStatus.SILENT


@pytest.mark.clause("6.5/fleet")
def test_a_state_after_a_will_means_online(robot: Robot) -> None:
    robot.take_state(state(1), 0.0)
    robot.take_connection(connection("CONNECTION_BROKEN"), 1.0)
    assert robot.take_state(state(2, at=2.0), 2.0)
    assert robot.link_status(2.0) is LinkStatus.ONLINE


@pytest.mark.clause("7.2/headerId")
def test_an_old_state_changes_nothing(robot: Robot) -> None:
    robot.take_state(state(5, at=5.0, order_id="new"), 5.0)
    assert not robot.take_state(state(4, at=4.0, order_id="old"), 6.0)
    assert robot.state is not None
    assert (robot.state.order_id, robot.state_at) == ("new", 5.0)


@pytest.mark.clause("7.2/headerId")
def test_a_repeated_state_does_not_prevent_silence(robot: Robot) -> None:
    robot.take_state(state(5), 0.0)
    assert not robot.take_state(state(5), 30.0)
    assert robot.link_status(40.0) is LinkStatus.SILENT


@pytest.mark.clause("6.5/fleet", "7.2/headerId")
def test_a_will_with_an_old_header_counts(robot: Robot) -> None:
    robot.take_connection(connection(number=7, at=100.0), 100.0)
    robot.take_connection(connection("CONNECTION_BROKEN", number=0, at=0.0), 101.0)
    assert robot.connection is ConnectionState.CONNECTION_BROKEN


def test_a_robot_with_a_wrong_clock_is_accepted_after_it_reconnects(robot: Robot) -> None:
    robot.take_state(state(500, at=500.0), 500.0)
    robot.take_connection(connection(), 501.0)
    fresh: dict[str, Any] = {"order_id": "x"}
    assert robot.take_state(state(0, at=0.0, **fresh), 502.0)


@pytest.mark.clause("6.5/fleet")
def test_a_periodic_online_message_is_not_a_new_connection(robot: Robot) -> None:
    robot.take_connection(connection(number=4, at=0.0), 0.0)
    robot.take_state(state(9, at=1.0), 1.0)
    assert not robot.take_connection(connection(number=5, at=2.0), 2.0)
    assert not robot.stale
    assert not robot.take_state(state(8, at=0.5), 2.5), "an old state stays old"


@pytest.mark.clause("6.5/fleet")
@pytest.mark.parametrize(("gone", "number"), [(False, 0), (True, 6)], ids=["restart", "after a will"])
def test_a_reconnected_robot_must_report_first(robot: Robot, *, gone: bool, number: int) -> None:
    robot.take_connection(connection(number=4, at=0.0), 0.0)
    robot.take_state(state(9, at=1.0), 1.0)
    if gone:
        robot.take_connection(connection("CONNECTION_BROKEN", number=4, at=0.0), 2.0)
    assert robot.take_connection(connection(number=number, at=3.0), 3.0)
    assert robot.stale


@pytest.mark.clause("7.2/headerId")
def test_an_old_state_behind_a_repeated_connection_message_changes_nothing(robot: Robot) -> None:
    robot.take_connection(connection(number=1, at=0.0), 0.0)
    robot.take_state(state(1, at=1.0), 1.0)
    robot.take_connection(connection(number=2, at=2.0), 2.0)
    robot.take_state(state(9, at=9.0, order_id="m"), 9.0)
    for number, seconds in ((1, 0.0), (2, 2.0)):
        robot.take_connection(connection(number=number, at=seconds), 10.0)
        assert not robot.take_state(state(1, at=1.0), 10.0)
    assert robot.state
    assert robot.state.order_id == "m"


START = datetime(2026, 1, 1, tzinfo=UTC)


def at(seconds: float) -> datetime:
    return START + timedelta(seconds=seconds)


def order_at(header_id: int, seconds: float) -> MessageOrder:
    order = MessageOrder()
    assert order.is_new(header_id, at(seconds), 0.0)
    return order


def test_rising_headers_are_new() -> None:
    order = order_at(5, 5)
    assert order.is_new(6, at(6), 0.0)
    assert order.is_new(7, at(6), 0.0), "several messages within a hundredth of a second"


@pytest.mark.clause("7.2/headerId")
def test_the_same_message_again_is_not_new_however_often() -> None:
    order = order_at(5, 5)
    assert [order.is_new(5, at(5), 0.0) for _ in range(10)] == [False] * 10


@pytest.mark.clause("7.2/headerId")
def test_an_overtaken_message_is_not_new() -> None:
    order = order_at(5, 5)
    assert not order.is_new(4, at(4), 0.0)
    assert order.is_new(6, at(6), 0.0)


@pytest.mark.clause("7.2/headerId")
def test_a_restart_at_zero_is_new_at_once() -> None:
    assert order_at(5000, 5).is_new(0, at(6), 0.0)


def test_a_clock_set_back_is_ignored_while_header_ids_increase() -> None:
    assert order_at(5, 5000).is_new(6, at(0), 0.0)


@pytest.mark.clause("7.2/headerId")
def test_the_counter_may_wrap_around() -> None:
    assert order_at(2**32 - 1, 5).is_new(0, at(6), 0.0)


@pytest.mark.clause("7.2/headerId")
def test_a_restart_with_a_wrong_clock_is_accepted_after_some_messages_and_seconds() -> None:
    order = order_at(5000, 5000)
    judged = [order.is_new(number, at(number), now=4.0 * number) for number in range(5)]
    assert judged == [False, False, False, True, True]


@pytest.mark.clause("7.2/headerId")
def test_a_clock_set_back_is_accepted_after_some_seconds_although_the_header_id_never_changes() -> None:
    order = order_at(1, 5000)
    judged = [order.is_new(1, at(number), now=4.0 * number) for number in range(5)]
    assert judged == [False, False, False, True, True]


def test_a_burst_of_old_messages_does_not_count_as_a_restart() -> None:
    order = order_at(5000, 5000)
    assert not any(order.is_new(number, at(number), now=9.0) for number in range(100))


def test_repeated_old_messages_do_not_count_as_a_restart() -> None:
    order = order_at(50, 50)
    assert not any(order.is_new(number, at(number), now=20.0 + number) for number in (3, 7, 9, 2, 4, 6))


def test_a_few_overtaken_messages_do_not_count_as_a_restart() -> None:
    order = order_at(50, 50)
    assert not order.is_new(48, at(48), 0.0)
    assert not order.is_new(47, at(47), 0.0)
    assert not order.is_new(48, at(48), 0.0)
    assert not order.is_new(46, at(46), 0.0)


@pytest.mark.clause("7.2/headerId")
def test_after_a_new_connection_any_message_is_new() -> None:
    order = order_at(5000, 5000)
    order.restart()
    assert order.is_new(0, at(0), 0.0)
    assert not order.is_new(0, at(0), 0.0)


MISSION = make_vda_order("m", "A", "B")


@pytest.mark.clause("6.6.2/first")
def test_a_robot_that_lists_its_first_node_has_not_passed_it() -> None:
    listed = [{"node_id": "A", "sequence_id": 0, "released": True}, *_to_b()]

    progress = read_progress(state(order_id="m", last_node_id="A", node_states=listed), MISSION)

    assert (progress.passed, progress.is_done) == (-1, False)


@pytest.mark.clause("6.6.2/first", "6.6.2/fleet")
def test_a_robot_that_does_not_list_it_stays_there() -> None:
    assert read_progress(state(order_id="m", last_node_id="A", node_states=_to_b()), MISSION).passed == 0


@pytest.mark.clause("6.6.2/fleet")
def test_a_sequence_id_of_the_previous_order_does_not_count() -> None:
    late = state(order_id="m", last_node_id="A", last_node_sequence_id=8, node_states=_to_b())

    assert read_progress(late, MISSION).passed < MISSION.last_sequence_id


def _to_b() -> list[dict[str, object]]:
    return [{"node_id": "B", "sequence_id": 2, "released": True}]


def test_an_order_is_not_finished_before_its_last_node_is_reached() -> None:
    vda_order = make_vda_order("m", "A", "B")
    empty: dict[str, Any] = {
        "node_states": (),
        "edge_states": (),
        "order_id": "m",
        "last_node_sequence_id": 2,
    }
    assert not read_progress(state(last_node_id="A", **empty), vda_order).is_done
    assert read_progress(state(last_node_id="B", **empty), vda_order).is_done
