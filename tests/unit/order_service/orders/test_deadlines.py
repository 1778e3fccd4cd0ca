from __future__ import annotations

from datetime import timedelta

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.orders.deadlines import FIRST_SWEEP, DueTimes, deadline_of
from support.order_service import NOW, dispatchable_order


def test_watched_times_of_ended_orders_are_dropped_early() -> None:
    living: set[int] = set(range(100, 200))
    times = DueTimes(lambda number: number not in living)
    for number in range(20_000):
        times.watch(number, NOW + timedelta(days=1, seconds=number))
        assert len(times) <= max(FIRST_SWEEP, 2 * len(living))
    assert times.take(NOW + timedelta(days=1, seconds=150)) == list(range(100, 151))


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 9)), max_size=200))
def test_the_latest_time_of_each_order_counts_once(watched: list[tuple[int, int]]) -> None:
    times = DueTimes(lambda _: False)
    for number, seconds in watched:
        times.watch(number, NOW + timedelta(seconds=seconds))
    last = dict(watched)
    for second in range(10):
        due = times.take(NOW + timedelta(seconds=second))
        assert sorted(due) == sorted(number for number, seconds in last.items() if seconds == second)
    assert len(times) == 0


def test_the_deadline_of_an_order_is_watched_until_it_is_late() -> None:
    order = dispatchable_order(deadline=NOW)
    assert deadline_of(order) == NOW
    assert deadline_of(order.overdue(NOW + timedelta(seconds=1))) is None
    assert deadline_of(dispatchable_order()) is None
