"""Spans of transport orders and VDA orders, from their changes and events."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import timedelta

import pytest

from nena_order_service.extensions.tracing import tracer
from nena_order_service.extensions.tracing.tracer import OrderTracer, order_spans
from nena_order_service.fleet.outputs import (
    FleetOutput,
    NodePassed,
    OperationStarted,
    PublishOrder,
    VdaOrderAccepted,
    VdaOrderCancelled,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.vda_order import VdaOrder
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.extensions.tracing import Span, TraceContext, order_span_id, trace_id_of, vda_order_span_id
from nena_shared.fleet_api.reasons import Reason
from nena_shared.vda5050.topics import RobotKey
from support.clocks import ManualClock
from support.order_service import NOW, assigned_order, dispatchable_order

ROBOT = RobotKey("ACME", "r1")
TRACEPARENT = f"00-{5:032x}-{6:016x}-01"


def later(seconds: float) -> timedelta:
    return timedelta(seconds=seconds)


@dataclass
class Traced:
    """A tracer that knows some orders, and its spans."""

    orders: Iterable[TransportOrder] = ()
    clock: ManualClock = field(default_factory=lambda: ManualClock(start=NOW))
    spans: list[Span] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Make the tracer."""
        self.tracer = OrderTracer(self._find, self.clock, self.spans.append)

    def _find(self, name: str) -> TransportOrder | None:
        return next((each for each in self.orders if each.name == name), None)

    def do(self, *events: FleetOutput) -> None:
        """Pass on events of fleet control, a second after the one before."""
        for event in events:
            self.clock.advance(1.0)
            if isinstance(event, PublishOrder):
                self.tracer.published(event)
            else:
                self.tracer.happened(event)


def sent(order_id: str, update_id: int = 0) -> PublishOrder:
    return PublishOrder(ROBOT, VdaOrder(order_id=order_id, nodes=(), edges=()), update_id)


def test_an_ended_order_is_told_by_its_history() -> None:
    order = assigned_order("A", "B", traceparent=TRACEPARENT)
    ended = order.drive_order_finished(0, NOW + later(3)).finished(NOW + later(9))
    whole, dispatch = order_spans(ended.status)

    assert (whole.trace_id, whole.span_id, whole.parent_id) == (
        trace_id_of("T-1"),
        order_span_id("T-1"),
        None,
    )
    assert (whole.begin, whole.end, whole.error) == (NOW, NOW + later(9), "")
    assert whole.link == TraceContext(5, 6)
    assert whole.attributes["nena.vehicle"] == "V-1"
    assert [each.name for each in whole.events] == [each.event_code for each in ended.status.history]
    assert (dispatch.name, dispatch.parent_id) == ("dispatch", whole.span_id)
    assert dispatch.attributes["nena.reason"] == "it is near"


def test_a_failed_order_says_why() -> None:
    ended = dispatchable_order().failed(Reason.of("no vehicle"), NOW)
    assert [each.error for each in order_spans(ended.status)] == ["no vehicle"]


def test_an_order_that_never_had_a_vehicle_shows_its_withdrawal() -> None:
    (whole,) = order_spans(dispatchable_order().withdrawn("not needed", NOW).status)
    assert ("nena:withdrawalRequested", {"nena.reason": "not needed"}) in [
        (each.name, each.attributes) for each in whole.events
    ]


def test_each_wait_for_a_vehicle_is_a_span() -> None:
    order = assigned_order("A", vehicle="V-1").reassigned(0, Reason.of("V-1 is broken"), NOW + later(5))
    again = order.assigned("V-2", [("A", "B")], Reason.of("it is free"), NOW + later(7)).finished(
        NOW + later(8)
    )
    _, first, second = order_spans(again.status)
    assert (second.begin, second.end) == (NOW + later(5), NOW + later(7))
    assert [each.attributes["nena.vehicle"] for each in (first, second)] == ["V-1", "V-2"]


def test_an_order_is_created_once_and_never_one_from_before_the_start() -> None:
    traced = Traced()
    order = dispatchable_order()
    traced.clock.advance(1.0)
    traced.tracer.order_changed(order.status)
    traced.tracer.order_changed(order.deferred(Reason.of("all are busy"), NOW).status)
    assert [(each.name, each.begin, each.end) for each in traced.spans] == [
        ("create order", NOW, NOW + later(1))
    ]

    restarted = Traced(clock=ManualClock(start=NOW + later(60)))
    restarted.tracer.order_changed(order.status)
    assert restarted.spans == []


def test_a_vda_order_is_planned_delivered_and_executed() -> None:
    traced = Traced([assigned_order()])
    traced.clock.advance(2.0)
    traced.tracer.begun("T-1-0", restored=False)
    traced.do(sent("T-1-0"), sent("T-1-0"), VdaOrderAccepted(ROBOT, "T-1-0"))
    traced.do(NodePassed(ROBOT, "T-1-0", "B", 2), OperationStarted(ROBOT, "T-1-0"), sent("T-1-0", 1))
    traced.do(VdaOrderAccepted(ROBOT, "T-1-0"), VdaOrderFinished(ROBOT, "T-1-0"))

    plan, deliver, whole = traced.spans
    assert [each.name for each in traced.spans] == ["plan", "deliver", "VDA 5050 order"]
    assert {each.trace_id for each in traced.spans} == {trace_id_of("T-1")}
    assert (plan.begin, plan.end, plan.parent_id) == (NOW, NOW + later(2), order_span_id("T-1"))
    assert (deliver.begin, deliver.end) == (NOW + later(3), NOW + later(5))
    assert deliver.parent_id == whole.span_id == vda_order_span_id("T-1-0")
    assert deliver.attributes["nena.messages"] == 2
    assert (whole.parent_id, whole.begin, whole.end) == (
        order_span_id("T-1"),
        NOW + later(2),
        NOW + later(10),
    )
    assert [each.name.split(".")[1] for each in whole.events] == [
        "orderSent",
        "orderSent",
        "orderAccepted",
        "nodePassed",
        "operationStarted",
        "orderSent",
        "orderAccepted",
    ]


@pytest.mark.parametrize(
    ("end", "outcome", "error"),
    [
        (VdaOrderCancelled(ROBOT, "T-1-0"), "cancelled", ""),
        (VdaOrderFailed(ROBOT, "T-1-0", Reason.of("it was refused")), "failed", "it was refused"),
    ],
)
def test_each_end_of_a_vda_order_is_told_once(end: FleetOutput, outcome: str, error: str) -> None:
    traced = Traced([assigned_order()])
    traced.tracer.begun("T-1-0", restored=True)
    traced.do(VdaOrderAccepted(ROBOT, "T-1-0"), end, end)
    (whole,) = traced.spans
    assert (whole.attributes["nena.outcome"], whole.error) == (outcome, error)
    assert whole.attributes["nena.restored"] is True


def test_an_order_that_makes_room_has_a_trace_of_its_own() -> None:
    traced = Traced()
    traced.tracer.begun("evasion-7f37e9cd", restored=False)
    traced.do(VdaOrderFinished(ROBOT, "evasion-7f37e9cd"))
    (whole,) = traced.spans
    assert (whole.trace_id, whole.parent_id) == (trace_id_of("evasion-7f37e9cd"), None)


def test_orders_whose_end_never_comes_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tracer, "RUNNING_LIMIT", 2)
    traced = Traced()
    for name in ("a-0", "b-0", "c-0"):
        traced.tracer.begun(name, restored=False)
    traced.do(*(VdaOrderFinished(ROBOT, each) for each in ("a-0", "b-0", "c-0")))
    assert [each.attributes["vda5050.order_id"] for each in traced.spans] == ["b-0", "c-0"]
