from __future__ import annotations

from datetime import timedelta

from nena_order_service.kernel.deadlines import Deadlines
from support.order_service import NOW, dispatchable_order


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
