from __future__ import annotations

from typing import Any

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from nena_order_service.orders import order_sequence
from nena_order_service.orders.order_sequence import OrderSequence, SequenceEvent, SequenceRuleError
from nena_shared.fleet_api.transport_order import OrderSequenceRequest
from support.order_service import NOW, codes, request


def sequence(*orders: str, **fields: Any) -> OrderSequence:
    asked = OrderSequenceRequest.model_validate(fields)
    made = OrderSequence.created(asked, number=1, name="S", now=NOW)
    for order in orders:
        made = made.appended(order, NOW)
    return made


def test_runs_from_its_first_order_to_its_end() -> None:
    made = sequence("A", "B")
    assert (made.next_order, made.status.finished_index) == ("A", -1)
    assert made.status.reason == "waiting for a vehicle to start 'A', 1 of 2"
    made = made.bound("V-1", NOW)
    assert (made.bound_vehicle, made.status.reason) == ("V-1", "vehicle V-1 will execute 'A', 1 of 2")
    made = made.advanced({"A"}.__contains__, NOW)
    assert (made.next_order, made.status.finished_index) == ("B", 0)
    made = made.advanced({"A", "B"}.__contains__, NOW)
    assert (made.next_order, made.bound_vehicle, made.status.finished) == (None, "V-1", False)
    assert "waiting for orders" in made.status.reason
    made = made.completed("by a host", NOW)
    assert (made.status.finished, made.bound_vehicle, made.status.finished_time) == (True, None, NOW)
    assert codes(made) == [
        SequenceEvent.SEQUENCE_CREATED,
        SequenceEvent.ORDER_APPENDED,
        SequenceEvent.ORDER_APPENDED,
        SequenceEvent.PROCESSING_VEHICLE_CHANGED,
        SequenceEvent.SEQUENCE_COMPLETED,
        SequenceEvent.SEQUENCE_FINISHED,
    ]


def test_a_change_without_effect_creates_no_version() -> None:
    made = sequence("A").bound("V-1", NOW).completed("by a host", NOW)
    assert made.bound("V-1", NOW) is made
    assert made.completed("again", NOW) is made
    assert made.advanced({"B"}.__contains__, NOW) is made


@pytest.mark.parametrize(
    ("fields", "order", "said"),
    [
        ({}, {"type": "Transport", "intendedVehicle": None}, None),
        ({"orderTypes": ["A", "B"]}, {"type": "B"}, None),
        ({"orderTypes": ["A", "B"]}, {"type": "C"}, "no orders of type 'C', only 'A', 'B'"),
        ({"intendedVehicle": "V-1"}, {}, None),
        ({"intendedVehicle": "V-1"}, {"intendedVehicle": "V-1"}, None),
        (
            {"intendedVehicle": "V-1"},
            {"intendedVehicle": "V-2"},
            "for vehicle 'V-1', and the order is for 'V-2'",
        ),
        ({}, {"intendedVehicle": "V-2"}, "for any vehicle, and the order is for 'V-2'"),
    ],
)
def test_orders_that_do_not_fit_are_refused_with_a_reason(
    fields: dict[str, Any], order: dict[str, Any], said: str | None
) -> None:
    reasons = list(sequence(**fields).refusals(request("A", **order)))
    assert (reasons == []) if said is None else (len(reasons) == 1 and said in reasons[0])


def test_a_complete_or_full_sequence_takes_no_orders(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "complete" in next(sequence().completed("by a host", NOW).refusals(request("A")))
    monkeypatch.setattr(order_sequence, "ORDERS_LIMIT", 1)
    assert "already has 1 orders" in next(sequence("A").refusals(request("A")))


class SequenceLife(RuleBasedStateMachine):
    """Whatever comes, in whatever order: one vehicle, no way back, finished exactly when all is done."""

    @initialize(fatal=st.booleans())
    def create(self, *, fatal: bool) -> None:
        self.made = sequence(failureFatal=fatal)
        self.ended: set[str] = set()
        self.vehicles: set[str] = set()
        self.versions = [self.made.status.version]

    @rule()
    def append(self) -> None:
        name = f"T-{len(self.made.status.orders)}"
        if self.made.status.complete:
            with pytest.raises(SequenceRuleError):
                self.made.appended(name, NOW)
        else:
            self.put(self.made.appended(name, NOW))

    @rule(vehicle=st.sampled_from(["V-1", "V-2"]))
    def bind(self, vehicle: str) -> None:
        if self.made.status.finished or self.made.bound_vehicle not in (None, vehicle):
            with pytest.raises(SequenceRuleError):
                self.made.bound(vehicle, NOW)
        else:
            self.put(self.made.bound(vehicle, NOW))
            self.vehicles.add(vehicle)

    @rule()
    def complete(self) -> None:
        self.put(self.made.completed("by a host", NOW))

    @rule(index=st.integers(0, 5))
    def end(self, index: int) -> None:
        if index < len(self.made.status.orders):
            self.ended.add(self.made.status.orders[index])
        self.put(self.made.advanced(self.ended.__contains__, NOW))

    def put(self, changed: OrderSequence) -> None:
        assert changed.status.finished_index >= self.made.status.finished_index
        assert changed.status.orders[: len(self.made.status.orders)] == self.made.status.orders
        assert changed.status.version == self.made.status.version + (changed is not self.made)
        self.made = changed

    @invariant()
    def one_vehicle_at_most(self) -> None:
        assert len(self.vehicles) <= 1

    @invariant()
    def finished_exactly_when_all_is_done(self) -> None:
        status = self.made.status
        assert set(status.orders[: status.finished_index + 1]) <= self.ended
        assert self.made.next_order not in self.ended
        assert status.finished == (status.complete and self.ended >= set(status.orders))
        assert (status.finished_time is not None) == status.finished
        assert codes(self.made).count(SequenceEvent.SEQUENCE_FINISHED) == status.finished


TestSequenceLife = SequenceLife.TestCase
