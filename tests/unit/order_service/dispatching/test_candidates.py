from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.dispatching.candidates import WaitingOrders, kind_of
from support.order_service import assigned_order, dispatchable_order


def test_the_oldest_order_is_the_first_created() -> None:
    assert WaitingOrders().oldest is None
    waiting = WaitingOrders()
    for number in (2, 1, 3):
        waiting.put(dispatchable_order(number=number, priority=number))
    assert waiting.oldest == 1
    waiting.put(assigned_order(number=1))
    assert waiting.oldest == 2


@given(
    orders=st.lists(st.tuples(st.integers(-1, 1), st.sampled_from((None, "V1"))), max_size=20),
    assigned=st.sets(st.integers(0, 19)),
    moved=st.sets(st.integers(0, 19)),
)
def test_orders_wait_by_urgency_until_they_are_assigned(
    *, orders: list[tuple[int, str | None]], assigned: set[int], moved: set[int]
) -> None:
    waiting, left = WaitingOrders(), []
    for number, (priority, vehicle) in enumerate(orders):
        order = dispatchable_order(number=number, priority=priority, intendedVehicle=vehicle)
        waiting.put(order)
        if number in moved:
            order = dispatchable_order(number=number, priority=priority, intendedVehicle="V2")
            waiting.put(order)
        if number in assigned:
            waiting.put(assigned_order(number=number))
        else:
            left.append(order)
    assert [*waiting] == [order.number for order in sorted(left, key=lambda order: order.urgency)]
    assert all(waiting.kind_of(order) == kind_of(order) for order in left)
