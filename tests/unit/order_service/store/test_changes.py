"""What many steps have changed is committed as if it were one: nothing is lost, nothing is written twice."""

from __future__ import annotations

from nena_order_service.store.changes import Changes
from support.order_service import NOW, dispatchable_order


def test_nothing_is_nothing_and_anything_is_something() -> None:
    assert not Changes()
    for change in (
        Changes(missions={1: None}),
        Changes(vehicles={"r": lambda: "{}"}),
        Changes(path_locks={"p": False}),
        Changes(documents={("zoneSet", "z"): None}),
    ):
        assert change


def test_of_an_order_the_last_version_counts_and_it_stays_new() -> None:
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


def test_later_changes_take_the_place_of_earlier_ones() -> None:
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
