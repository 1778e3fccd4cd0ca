from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.kernel import order_book
from nena_order_service.kernel.order_book import OrderBook
from support.order_service import NOW, assigned_order, dispatchable_order


def test_order_is_visible_only_when_it_is_committed() -> None:
    book = OrderBook()
    order = dispatchable_order(idempotency_key="k")
    book.put(order)
    assert (book.named("T-1"), book.keyed("k")) == (order, order)
    assert book.visible_named("T-1") is None
    changes, told = book.take_changes()
    assert list(changes.orders) == [1]
    book.committed(told)
    assert book.visible_named("T-1") == order


def test_same_version_again_is_no_change() -> None:
    book = OrderBook()
    order = dispatchable_order()
    book.load(order)
    book.put(order)
    assert book.take_changes()[1] == []


def test_versions_in_a_row_of_the_same_state_are_told_by_the_last() -> None:
    book = OrderBook()
    order = dispatchable_order()
    deferred = order.deferred("nobody is free", NOW)
    assigned = deferred.assigned("V", [("A",)], "near", NOW)
    for version in (order, deferred, assigned):
        book.put(version)
    assert book.take_changes()[1] == [deferred, assigned]


def test_old_ended_orders_are_forgotten_and_living_ones_never(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(order_book, "RECENT_LIMIT", 2)
    book = OrderBook()
    book.put(dispatchable_order(number=1))
    for number in range(2, 6):
        book.put(assigned_order(number=number, idempotency_key=f"k{number}").finished(NOW))
        book.committed(book.take_changes()[1])
    assert [number for number in range(1, 6) if book.named(f"T-{number}")] == [1, 4, 5]
    assert book.keyed("k2") is None


@given(st.permutations(range(1, 7)), st.lists(st.integers(-2, 2), min_size=6, max_size=6))
def test_queue_is_in_the_order_of_urgency_and_holds_what_waits(
    numbers: list[int], priorities: list[int]
) -> None:
    book = OrderBook()
    orders = {
        number: dispatchable_order(number=number, priority=priorities[number - 1]) for number in numbers
    }
    for number in numbers:
        book.put(orders[number])
    for number in numbers[:2]:
        book.put(orders[number].failed("x", NOW))
    for number in numbers[2:]:
        orders[number] = orders[number].deferred("nobody is free", NOW)
        book.put(orders[number])
    waiting = [orders[number] for number in numbers[2:]]
    assert list(book.dispatchable()) == sorted(waiting, key=lambda order: order.urgency)
    assert book.orders_wait
