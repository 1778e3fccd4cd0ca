from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.dispatching.candidates import OrderKind, WaitingOrders
from support.order_service import assigned_order, dispatchable_order

TYPES = "abcd"
VEHICLES = ("V1", "V2")


def test_the_oldest_order_is_the_first_created() -> None:
    assert WaitingOrders().oldest is None
    waiting = WaitingOrders()
    for number in (2, 1, 3):
        waiting.put(dispatchable_order(number=number, priority=number))
    assert waiting.oldest == 1
    waiting.put(assigned_order(number=1))
    assert waiting.oldest == 2


@given(
    orders=st.lists(
        st.tuples(st.sampled_from(TYPES), st.integers(-1, 1), st.sampled_from((None, *VEHICLES))), max_size=20
    ),
    assigned=st.sets(st.integers(0, 19)),
    moved=st.sets(st.integers(0, 19)),
    fitting=st.sets(st.sampled_from(TYPES)),
    limit=st.integers(0, 5),
    after=st.none() | st.integers(0, 19),
)
def test_the_most_urgent_orders_of_fitting_kinds_are_found(
    *,
    orders: list[tuple[str, int, str | None]],
    assigned: set[int],
    moved: set[int],
    fitting: set[str],
    limit: int,
    after: int | None,
) -> None:
    waiting, left = WaitingOrders(), []
    for number, (type_, priority, vehicle) in enumerate(orders):
        order = dispatchable_order(number=number, type=type_, priority=priority, intendedVehicle=vehicle)
        waiting.put(order)
        if number in moved:
            order = dispatchable_order(number=number, type=type_, priority=priority, intendedVehicle="V2")
            waiting.put(order)
        if number in assigned:
            waiting.put(assigned_order(number=number))
        else:
            left.append(order)
    end = next((each.urgency for each in left if each.number == after), None)

    def fits(kind: OrderKind) -> bool:
        return kind.type in fitting

    wanted = sorted(
        each.urgency
        for each in left
        if each.status.type in fitting
        and each.status.intended_vehicle in (None, "V2")
        and (end is None or each.urgency > end)
    )
    found = waiting.first(filter(fits, waiting.kinds(["V2"])), limit, end)
    assert found == [urgency[-1] for urgency in wanted[:limit]]


def test_no_more_kinds_are_read_than_are_needed() -> None:
    waiting = WaitingOrders()
    for number in range(100):
        waiting.put(dispatchable_order(number=number, type=f"type {number}"))
    read = []

    def fits(kind: OrderKind) -> bool:
        read.append(kind)
        return True

    assert waiting.first(filter(fits, waiting.kinds([])), 3) == [0, 1, 2]
    assert len(read) <= 4
