from __future__ import annotations

from nena_order_service.store.change_numbers import ChangeNumbers
from support.order_service import NOW, dispatchable_order
from support.stores import changes


def test_each_change_has_the_next_number_and_all_versions_of_a_step_have_one() -> None:
    numbers = ChangeNumbers()
    numbers.begin(7)
    first = dispatchable_order()
    second = first.deferred("nobody is free", NOW)
    numbers.give(changes((second, None)))
    numbers.give(changes((dispatchable_order(number=2), None)))
    third = second.failed("withdrawn", NOW)
    numbers.give(changes((third, second)))
    assert numbers.last == 10
    versions = [order.status.version for order in (first, second, third)]
    assert numbers.told == 7
    assert [numbers.of("T-1", version) for version in versions[:2]] == [(8, False), (8, True)]
    assert numbers.told == 8
    assert numbers.of("T-2", dispatchable_order().status.version) == (9, True)
    assert numbers.of("T-1", versions[2]) == (10, True)
    assert numbers.told == 10


def test_what_was_not_changed_has_no_number() -> None:
    numbers = ChangeNumbers()
    assert numbers.of("T-1", 3) == (0, False)
    numbers.give(changes((dispatchable_order(), None)))
    assert numbers.of("T-1", 99) == (0, False)
    assert numbers.told == 0
