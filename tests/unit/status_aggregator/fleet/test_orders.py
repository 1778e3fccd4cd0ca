from __future__ import annotations

from datetime import timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_shared.fleet_api.transport_order import DriveOrderState, TransportOrderState
from nena_status_aggregator.fleet.orders import OrderRegistry, order_progress
from support.fleet_examples import START, drive_order, order_status

FINISHED = TransportOrderState.FINISHED


def names(book: OrderRegistry) -> set[str]:
    return {order.status.name for order in book}


def test_a_newer_version_replaces_an_older_one_and_not_the_other_way_round() -> None:
    book = OrderRegistry(10)
    assert book.apply_status(order_status(version=2))
    assert not book.apply_status(order_status(version=1))
    assert not book.apply_status(order_status(version=2))
    assert book.apply_status(order_status(version=3, state=FINISHED))
    assert [order.status.version for order in book] == [3]


def test_reused_name_is_a_new_order() -> None:
    book = OrderRegistry(10)
    book.apply_status(order_status(version=9, state=FINISHED))
    assert book.apply_status(order_status(version=1, created=START + timedelta(hours=1)))
    assert [order.status.version for order in book] == [1]


def test_an_ended_order_outlives_the_broker() -> None:
    book = OrderRegistry(10)
    book.apply_status(order_status(state=FINISHED))
    assert not book.remove_open("TO-1")
    assert names(book) == {"TO-1"}


def test_open_order_cleared_at_the_broker_is_removed() -> None:
    book = OrderRegistry(10)
    book.apply_status(order_status())
    assert book.remove_open("TO-1")
    assert names(book) == set()


def test_open_orders_are_unconfirmed_after_a_lost_connection() -> None:
    book = OrderRegistry(10)
    book.apply_status(order_status("living"))
    book.apply_status(order_status("ended", state=FINISHED))
    book.mark_unconfirmed()
    assert {order.status.name: order.confirmed for order in book} == {"living": False, "ended": True}
    assert book.apply_status(order_status("living"))
    assert all(order.confirmed for order in book)
    assert not book.apply_status(order_status("living"))


def test_limit_removes_the_order_that_ended_first() -> None:
    book = OrderRegistry(2)
    book.apply_status(order_status("old", state=FINISHED))
    book.apply_status(order_status("living"))
    book.apply_status(order_status("new", state=FINISHED))
    assert book.remove_excess() == ["old"]
    book.apply_status(order_status("another"))
    assert book.remove_excess() == ["new"]
    book.apply_status(order_status("third"))
    assert book.remove_excess() == ["living"]


def test_open_orders_have_a_limit_of_their_own() -> None:
    book = OrderRegistry(2, open_limit=4)
    book.apply_status(order_status("ended", state=FINISHED))
    for name in "abcd":
        book.apply_status(order_status(name))
    assert book.remove_excess() == ["ended"]
    assert (names(book), book.open_removed) == ({*"abcd"}, 0)
    book.apply_status(order_status("b", version=2))
    book.apply_status(order_status("e"))
    assert book.remove_excess() == ["a"]
    assert book.open_removed == 1


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from("abcdef"), st.integers(1, 5), st.sampled_from(TransportOrderState)))
)
def test_never_more_than_the_limit_and_never_one_twice(
    heard: list[tuple[str, int, TransportOrderState]],
) -> None:
    book = OrderRegistry(3)
    for name, version, state in heard:
        book.apply_status(order_status(name, version, state))
        book.remove_excess()
        kept = [order.status.name for order in book]
        assert len(kept) == len(set(kept)) <= 3


@pytest.mark.parametrize(
    ("last_node", "percent"), [(None, 0), ("A", 0), ("C", 22.5), ("E", 45), ("elsewhere", 0)]
)
def test_progress_on_the_way_to_the_first_of_two(last_node: str | None, percent: float) -> None:
    assert order_progress(order_status(), last_node) == percent


def test_progress_of_an_order_that_ended() -> None:
    assert order_progress(order_status(state=FINISHED), None) == 100
    assert order_progress(order_status(state=TransportOrderState.FAILED), None) is None


def test_progress_counts_destinations() -> None:
    done = drive_order("Goods in", "Load", DriveOrderState.FINISHED)
    operating = drive_order("Packing", "Unload", DriveOrderState.OPERATING, ("A", "B"))
    status = order_status(drive_orders=(done, operating), current_drive_order_index=1)
    assert order_progress(status, "B") == 95
