"""Whose turn it is in a sequence, and what its orders' ends mean for it."""

from __future__ import annotations

from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.sequence_book import SequenceBook
from nena_order_service.kernel.steps import Steps
from nena_order_service.orders.sequences import Sequences
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.clock import ManualClock
from nena_shared.fleet_api.transport_order import OrderSequenceRequest
from support.order_service import NOW, raw_order
from support.scripted_fleet import MemoryStore


class Desk:
    def __init__(self, **fields: bool | str) -> None:
        self.orders = OrderBook()
        self.steps = Steps(self.orders, MemoryStore(), lambda _: None)
        self.book = SequenceBook(self.orders, self.steps)
        self.sequences = Sequences(self.book, self.orders, self.steps, ManualClock())
        self.sequences.create(OrderSequenceRequest.model_validate(fields), "S")

    def add(self, number: int, *, dispensable: bool = False) -> TransportOrder:
        order = raw_order(number=number, wrappingSequence="S", dispensable=dispensable).activated()
        self.orders.put(order)
        self.sequences.append(order)
        return order

    def fail(self, order: TransportOrder) -> tuple[list[str], str | None]:
        ended = order.failed("broken", NOW)
        self.orders.put(ended)
        failed, following = self.sequences.ended(ended)
        return [each.name for each in failed], following


def test_one_order_at_a_time_has_its_turn() -> None:
    desk = Desk()
    first, second, third = (desk.add(number) for number in (1, 2, 3))
    assert desk.sequences.why_waiting(first) == ""
    assert desk.sequences.why_waiting(third).endswith("behind 'T-1'")
    assert desk.fail(second) == ([], "T-1")
    assert desk.fail(first) == ([], "T-3")
    assert desk.sequences.why_waiting(third) == ""
    assert desk.fail(third) == ([], None)


def test_a_fatal_failure_takes_all_behind_it_with_it() -> None:
    desk = Desk(failureFatal=True)
    first, light, last = desk.add(1), desk.add(2, dispensable=True), desk.add(3)
    assert desk.fail(light) == ([], "T-1")
    assert desk.fail(first) == (["T-3"], "T-3")
    assert desk.fail(last) == ([], None)
    assert desk.sequences.freed


def test_an_order_without_a_sequence_is_not_its_affair() -> None:
    desk = Desk(intendedVehicle="V-2")
    alone = raw_order()
    assert desk.sequences.ended(alone) == ((), None)
    assert desk.sequences.why_waiting(alone) == ""
    assert desk.sequences.misfit(alone, "V-1") == ""


def test_vehicles_are_bound_to_one_sequence_and_the_sequence_to_one_vehicle() -> None:
    desk = Desk(intendedVehicle="V-2")
    member, alone = desk.add(1), raw_order(number=9)
    assert "which is for 'V-2'" in desk.sequences.misfit(member, "V-1")
    assert desk.sequences.misfit(member, "V-2") == ""
    desk.sequences.bind(member, "V-2")
    assert desk.sequences.bound_to("V-2") == "S"
    assert desk.sequences.misfit(alone, "V-2") == "is bound to order sequence 'S'"
    assert desk.sequences.misfit(alone, "V-1") == ""
