from __future__ import annotations

from datetime import timedelta

import pytest

from nena_order_service.orders import mending
from nena_order_service.orders.event_code import EventCode
from nena_order_service.orders.transport_order import IllegalTransitionError
from nena_shared.fleet_api.failure_policy import Hold
from nena_shared.fleet_api.transport_order import DriveOrderState, TransportOrderState
from support.order_service import NOW, assigned_order, dispatchable_order, raw_order

HOLD = Hold(by="Ann", reason="tea", since=NOW)


def test_who_holds_an_order_since_when_and_why_is_said() -> None:
    for order in (dispatchable_order(), assigned_order()):
        held = mending.held(order, HOLD, NOW)

        assert held.state is order.state
        assert held.status.reason == "held by Ann since 2026-01-01 00:00:00 UTC: tea"
        assert (held.status.history[-1].event_code, held.status.history[-1].supplements) == (
            EventCode.HELD,
            ("Ann", "tea"),
        )


def test_an_order_whose_conditions_come_true_stays_held() -> None:
    held = mending.held(raw_order().activated(), HOLD, NOW).dispatchable()

    assert (held.held, held.status.reason) == (True, "held by Ann since 2026-01-01 00:00:00 UTC: tea")
    assert mending.resumed(held, "Bob", "go", NOW).status.reason == "waits for its turn"


def test_a_resumed_order_has_all_its_tries_again() -> None:
    order = mending.retried(assigned_order(), 2, "blocked", now=NOW)
    assert order.current.measures_taken == 2

    order = mending.resumed(mending.held(order, HOLD, NOW), "Bob", "go", NOW)

    assert (order.held, order.current.measures_taken) == (False, 0)
    assert order.status.reason == "vehicle V-1 travels to destination 1 of 1"


def test_an_order_at_its_end_is_held_by_nobody() -> None:
    with pytest.raises(IllegalTransitionError):
        mending.held(assigned_order().failed("lost", NOW), HOLD, NOW)
    assert not mending.held(assigned_order(), HOLD, NOW).failed("lost", NOW).held
    assert not mending.held(assigned_order(), HOLD, NOW).withdrawn("not wanted", NOW).held


def test_what_failed_while_it_was_held_is_said_too() -> None:
    order = mending.failed_while_held(mending.held(assigned_order(), HOLD, NOW), "wheel lost")

    assert order.status.reason.endswith("tea; since then: wheel lost")


def test_another_vehicle_goes_on_where_the_first_one_came_to() -> None:
    order = assigned_order("A", "B", "C").drive_order_finished(0, NOW)
    order = mending.reassigned(order, 1, "wheel lost", NOW)

    assert (order.state, order.vehicle, order.index) == (TransportOrderState.DISPATCHABLE, None, 1)
    assert order.status.excluded_vehicles == ("V-1",)

    order = order.assigned("V-2", [("A", "B"), ("B", "C")], "it is near", NOW + timedelta(seconds=5))
    states = [each.state for each in order.status.drive_orders]
    assert states == [DriveOrderState.FINISHED, DriveOrderState.TRAVELLING, DriveOrderState.PRISTINE]
    assert order.status.assigned == NOW


def test_an_operation_that_is_left_out_counts_as_failed_in_an_order_that_is_done() -> None:
    order = mending.skipped(assigned_order("A:Load", "B"), "jammed", NOW).operating(1, NOW)
    order = order.drive_order_finished(1, NOW).finished(NOW)

    assert [each.state for each in order.status.drive_orders] == ["FAILED", "FINISHED"]
    assert order.status.reason == "done by vehicle V-1, operations left out: 1"


def test_another_way_avoids_more_each_time() -> None:
    order = mending.replanned(assigned_order(), 1, "blocked", now=NOW, avoided=("A --- B", "B"))
    order = mending.replanned(order, 2, "blocked", now=NOW, avoided=("A --- C",))

    assert order.resources_to_avoid == {"A --- B", "B", "A --- C"}
    assert order.status.history[-1].supplements == ("blocked; avoids A --- C",)


def test_a_pause_before_the_next_try_has_an_end() -> None:
    order = mending.retried(assigned_order(), 1, "blocked", now=NOW, next_try=NOW + timedelta(seconds=5))
    assert order.status.next_try == NOW + timedelta(seconds=5)
    assert mending.tried(mending.begun_again(order)).status.next_try is None
    assert mending.begun_again(order).current.attempts == 1
