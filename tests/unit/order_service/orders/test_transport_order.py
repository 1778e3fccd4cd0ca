from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from nena_order_service.orders.transport_order import (
    SUCCESSORS,
    EventCode,
    IllegalTransitionError,
    TransportOrder,
    sortable_id,
)
from nena_shared.fleet_api.reasons import CodedReason, Reason, ReasonCode
from nena_shared.fleet_api.transport_order import (
    DriveOrderState,
    Hold,
    TransportOrderState,
    TransportOrderStatus,
)
from support.order_service import NOW, assigned_order, codes, dispatchable_order, raw_order, request

S = TransportOrderState
D = DriveOrderState


def drive_states(order: TransportOrder) -> list[DriveOrderState]:
    return [each.state for each in order.status.drive_orders]


def test_an_order_becomes_late_once() -> None:
    due, later = NOW + timedelta(seconds=1), NOW + timedelta(seconds=2)
    order = assigned_order("A", deadline=due).with_wait_reason(Reason.of("it waits for 'B'"))
    assert order.overdue(later).status.late
    assert order.overdue(later).status.reason == order.status.reason
    assert order.overdue(later).overdue(later).status.version == order.status.version + 1
    assert codes(order.overdue(later))[-1] == EventCode.DEADLINE_PASSED
    assert not order.failed(Reason.of("broken"), due).status.late
    ended = order.failed(Reason.of("broken"), later)
    assert ended.status.late
    assert ended.overdue(later) is ended


@pytest.mark.parametrize("field", [{"dispensable": True}, {"peripheralReservationToken": "door"}])
def test_an_order_keeps_the_request_and_recognises_it(field: dict[str, object]) -> None:
    asked = request("A", **field)
    order = TransportOrder.created(asked, number=1, name="T-1", now=NOW)
    assert field.items() <= order.status.model_dump(by_alias=True).items()
    assert order.was_created_by(asked)
    assert not order.was_created_by(request("A"))


def test_reasons_have_codes_in_status_and_history() -> None:
    order = assigned_order("A")
    assert order.status.coded_reason == order.reason.coded
    assert order.reason.coded.code == "travels"
    order = order.on_hold(Hold(by="Ann", reason="spill", since=NOW), NOW)
    assert order.reason.coded.code == "held"
    failed = order.failed(Reason(ReasonCode.VEHICLE_GONE, vehicle="V1"), NOW)
    gone = CodedReason(code="vehicle_gone", values={"vehicle": "V1"})
    assert failed.status.coded_reason == failed.status.history[-1].coded_reason == gone
    assert failed.status.reason == failed.status.history[-1].supplements[-1]


def test_an_order_stored_without_codes_keeps_its_text_until_it_changes() -> None:
    order = dispatchable_order("A").deferred(Reason(ReasonCode.NO_VEHICLES), NOW)
    document = order.status.model_dump(by_alias=True, mode="json", exclude={"coded_reason"})
    for entry in document["history"]:
        del entry["codedReason"]
    loaded = TransportOrder(1, TransportOrderStatus.model_validate(document))
    assert (loaded.status.coded_reason, loaded.reason) == (None, order.reason)
    assert loaded.deferred(Reason(ReasonCode.TAKES_NO_ORDERS), NOW).reason.coded.code == "takes_no_orders"


def test_goes_through_all_states_to_finished() -> None:
    order = assigned_order("A", "B")
    assert order.state is S.BEING_PROCESSED
    assert drive_states(order) == [D.TRAVELLING, D.PRISTINE]

    order = order.operating(0, NOW)
    assert drive_states(order) == [D.OPERATING, D.PRISTINE]
    order = order.drive_order_finished(0, NOW)
    assert drive_states(order) == [D.FINISHED, D.TRAVELLING]
    assert order.status.current_drive_order_index == 1
    order = order.drive_order_finished(1, NOW).finished(NOW)

    assert order.state is S.FINISHED
    assert drive_states(order) == [D.FINISHED, D.FINISHED]
    assert order.status.finished == NOW
    assert codes(order) == [
        EventCode.ORDER_CREATED,
        EventCode.ASSIGNED_TO_VEHICLE,
        EventCode.OPERATION_STARTED,
        EventCode.DRIVE_ORDER_FINISHED,
        EventCode.DRIVE_ORDER_FINISHED,
        EventCode.FINAL_STATE_REACHED,
    ]


def test_finished_ends_every_drive_order_even_without_events() -> None:
    assert drive_states(assigned_order("A", "B", "C").finished(NOW)) == [D.FINISHED] * 3


def test_failure_keeps_what_was_done_and_says_why() -> None:
    order = assigned_order("A", "B").drive_order_finished(0, NOW).failed(Reason.of("wheel lost"), NOW)
    assert drive_states(order) == [D.FINISHED, D.FAILED]
    assert order.status.reason == "wheel lost"
    assert order.status.history[-1].supplements == ("FAILED", "wheel lost")


def test_a_withdrawn_order_waits_for_its_vehicle_and_says_why() -> None:
    assert dispatchable_order().withdrawn("not needed", NOW).state is S.FAILED, "no vehicle has it"
    order = assigned_order("A", "B").withdrawn("not needed", NOW)
    waits = "not needed; waiting for robot V-1 to release it"
    assert (order.state, order.status.reason) == (S.WITHDRAWN, waits)
    assert order.operating(0, NOW).drive_order_finished(0, NOW).status.reason == waits
    silent = order.with_wait_reason(Reason.of("the robot is silent"))
    assert silent.status.reason == f"{waits}, but the robot is silent"
    assert silent.failed(Reason.of("let go"), NOW).state is S.FAILED


def test_consecutive_deferrals_are_one_history_entry() -> None:
    order = dispatchable_order().deferred(Reason.of("nobody is free"), NOW)
    assert order.deferred(Reason.of("nobody is free"), NOW + timedelta(hours=1)) is order
    order = order.deferred(Reason.of("all are offline"), NOW)
    assert codes(order) == [EventCode.ORDER_CREATED, EventCode.DISPATCHING_DEFERRED]
    assert order.status.history[-1].supplements == ("all are offline",)


def test_a_vehicles_wait_reason_is_published_once_while_it_applies() -> None:
    order = assigned_order("A", "B")
    waiting = order.with_wait_reason(Reason.of("the robot is paused"))
    assert waiting.status.reason == f"{order.status.reason}, but the robot is paused"
    assert waiting.status.version == order.status.version + 1
    assert waiting.with_wait_reason(Reason.of("the robot is paused")) is waiting
    assert waiting.with_wait_reason(None).status.reason == order.status.reason
    assert order.with_wait_reason(None) is order


def test_events_of_an_ended_drive_order_change_nothing() -> None:
    order = assigned_order("A", "B").drive_order_finished(0, NOW)
    assert order.drive_order_finished(0, NOW) is order
    assert order.operating(0, NOW) is order


@pytest.mark.parametrize(
    "change",
    [
        lambda order: order.deferred(Reason.of("x"), NOW),
        lambda order: order.finished(NOW),
        lambda order: order.failed(Reason.of("x"), NOW),
        lambda order: order.withdrawn("x", NOW),
        lambda order: order.adopted(NOW),
        lambda order: order.operating(0, NOW),
        lambda order: order.drive_order_finished(0, NOW),
    ],
)
def test_ended_orders_never_change(change: Callable[[TransportOrder], TransportOrder]) -> None:
    with pytest.raises(IllegalTransitionError, match="FINISHED"):
        change(assigned_order().finished(NOW))


def test_a_rerouting_is_recorded_with_its_reason() -> None:
    order = assigned_order("A", "B").rerouted(("A", "C"), Reason.of("a path was locked"), NOW)
    assert order.status.drive_orders[0].route == ("A", "C")
    assert order.status.drive_orders[1].route == ("A", "B")
    assert order.rerouted(None, Reason.of("forced"), NOW).status.drive_orders == order.status.drive_orders
    assert order.status.history[-1].event_code == EventCode.REROUTED
    assert order.status.history[-1].supplements == ("a path was locked",)


def test_priority_precedes_deadline_and_age() -> None:
    soon, later = NOW + timedelta(minutes=1), NOW + timedelta(minutes=9)
    orders = [
        dispatchable_order(number=1),
        dispatchable_order(number=2, deadline=later),
        dispatchable_order(number=3, deadline=soon),
        dispatchable_order(number=4, priority=1),
        dispatchable_order(number=5, deadline=soon),
    ]
    assert [order.number for order in sorted(orders, key=lambda order: order.urgency)] == [4, 3, 5, 2, 1]


def test_resources_to_avoid_are_read_from_the_property() -> None:
    order = raw_order(properties=[{"key": "tcs:resourcesToAvoid", "value": "Gate, A --- B ,"}])
    assert order.resources_to_avoid == {"Gate", "A --- B"}


@given(st.integers(-1000, 1000), st.integers(-1000, 1000))
def test_greater_priority_is_more_urgent(one: int, other: int) -> None:
    first, second = dispatchable_order(priority=one), dispatchable_order(priority=other)
    assert (first.urgency < second.urgency) == (one > other)


CHANGES = (
    "activated",
    "dispatchable",
    "unroutable",
    "deferred",
    "assigned",
    "operating",
    "drive_order_finished",
    "finished",
    "failed",
    "withdrawn",
    "adopted",
)


class LifeCycle(RuleBasedStateMachine):
    """Any sequence of requests: an order keeps its life cycle, or refuses and stays unchanged."""

    @initialize(stops=st.integers(1, 4))
    def create(self, stops: int) -> None:
        self.order = raw_order(*"ABCD"[:stops])
        self.before = self.order

    @rule(
        change=st.sampled_from(CHANGES),
        index=st.integers(0, 3),
        text=st.sampled_from(["a", "b"]).map(Reason.of),
    )
    def change(self, change: str, index: int, text: Reason) -> None:
        self.before = self.order
        index %= len(self.order.status.drive_orders)
        routes = [("A",) for _ in self.order.status.drive_orders]
        arguments = {
            "activated": (),
            "dispatchable": (),
            "assigned": ("V", routes, text, NOW),
            "operating": (index, NOW),
            "drive_order_finished": (index, NOW),
            "finished": (NOW,),
            "adopted": (NOW,),
        }.get(change, (text, NOW))
        try:
            self.order = getattr(self.order, change)(*arguments)
        except IllegalTransitionError:
            assert self.order is self.before

    @invariant()
    def states_follow_each_other(self) -> None:
        if self.order.state is not self.before.state:
            assert self.order.state in SUCCESSORS[self.before.state]

    @invariant()
    def versions_count_the_changes(self) -> None:
        changed = self.order is not self.before
        assert self.order.status.version == self.before.status.version + changed

    @invariant()
    def history_is_never_rewritten_but_for_a_deferral(self) -> None:
        old, new = self.before.status.history, self.order.status.history
        kept = old if old[-1].event_code != EventCode.DISPATCHING_DEFERRED else old[:-1]
        assert new[: len(kept)] == kept
        assert len(new) >= len(old)

    @invariant()
    def end_is_said_with_time_and_reason(self) -> None:
        assert (self.order.status.finished is not None) == self.order.state.final
        assert self.order.status.reason
        if self.order.state.final:
            assert self.order.status.history[-1].event_code == EventCode.FINAL_STATE_REACHED

    @invariant()
    @precondition(lambda self: self.order.state is S.BEING_PROCESSED)
    def at_most_one_drive_order_is_under_way(self) -> None:
        states = drive_states(self.order)
        assert sum(state in (D.TRAVELLING, D.OPERATING) for state in states) <= 1
        assert D.FINISHED not in states[self.order.status.current_drive_order_index + 1 :]


TestLifeCycle = LifeCycle.TestCase


def test_ids_have_one_length_and_are_unique() -> None:
    made = {sortable_id() for _ in range(100)}
    assert len(made) == 100
    assert {len(each) for each in made} == {22}


HOLD = Hold(by="Ann", reason="tea", since=NOW)


def test_an_order_whose_conditions_are_met_stays_held() -> None:
    held = raw_order().activated().on_hold(HOLD, NOW).dispatchable()

    assert (held.held, held.status.reason) == (True, "held by Ann since 2026-01-01 00:00:00 UTC: tea")
    assert codes(held)[-1] == EventCode.HELD
    assert held.status.history[-1].supplements == ("Ann", "tea")
    assert held.resumed("Bob", "go", NOW).status.reason == "waits for its turn"


def test_a_resumed_order_has_all_its_retries_again() -> None:
    order = assigned_order().retried(2, Reason.of("blocked"), now=NOW)
    assert order.current.measures_taken == 2

    order = order.on_hold(HOLD, NOW).resumed("Bob", "go", NOW)

    assert (order.held, order.current.measures_taken) == (False, 0)
    assert order.status.reason == "robot V-1 travels to destination 1 of 1"


def test_an_ended_order_cannot_be_held() -> None:
    with pytest.raises(IllegalTransitionError):
        assigned_order().failed(Reason.of("lost"), NOW).on_hold(HOLD, NOW)
    assert not assigned_order().on_hold(HOLD, NOW).failed(Reason.of("lost"), NOW).held
    assert not assigned_order().on_hold(HOLD, NOW).withdrawn("not wanted", NOW).held


def test_each_replan_avoids_more() -> None:
    order = assigned_order().replanned(1, Reason.of("blocked"), now=NOW, avoided=("A --- B", "B"))
    order = order.replanned(2, Reason.of("blocked"), now=NOW, avoided=("A --- C",))

    assert order.resources_to_avoid == {"A --- B", "B", "A --- C"}
    assert order.status.history[-1].supplements == ("blocked; avoids A --- C",)
