from __future__ import annotations

from datetime import timedelta

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.orders.deadlines import FIRST_SWEEP, Deadlines, DueTimes
from support.order_service import NOW, dispatchable_order


def test_what_is_watched_of_orders_that_are_over_is_dropped_long_before_its_time() -> None:
    living: set[int] = set(range(100, 200))
    times = DueTimes(lambda number: number not in living)
    for number in range(20_000):
        times.watch(number, NOW + timedelta(days=1, seconds=number))
        assert len(times) <= max(FIRST_SWEEP, 2 * len(living))
    assert times.take(NOW + timedelta(days=1, seconds=150)) == list(range(100, 151))


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 9)), max_size=200))
def test_the_last_time_of_each_order_counts_and_once(watched: list[tuple[int, int]]) -> None:
    times = DueTimes(lambda _: False)
    for number, seconds in watched:
        times.watch(number, NOW + timedelta(seconds=seconds))
    last = dict(watched)
    for second in range(10):
        due = times.take(NOW + timedelta(seconds=second))
        assert sorted(due) == sorted(number for number, seconds in last.items() if seconds == second)
    assert len(times) == 0


def test_each_deadline_passes_once_and_in_time() -> None:
    deadlines = Deadlines(lambda _: False)
    for number, seconds in enumerate((3, 1, 2)):
        due = NOW + timedelta(seconds=seconds)
        deadlines.watch(dispatchable_order(number=number, deadline=due))
    deadlines.watch(dispatchable_order(number=9))
    assert deadlines.passed(NOW + timedelta(seconds=1)) == []
    assert deadlines.passed(NOW + timedelta(seconds=2.5)) == [1, 2]
    assert deadlines.passed(NOW + timedelta(seconds=9)) == [0]
    assert deadlines.passed(NOW + timedelta(days=9)) == []


def test_an_order_that_is_late_already_is_not_watched() -> None:
    deadlines = Deadlines(lambda _: False)
    deadlines.watch(dispatchable_order(deadline=NOW).overdue(NOW + timedelta(seconds=1)))
    assert deadlines.passed(NOW + timedelta(days=9)) == []
