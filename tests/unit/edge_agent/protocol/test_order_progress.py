"""Old order messages that come again, and new ones that only look old."""

from __future__ import annotations

from datetime import datetime, timedelta

import pytest

from nena_edge_agent.protocol.events import InstantActionsReceived, OrderReceived
from nena_edge_agent.protocol.order_progress import (
    ENDED_ORDERS_KEPT,
    BasePath,
    OrderHeader,
    OrderHistory,
)
from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.versions import RULES
from support.robot_core import HEADER, Bench, action, order, restarted

TIME: datetime = HEADER["timestamp"]
MUCH = timedelta(minutes=2)


def sent(number: int, header_id: int, timestamp: datetime = TIME) -> Order:
    """Make order number ``number``, to the node where the robot is."""
    made = order("n0", order_id=f"o{number}")
    return made.model_copy(update={"header_id": header_id, "timestamp": timestamp})


@pytest.mark.clause("6.1.4.4", "6.6/restart")
@pytest.mark.parametrize("version", RULES)
@pytest.mark.parametrize("killed", [False, True])
def test_an_ended_order_is_not_executed_again(version: str, *, killed: bool) -> None:
    bench = Bench(rules=RULES[version])
    bench.send(sent(1, 1))
    bench.send(sent(2, 2))
    bench = restarted(bench) if killed else bench

    bench.send(sent(1, 1))

    (error,) = bench.state.errors
    assert (error.error_type, error.error_level) == ("OUTDATED_ORDER_UPDATE", "WARNING")
    assert "order 'o1' was received before and has ended" in str(error.error_description)
    assert {each.reference_key: each.reference_value for each in error.error_references} == {
        "topic": "order",
        "headerId": "1",
        "orderId": "o1",
        "orderUpdateId": "0",
    }
    assert bench.state.order_id == "o2"


@pytest.mark.clause("6.1.4.4")
def test_an_ended_order_is_recognised_by_its_id_under_another_header() -> None:
    bench = Bench()
    bench.send(sent(1, 1))
    bench.send(sent(2, 2))

    bench.send(sent(1, 3, TIME + MUCH))

    assert bench.errors == ["OUTDATED_ORDER_UPDATE"]


@pytest.mark.parametrize(
    ("header_id", "timestamp"),
    [
        pytest.param(0, TIME + timedelta(seconds=1), id="counter starts again"),
        pytest.param(0, TIME - timedelta(days=9000), id="restarted without a clock"),
        pytest.param(101, TIME - MUCH, id="clock is set back"),
        pytest.param(100, TIME, id="header stays the same"),
    ],
)
def test_a_new_order_id_shows_a_new_order_whatever_its_header(header_id: int, timestamp: datetime) -> None:
    bench = Bench()
    bench.send(sent(1, 100))

    bench.send(sent(2, header_id, timestamp))

    assert (bench.state.order_id, bench.errors) == ("o2", [])


def test_a_header_id_that_wraps_around_is_not_a_replay() -> None:
    bench = Bench()
    bench.send(sent(1, 2**32 - 1))

    bench.send(sent(2, 0, TIME + timedelta(seconds=1)))

    assert bench.state.order_id == "o2"


@pytest.mark.clause("6.1.4.5", "6.1.2/B6")
def test_the_current_order_may_be_resent_and_updated() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", released=2))
    bench.send(order("n0", "n1", "n2", released=2))
    assert not bench.errors
    bench.arrive()

    bench.send(order("n1", "n2", update=1, first=2))

    assert (bench.state.order_update_id, bench.errors) == (1, [])
    bench.arrive()
    bench.send(order("n1", "n2", update=1, first=2))
    assert (bench.idle, bench.errors) == (True, [])


def test_a_refused_order_may_be_resent() -> None:
    bench = Bench()
    bench.send(order("n5", order_id="o2"))
    assert bench.errors == ["START_NODE_OUT_OF_RANGE"]

    bench.send(order("n0", order_id="o2"))

    assert (bench.state.order_id, bench.errors) == ("o2", [])


def of_epoch(epoch: int | None, message: Order) -> Order:
    return message.model_copy(update={"nena_epoch": epoch})


@pytest.mark.parametrize("killed", [False, True])
def test_orders_of_a_replaced_order_service_are_refused(*, killed: bool) -> None:
    bench = Bench()
    bench.send(of_epoch(7, sent(1, 100)))
    bench.send(of_epoch(8, sent(2, 0)))
    bench = restarted(bench) if killed else bench

    bench.send(of_epoch(7, sent(3, 101, TIME + MUCH)))

    assert bench.errors == ["OUTDATED_ORDER_UPDATE"]
    assert "of epoch 7, but an order service of epoch 8 has taken over" in str(
        bench.state.errors[0].error_description
    )
    assert bench.state.order_id == "o2"


def test_updates_of_a_replaced_order_service_are_refused() -> None:
    bench = Bench()
    bench.send(of_epoch(7, order("n0", "n1", "n2", released=2)))
    bench.send(of_epoch(8, order("n0", "n1", "n2", released=2)))
    assert not bench.errors

    bench.send(of_epoch(7, order("n1", "n2", update=1, first=2)))

    assert (bench.state.order_update_id, bench.errors) == (0, ["OUTDATED_ORDER_UPDATE"])


def test_a_replaced_order_service_cannot_cancel() -> None:
    bench = Bench()
    bench.send(of_epoch(8, order("n0", "n1")))
    cancel = InstantActions(**HEADER, nena_epoch=7, actions=(action("c", "HARD", "cancelOrder"),))

    bench.do(InstantActionsReceived(cancel))

    assert not bench.idle
    assert bench.errors == ["VALIDATION_FAILURE"]
    bench.do(InstantActionsReceived(cancel.model_copy(update={"nena_epoch": 9})))
    assert bench.core.memory().last_order_header == OrderHeader(header_id=-1, timestamp=TIME, epoch=9)


@pytest.mark.parametrize("epoch", [8, None])
def test_an_order_service_with_a_slow_clock_can_take_over(epoch: int | None) -> None:
    """Check that an epoch shows that it is no replay; without one the counter does, if it continues."""
    bench = Bench()
    bench.send(of_epoch(epoch and epoch - 1, sent(1, 100)))

    bench.send(of_epoch(epoch, sent(2, 0 if epoch else 101, TIME - timedelta(minutes=3))))

    assert (bench.state.order_id, bench.errors) == ("o2", [])


def test_within_an_epoch_the_header_id_reveals_a_replay() -> None:
    bench = Bench()
    bench.send(of_epoch(7, sent(1, 5)))

    bench.send(of_epoch(7, sent(2, 4, TIME + MUCH)))

    assert bench.errors == ["OUTDATED_ORDER_UPDATE"]


@pytest.mark.parametrize("far", [10**12, 2**53 - 1])
def test_an_epoch_far_in_the_future_does_not_lock_out_others(far: int) -> None:
    bench = Bench()
    now = int(TIME.timestamp())
    bench.do(OrderReceived(of_epoch(now, sent(1, 5)), utc=TIME))
    bench.do(OrderReceived(of_epoch(far, sent(2, 5000)), utc=TIME))
    assert bench.state.order_id == "o2"

    bench.do(OrderReceived(of_epoch(now, sent(3, 6)), utc=TIME))

    assert (bench.state.order_id, bench.errors) == ("o3", [])


def test_a_sender_without_epochs_and_timestamps_is_accepted_after_one_with_epochs() -> None:
    bench = Bench()
    bench.send(of_epoch(7, sent(1, 5000)))

    bench.do(OrderReceived(sent(2, 5), utc=TIME, dated=False))

    assert (bench.state.order_id, bench.errors) == ("o2", [])


def test_the_history_does_not_grow_with_the_length_of_order_ids() -> None:
    history = OrderHistory()
    for number in range(2 * ENDED_ORDERS_KEPT):
        history.end(f"{number}-{'x' * 10_000}")

    assert sum(map(len, history.ended)) == 32 * ENDED_ORDERS_KEPT


@pytest.mark.clause("6.6.2/path")
def test_the_planned_path_leads_over_the_nodes_of_the_base() -> None:
    nodes = order("n0", "n1", "n2", "n3", released=3).nodes

    path = BasePath(nodes[1:]).path(nodes[0], 2)

    assert path is not None
    assert [point.x for point in path.trajectory.control_points] == [0.0, 10.0, 20.0]
    assert path.trajectory.degree == 1
    assert path.trajectory.knot_vector == (0.0, 0.0, 0.5, 1.0, 1.0)
    assert path.traversed_nodes == ("n1", "n2")


@pytest.mark.clause("6.6.2/path")
def test_there_is_no_planned_path_without_a_base() -> None:
    nodes = order("n0", "n1", released=1).nodes

    assert BasePath(nodes[1:]).path(nodes[0], 2) is None
    assert BasePath().path(None, 0) is None


@pytest.mark.clause("6.6.2/path")
def test_the_planned_path_becomes_shorter_as_the_robot_drives() -> None:
    bench = Bench(rules=RULES["3.0.0"])
    bench.send(order("n0", "n1", "n2"))
    bench.arrive()

    path = bench.state.planned_path
    assert path is not None
    assert path.traversed_nodes == ("n2",)
    bench.arrive()
    assert bench.state.planned_path is None
