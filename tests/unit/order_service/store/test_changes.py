"""What many steps have changed is committed as if it were one: nothing is lost, nothing is written twice."""

from __future__ import annotations

from nena_order_service.store.changes import ChangeNumbers, Changes
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
    assert numbers.published == 7
    assert [numbers.of("T-1", version) for version in versions[:2]] == [(8, False), (8, True)]
    assert numbers.published == 8
    assert numbers.of("T-2", dispatchable_order().status.version) == (9, True)
    assert numbers.of("T-1", versions[2]) == (10, True)
    assert numbers.published == 10


def test_unchanged_objects_have_no_change_number() -> None:
    numbers = ChangeNumbers()
    assert numbers.of("T-1", 3) == (0, False)
    numbers.give(changes((dispatchable_order(), None)))
    assert numbers.of("T-1", 99) == (0, False)
    assert numbers.published == 0


def test_nothing_is_nothing_and_anything_is_something() -> None:
    assert not Changes()
    for change in (
        Changes(missions={1: None}),
        Changes(vehicles={"r": lambda: "{}"}),
        Changes(path_locks={"p": False}),
        Changes(documents={("zoneSet", "z"): None}),
    ):
        assert change


def test_the_last_version_of_an_order_counts_and_it_stays_new() -> None:
    changes = Changes()
    first = dispatchable_order()
    second = first.deferred("no vehicle", NOW)
    changes.put_order(first, None)
    changes.put_order(second, first)

    (change,) = changes.orders.values()
    assert (change.order, change.new, change.unchanged_history) == (second, True, 0)


def test_history_that_is_stored_is_not_written_again() -> None:
    stored = dispatchable_order()
    later = stored.deferred("no vehicle", NOW)
    changes = Changes()
    changes.put_order(later, stored)

    (change,) = changes.orders.values()
    assert not change.new
    assert (
        later.status.history[: change.unchanged_history] == stored.status.history[: change.unchanged_history]
    )
    assert change.unchanged_history >= len(stored.status.history) - 1


def test_later_changes_replace_earlier_ones() -> None:
    stored = dispatchable_order()
    one = stored.deferred("no vehicle", NOW)
    two = one.deferred("no way", NOW)
    changes, later = (
        Changes(missions={1: lambda: "sent"}, path_locks={"p": True}),
        Changes(missions={1: None}),
    )
    changes.put_order(one, stored)
    later.put_order(two, one)

    changes.merge(later)

    (change,) = changes.orders.values()
    assert (change.order, change.new) == (two, False)
    assert change.unchanged_history <= len(stored.status.history)
    assert (changes.missions, changes.path_locks) == ({1: None}, {"p": True})


def test_each_orders_change_has_a_number_of_its_own() -> None:
    changes = Changes()
    for number in (3, 1, 2):
        changes.put_order(dispatchable_order(number=number), None)

    assert changes.numbered(10) == 13
    assert sorted(each.change_number for each in changes.orders.values()) == [11, 12, 13]
