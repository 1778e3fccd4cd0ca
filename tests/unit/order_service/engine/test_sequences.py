"""Whose turn it is in a sequence, and what its orders' ends mean for it."""

from __future__ import annotations

from nena_order_service.engine.conditions import Sequences
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.fleet_api.reasons import Reason
from nena_shared.fleet_api.transport_order import OrderSequenceRequest
from nena_shared.plant import PlantModel
from support.order_service import NOW, raw_order
from support.scripted_fleet import make_context


class Bench:
    def __init__(self, **fields: bool | str) -> None:
        context = make_context(PlantModel(name="empty"))
        self.orders = context.state.orders
        self.states = context.state.sequences
        self.sequences = Sequences(context)
        self.sequences.create(OrderSequenceRequest.model_validate(fields), "S")

    def add(self, number: int, *, dispensable: bool = False) -> TransportOrder:
        order = raw_order(number=number, wrappingSequence="S", dispensable=dispensable).activated()
        self.orders.put(order)
        self.sequences.append_order(order)
        return order

    def fail(self, order: TransportOrder) -> tuple[list[str], str | None]:
        ended = order.failed(Reason.of("broken"), NOW)
        self.orders.put(ended)
        failed, following = self.sequences.advance_after(ended)
        return [each.name for each in failed], following


def test_one_order_at_a_time_has_its_turn() -> None:
    bench = Bench()
    first, second, third = (bench.add(number) for number in (1, 2, 3))
    assert bench.sequences.why_waiting(first) is None
    assert str(bench.sequences.why_waiting(third)).endswith("after 'T-1'")
    assert bench.fail(second) == ([], "T-1")
    assert bench.fail(first) == ([], "T-3")
    assert bench.sequences.why_waiting(third) is None
    assert bench.fail(third) == ([], None)


def test_a_fatal_failure_fails_all_later_orders_of_the_sequence() -> None:
    bench = Bench(failureFatal=True)
    first, light, last = bench.add(1), bench.add(2, dispensable=True), bench.add(3)
    assert bench.fail(light) == ([], "T-1")
    assert bench.fail(first) == (["T-3"], "T-3")
    assert bench.fail(last) == ([], None)


def test_an_order_without_a_sequence_is_ignored() -> None:
    bench = Bench(intendedVehicle="V-2")
    alone = raw_order()
    assert bench.sequences.advance_after(alone) == ((), None)
    assert bench.sequences.why_waiting(alone) is None
    assert bench.sequences.why_unsuitable(alone, "V-1") is None


def test_vehicles_are_bound_to_one_sequence_and_the_sequence_to_one_vehicle() -> None:
    bench = Bench(intendedVehicle="V-2")
    member, alone = bench.add(1), raw_order(number=9)
    assert "which is 'V-2'" in str(bench.sequences.why_unsuitable(member, "V-1"))
    assert bench.sequences.why_unsuitable(member, "V-2") is None
    bench.sequences.bind_vehicle(member, "V-2")
    assert bench.sequences.bound_to("V-2") == "S"
    assert str(bench.sequences.why_unsuitable(alone, "V-2")) == "is bound to order sequence 'S'"
    assert bench.sequences.why_unsuitable(alone, "V-1") is None
