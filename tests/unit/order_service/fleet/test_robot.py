"""What is known of a robot's link."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from nena_order_service.fleet.order_execution import read_progress
from nena_order_service.fleet.robot import LinkStatus, MessageOrder, Robot
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.state import State
from support.fleet import make_vda_order
from support.fleet_examples import ROBOT, connection, factsheet, state


@pytest.fixture
def robot() -> Robot:
    return Robot(ROBOT, FleetSettings())


OLD_WILL = connection("CONNECTION_BROKEN", number=0, at=0.0)


@pytest.mark.clause("6.5/fleet", "7.2/headerId")
@pytest.mark.parametrize(
    ("messages", "now", "link", "reachable"),
    [
        pytest.param([], 1e9, "UNKNOWN", False, id="no message"),
        *(
            pytest.param([(state(), 0.0), (connection(told), 1.0)], 1e9, told, False, id=told)
            for told in ("OFFLINE", "HIBERNATING", "CONNECTION_BROKEN")
        ),
        pytest.param([(connection(), 0.0), (state(), 10.0)], 45.0, "ONLINE", True, id="a late state"),
        # Only the robot itself or its will says that it is away.
        pytest.param([(connection(), 0.0), (state(), 10.0)], 45.1, "SILENT", True, id="an old state"),
        pytest.param([(connection(), 0.0)], 35.1, "SILENT", True, id="never a state"),
        pytest.param([(state(), 0.0)], 1.0, "ONLINE", True, id="no connection message"),
        pytest.param(
            [(state(1), 0.0), (connection("CONNECTION_BROKEN"), 1.0), (state(2, at=2.0), 2.0)],
            2.0,
            "ONLINE",
            True,
            id="a state after a will",
        ),
        pytest.param([(state(5), 0.0), (state(5), 30.0)], 40.0, "SILENT", True, id="a repeated state"),
        pytest.param(
            [(connection(number=7, at=100.0), 100.0), (OLD_WILL, 101.0)],
            101.0,
            "CONNECTION_BROKEN",
            False,
            id="a will with an old header",
        ),
    ],
)
def test_the_link_of_a_robot(
    robot: Robot,
    messages: list[tuple[State | Connection, float]],
    now: float,
    link: str,
    *,
    reachable: bool,
) -> None:
    for message, at in messages:
        if isinstance(message, State):
            robot.take_state(message, at)
        else:
            robot.take_connection(message, at)
    assert (robot.link_status(now), robot.is_reachable) == (LinkStatus(link), reachable)


@pytest.mark.clause("7.10/interval")
@pytest.mark.parametrize(
    ("interval", "silent_after"), [(1.0, 35.0), (30.0, 90.0), (None, 35.0), (30_000.0, 90.0)]
)
def test_the_usual_interval_of_the_robot_counts(
    robot: Robot, interval: float | None, silent_after: float
) -> None:
    robot.take_factsheet(factsheet(state_interval=interval))
    robot.take_state(state(), 0.0)
    assert robot.link_status(silent_after) is LinkStatus.ONLINE
    assert robot.link_status(silent_after + 0.1) is LinkStatus.SILENT


@pytest.mark.clause("7.2/headerId")
def test_an_old_state_changes_nothing(robot: Robot) -> None:
    robot.take_state(state(5, at=5.0, order_id="new"), 5.0)
    assert not robot.take_state(state(4, at=4.0, order_id="old"), 6.0)
    assert robot.state is not None
    assert (robot.state.order_id, robot.state_at) == ("new", 5.0)


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


@pytest.mark.clause("7.2/headerId")
@pytest.mark.parametrize(
    ("first", "later", "new"),
    [
        pytest.param((5, 5), [(6, 6), (7, 6)], [True] * 2, id="several within a hundredth of a second"),
        pytest.param((5, 5), [(5, 5)] * 10, [False] * 10, id="the same message again, however often"),
        pytest.param((5, 5), [(4, 4), (6, 6)], [False, True], id="an overtaken message"),
        pytest.param((50, 50), [(48, 48), (47, 47), (48, 48), (46, 46)], [False] * 4, id="a few of them"),
        pytest.param((5000, 5), [(0, 6)], [True], id="a restart at zero"),
        pytest.param((5, 5000), [(6, 0)], [True], id="a clock set back while header IDs increase"),
        pytest.param((2**32 - 1, 5), [(0, 6)], [True], id="the counter wraps around"),
        pytest.param((5000, 5000), [(n, n) for n in range(100)], [False] * 100, id="a burst of old ones"),
    ],
)
def test_which_messages_are_new(
    first: tuple[int, int], later: list[tuple[int, int]], new: list[bool]
) -> None:
    order = MessageOrder()
    assert order.is_new(first[0], at(first[1]), 0.0)
    assert [order.is_new(number, at(seconds), 9.0) for number, seconds in later] == new


@pytest.mark.clause("7.2/headerId")
@pytest.mark.parametrize(
    ("first", "numbers", "new"),
    [
        pytest.param(5000, range(5), [False, False, False, True, True], id="a restart with a wrong clock"),
        pytest.param(1, [1] * 5, [False, False, False, True, True], id="a clock set back, one header ID"),
        pytest.param(5000, (3, 7, 9, 2, 4, 6), [False] * 6, id="old messages in no order"),
    ],
)
def test_old_messages_are_accepted_after_some_messages_and_seconds(
    first: int, numbers: Sequence[int], new: list[bool]
) -> None:
    order = MessageOrder()
    assert order.is_new(first, at(5000), 0.0)
    rising = sorted(numbers) == list(numbers)
    times = range(len(numbers)) if rising else numbers
    assert [
        order.is_new(number, at(seconds), now=4.0 * step)
        for step, (number, seconds) in enumerate(zip(numbers, times, strict=True))
    ] == new


@pytest.mark.clause("7.2/headerId")
def test_after_a_new_connection_any_message_is_new() -> None:
    order = MessageOrder()
    assert order.is_new(5000, at(5000), 0.0)
    order.restart()
    assert order.is_new(0, at(0), 0.0)
    assert not order.is_new(0, at(0), 0.0)


MISSION = make_vda_order("m", "A", "B")


TO_B = ({"node_id": "B", "sequence_id": 2, "released": True},)
FROM_A = ({"node_id": "A", "sequence_id": 0, "released": True}, *TO_B)


@pytest.mark.clause("6.6.2/first", "6.6.2/fleet")
@pytest.mark.parametrize(
    ("fields", "passed", "done"),
    [
        pytest.param({"last_node_id": "A", "node_states": FROM_A}, -1, False, id="lists the first node"),
        pytest.param({"last_node_id": "A", "node_states": TO_B}, 0, False, id="does not list it"),
        pytest.param(
            {"last_node_id": "A", "last_node_sequence_id": 8, "node_states": TO_B},
            1,
            False,
            id="a sequenceId of the previous order",
        ),
        pytest.param({"last_node_id": "A", "last_node_sequence_id": 2}, None, False, id="another last node"),
        pytest.param({"last_node_id": "B", "last_node_sequence_id": 2}, 2, True, id="done"),
    ],
)
def test_the_progress_of_an_order(fields: dict[str, Any], passed: int | None, *, done: bool) -> None:
    progress = read_progress(state(order_id="m", **fields), MISSION)

    assert progress.is_done is done
    assert passed in (None, progress.passed)
