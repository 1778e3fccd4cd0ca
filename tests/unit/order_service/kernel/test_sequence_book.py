"""Sequences are told and shown as they are committed, in their order."""

from __future__ import annotations

from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.sequence_book import SequenceBook
from nena_order_service.kernel.steps import Steps
from nena_order_service.orders.order_sequence import OrderSequence
from nena_shared.fleet_api.transport_order import (
    OrderSequenceRequest,
    OrderSequenceStatus,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import VehicleStatus
from support.order_service import NOW
from support.scripted_fleet import MemoryStore


class Ear:
    def __init__(self) -> None:
        self.heard: list[tuple[str, int]] = []

    def order_changed(self, status: TransportOrderStatus) -> None:
        raise AssertionError(status)

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        self.heard.append((status.name, status.version))

    def vehicle_changed(self, status: VehicleStatus) -> None:
        raise AssertionError(status)


def made(number: int, key: str | None = None) -> OrderSequence:
    asked = OrderSequenceRequest(idempotency_key=key)
    return OrderSequence.created(asked, number=number, name=f"S-{number}", now=NOW)


def test_nothing_is_shown_or_told_before_it_is_committed() -> None:
    store, orders, ear = MemoryStore(), OrderBook(), Ear()
    steps = Steps(orders, store, lambda _: None)
    steps.listeners.append(ear)
    book = SequenceBook(orders, steps)
    store.held = True
    first = made(book.next_number(), "k")
    with steps.step():
        book.put(first)
        book.put(first)
    assert (book.named("S-1"), book.keyed("k"), book.visible("S-1")) == (first, first, None)
    store.release()
    assert (book.visible("S-1"), ear.heard) == (first, [("S-1", 1)])
    assert tuple(book.unfinished()) == (first,)

    with steps.step():
        bound = first.bound("V-1", NOW)
        book.put(bound)
    assert book.of_vehicle("V-1") is bound
    with steps.step():
        book.put(bound.completed("by a host", NOW))
    assert ear.heard == [("S-1", 1), ("S-1", 2), ("S-1", 3)]
    assert (book.named("S-1"), book.keyed("k"), book.visible("S-1")) == (None, None, None)
    assert book.of_vehicle("V-1") is None
    assert (book.next_number(), store.found.sequences) == (2, ())


def test_what_is_in_the_store_is_taken_in() -> None:
    orders = OrderBook()
    book = SequenceBook(orders, Steps(orders, MemoryStore(), lambda _: None))
    one = made(4).appended("T-1", NOW).bound("V-2", NOW)
    book.load([one], 7)
    assert (book.of_vehicle("V-2"), book.visible("S-4"), book.next_number()) == (one, one, 8)
    assert book.named(None) is None
    assert book.keyed(None) is None
