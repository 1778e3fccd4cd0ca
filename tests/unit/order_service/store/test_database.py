"""What is known of vehicles is replaced and read again."""

from __future__ import annotations

from datetime import timedelta
from functools import partial
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError

from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store.database import (
    Changes,
    DriveRow,
    OrderFilter,
    commit_changes,
    read_changes,
    read_documents,
    read_number_at,
    read_order,
    read_orders,
    read_path_locks,
    read_sequence,
    read_sequences,
    read_unfinished,
)
from nena_order_service.store.schema import StoreError, make_engine, open_database
from nena_shared.fleet_api.reasons import Reason
from nena_shared.fleet_api.requests import OrderSequencesQuery
from nena_shared.fleet_api.transport_order import OrderSequenceRequest, TransportOrderState
from support.order_service import NOW, assigned_order, dispatchable_order
from support.stores import changes


def test_documents_are_put_replaced_and_deleted(url: str) -> None:
    engine = open_database(url)
    for documents in (
        {("a", "one"): "1", ("a", "two"): "2", ("b", "one"): "3"},
        {("a", "one"): "4", ("a", "two"): None},
    ):
        changes = Changes()
        changes.merge(Changes(documents=dict(documents)))
        assert changes
        commit_changes(engine, changes)
    assert read_documents(engine, "a") == {"one": "4"}
    assert read_documents(engine, "b") == {"one": "3"}


def test_the_newest_document_of_each_robot_counts(url: str) -> None:
    engine = open_database(url)
    for place in ("at A", "at B"):
        made, later = Changes(), Changes()
        made.vehicles["NeNa/V1"] = lambda: "nowhere"
        later.vehicles["NeNa/V1"] = partial(str, place)
        later.vehicles["NeNa/V2"] = lambda: "at C"
        made.merge(later)
        assert made
        commit_changes(engine, made)
        assert read_unfinished(engine).vehicles == {"NeNa/V1": place, "NeNa/V2": "at C"}


def sequence(number: int, **fields: object) -> OrderSequence:
    asked = OrderSequenceRequest.model_validate(fields)
    return OrderSequence.created(asked, number=number, name=f"S-{number}", now=NOW)


def test_the_newest_version_of_each_sequence_counts(url: str) -> None:
    engine = open_database(url)
    first, second = sequence(1, idempotencyKey="k"), sequence(2, intendedVehicle="V-1", failureFatal=True)
    made, later = Changes(), Changes()
    made.sequences[first.number] = first
    made.sequences[second.number] = second
    grown = second.appended("T-1", NOW).bound("V-1", NOW)
    later.sequences[grown.number] = grown
    assert made
    made.merge(later)
    commit_changes(engine, made)
    found = read_unfinished(engine)
    assert (found.sequences, found.last_sequence) == ((first, grown), 2)

    ended, done = Changes(), first.completed("by a host", NOW)
    ended.sequences[done.number] = done
    commit_changes(engine, ended)
    found = read_unfinished(engine)
    assert (found.sequences, found.last_sequence) == ((grown,), 2)
    assert read_sequence(engine, name="S-1") == done
    assert read_sequence(engine, name="other", idempotency_key="k") == done
    assert read_sequence(engine, name="other") is None
    assert read_sequence(engine, name="S-1\0", idempotency_key="k\0") is None
    assert read_sequences(engine, OrderSequencesQuery(intended_vehicle="V-1\0")) == ()


def test_sequences_are_listed_newest_first_with_filters(url: str) -> None:
    engine = open_database(url)
    changes = Changes()
    for number in range(1, 5):
        one = sequence(number, intendedVehicle="V-1" if number > 2 else None)
        changes.sequences[number] = one.completed("by a host", NOW) if number == 4 else one
    commit_changes(engine, changes)

    def numbers(wanted: OrderSequencesQuery) -> list[int]:
        return [each.number for each in read_sequences(engine, wanted)]

    assert numbers(OrderSequencesQuery()) == [4, 3, 2, 1]
    assert numbers(OrderSequencesQuery(finished=True)) == [4]
    assert numbers(OrderSequencesQuery(finished=False, limit=2)) == [3, 2]
    assert numbers(OrderSequencesQuery(intended_vehicle="V-1")) == [4, 3]
    assert numbers(OrderSequencesQuery(after="3")) == [2, 1]


def test_sequences_are_found_by_time_of_creation(url: str) -> None:
    engine = open_database(url)
    changes = Changes()
    for number in range(1, 5):
        asked = OrderSequenceRequest.model_validate({})
        created = NOW + timedelta(minutes=number)
        changes.sequences[number] = OrderSequence.created(
            asked, number=number, name=f"S-{number}", now=created
        )
    commit_changes(engine, changes)

    def between(first: int, last: int) -> list[int]:
        since, until = (NOW + timedelta(minutes=each) for each in (first, last))
        return [each.number for each in read_sequences(engine, OrderSequencesQuery(since=since, until=until))]

    assert between(0, 9) == [4, 3, 2, 1]
    assert between(2, 4) == [3, 2]
    assert between(5, 9) == []
    since = OrderSequencesQuery(since=NOW + timedelta(minutes=2), after="4")
    assert [each.number for each in read_sequences(engine, since)] == [3, 2]


def test_order_round_trip_is_unchanged_and_its_key_goes_before_a_name(url: str) -> None:
    engine = open_database(url)
    order = assigned_order("A", "B", idempotency_key="k", deadline=NOW, priority=3)
    second = dispatchable_order(number=2)
    commit_changes(engine, changes((order, None), (second, None)))
    assert read_order(engine, name=second.name, idempotency_key="k") == order
    assert read_order(engine, name=order.name) == order
    assert read_order(engine, idempotency_key="k") == order
    assert read_order(engine, name="other", idempotency_key="other") is None


def test_the_last_version_of_a_commit_has_the_whole_history(url: str) -> None:
    engine = open_database(url)
    first = dispatchable_order()
    second = first.deferred(Reason.of("nobody is free"), NOW)
    third = second.deferred(Reason.of("all are offline"), NOW)
    commit_changes(engine, changes((first, None), (second, first)))
    commit_changes(engine, changes((third, second)))
    assert read_order(engine, name=first.name) == third
    done = third.assigned("V-1", [("A",)], Reason.of("near"), NOW).finished(NOW)
    commit_changes(engine, changes((done, third)))
    assert read_order(engine, name=first.name) == done


def test_merged_changes_write_what_the_single_ones_would(url: str) -> None:
    engine = open_database(url)
    first = dispatchable_order()
    second = first.deferred(Reason.of("nobody is free"), NOW)
    third = second.deferred(Reason.of("all are offline"), NOW)
    both = changes((first, None))
    both.merge(changes((second, first)))
    both.merge(changes((third, second)))
    commit_changes(engine, both)
    assert read_order(engine, name=first.name) == third


def test_unfinished_are_orders_and_drives_that_a_restart_takes_up(url: str) -> None:
    engine = open_database(url)
    waiting = dispatchable_order(number=1)
    running = assigned_order(number=2)
    ended = assigned_order(number=7).finished(NOW)
    made = changes((waiting, None), (running, None), (ended, None))
    made.drives["NeNa/V1"] = DriveRow(2, lambda: "sent for 2")
    made.drives["NeNa/V2"] = DriveRow(None, lambda: "makes room")
    commit_changes(engine, made)
    found = read_unfinished(engine)
    assert found.orders == (waiting, running)
    assert (found.drives, found.relocations) == ({2: "sent for 2"}, ("makes room",))
    assert found.last_number == 7


def test_stored_drive_is_replaced_and_deleted(url: str) -> None:
    engine = open_database(url)
    made = changes((assigned_order(number=2), None))
    made.drives["NeNa/V1"] = DriveRow(2, lambda: "first")
    commit_changes(engine, made)
    for drive, expected in ((DriveRow(2, lambda: "second"), {2: "second"}), (None, {})):
        later = Changes()
        later.drives["NeNa/V1"] = drive
        commit_changes(engine, later)
        assert read_unfinished(engine).drives == expected


def test_pages_are_newest_first_and_continue_after_the_cursor(url: str) -> None:
    engine = open_database(url)
    commit_changes(engine, changes(*((dispatchable_order(number=n), None) for n in range(1, 6))))
    page = read_orders(engine, OrderFilter(limit=2))
    assert [order.number for order in page] == [5, 4]
    assert [order.number for order in read_orders(engine, OrderFilter(before=4))] == [3, 2, 1]


def test_numbers_are_found_by_time_of_creation(url: str) -> None:
    engine = open_database(url)
    assert read_number_at(engine, NOW) == 0
    numbers = (3, 4, 7, 8, 20)  # the others were deleted
    orders = (
        TransportOrder(number, made.status.model_copy(update={"created": NOW + timedelta(minutes=number)}))
        for number in numbers
        for made in (dispatchable_order(number=number),)
    )
    commit_changes(engine, changes(*((order, None) for order in orders)))
    for minute in range(22):
        expected = min((each for each in numbers if each >= minute), default=21)
        assert read_number_at(engine, NOW + timedelta(minutes=minute)) == expected
    assert read_number_at(engine, NOW + timedelta(minutes=7, milliseconds=1)) == 8
    page = read_orders(engine, OrderFilter(first=4, before=20))
    assert [order.number for order in page] == [8, 7, 4]


def test_filters_choose_by_state_and_intended_vehicle(url: str) -> None:
    engine = open_database(url)
    commit_changes(
        engine,
        changes(
            (dispatchable_order(number=1, intended_vehicle="V-1"), None),
            (dispatchable_order(number=2), None),
            (assigned_order(number=3, intended_vehicle="V-1"), None),
        ),
    )
    chosen = OrderFilter(states=(TransportOrderState.DISPATCHABLE,), intended_vehicle="V-1")
    assert [order.number for order in read_orders(engine, chosen)] == [1]


def test_all_of_a_commit_or_nothing(url: str) -> None:
    engine = open_database(url)
    commit_changes(engine, changes((dispatchable_order(number=1), None)))
    with pytest.raises(IntegrityError):
        commit_changes(
            engine,
            changes((dispatchable_order(number=2), None), (dispatchable_order(number=3, name="T-1"), None)),
        )
    assert [order.number for order in read_orders(engine, OrderFilter())] == [1]


def test_names_with_quotes_or_nul_are_only_names(url: str) -> None:
    engine = open_database(url)
    order = dispatchable_order(intended_vehicle="' OR '1'='1")
    commit_changes(engine, changes((order, None), (dispatchable_order(number=2), None)))
    assert read_orders(engine, OrderFilter(intended_vehicle="' OR '1'='1")) == (order,)
    assert read_order(engine, name="T-1\0", idempotency_key="k\0") is None
    assert read_orders(engine, OrderFilter(intended_vehicle="V-1\0")) == ()


def test_file_that_is_no_database_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "orders.db"
    file.write_text("This is a letter, and no database at all." * 100)
    with pytest.raises(StoreError, match="not a database"):
        open_database(f"sqlite:///{file}")


def test_an_unreadable_store_is_reported_at_startup(url: str) -> None:
    engine = open_database(url)
    commit_changes(engine, changes((dispatchable_order(), None)))
    with engine.begin() as connection:
        connection.execute(text("UPDATE transport_orders SET document = '{}'"))
    with pytest.raises(StoreError, match=r"store\.url cannot be read"):
        read_unfinished(engine)


def test_foreign_tables_are_reported_at_startup(url: str) -> None:
    with make_engine(url).begin() as connection:
        connection.execute(text("CREATE TABLE transport_orders (x INTEGER)"))
    with pytest.raises(StoreError, match=r"store\.url cannot be used.*already exists"):
        open_database(url)


def test_changes_after_a_number_are_in_sequence_with_each_order_once(url: str) -> None:
    engine = open_database(url)
    one, two, three = (dispatchable_order(number=number) for number in (1, 2, 3))
    made = changes((one, None), (two, None), (three, None))
    assert made.number_orders(0) == 3
    commit_changes(engine, made)
    again = changes((one.failed(Reason.of("withdrawn"), NOW), one))
    assert again.number_orders(3) == 4
    commit_changes(engine, again)
    found = read_changes(engine, 1, 10)
    assert [(number, order.name, order.state) for number, order in found] == [
        (2, "T-2", "DISPATCHABLE"),
        (3, "T-3", "DISPATCHABLE"),
        (4, "T-1", "FAILED"),
    ]
    assert [number for number, _ in read_changes(engine, 1, 2)] == [2, 3]
    assert read_unfinished(engine).last_change == 4


def test_locks_of_paths_are_replaced_and_read_again(url: str) -> None:
    engine = open_database(url)
    for locked in (True, False):
        made = Changes()
        made.path_locks["A --- B"] = locked
        assert made
        commit_changes(engine, made)
        assert read_path_locks(engine) == {"A --- B": locked}


def test_nothing_is_nothing_and_anything_is_something() -> None:
    assert not Changes()
    for change in (
        Changes(drives={"r": None}),
        Changes(vehicles={"r": lambda: "{}"}),
        Changes(path_locks={"p": False}),
        Changes(documents={("zoneSet", "z"): None}),
    ):
        assert change


def test_history_that_is_stored_is_not_written_again() -> None:
    stored = dispatchable_order()
    later = stored.deferred(Reason.of("no vehicle"), NOW)
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
    one = stored.deferred(Reason.of("no vehicle"), NOW)
    two = one.deferred(Reason.of("no way"), NOW)
    changes, later = (
        Changes(drives={"r": DriveRow(1, lambda: "sent")}, path_locks={"p": True}),
        Changes(drives={"r": None}),
    )
    changes.put_order(one, stored)
    later.put_order(two, one)

    changes.merge(later)

    (change,) = changes.orders.values()
    assert (change.order, change.new) == (two, False)
    assert change.unchanged_history <= len(stored.status.history)
    assert (changes.drives, changes.path_locks) == ({"r": None}, {"p": True})


def test_each_orders_change_has_a_number_of_its_own() -> None:
    changes = Changes()
    for number in (3, 1, 2):
        changes.put_order(dispatchable_order(number=number), None)

    assert changes.number_orders(10) == 13
    assert sorted(each.change_number for each in changes.orders.values()) == [11, 12, 13]
