from __future__ import annotations

from pathlib import Path

import pytest
from sqlalchemy import create_engine, text

from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store.changes import Changes
from nena_order_service.store.database import (
    OrderFilter,
    StoreError,
    open_database,
    read_order,
    read_orders,
    read_unfinished,
    write,
)
from nena_shared.fleet_api.transport_order import TransportOrderState
from support.order_service import NOW, assigned_order, dispatchable_order


def changes(*versions: tuple[TransportOrder, TransportOrder | None]) -> Changes:
    made = Changes()
    for order, before in versions:
        made.put_order(order, before)
    return made


def test_order_comes_back_as_it_was(url: str) -> None:
    engine = open_database(url)
    order = assigned_order("A", "B", idempotency_key="k", deadline=NOW, priority=3)
    write(engine, changes((order, None)))
    assert read_order(engine, name=order.name) == order
    assert read_order(engine, idempotency_key="k") == order
    assert read_order(engine, name="other", idempotency_key="other") is None


def test_key_goes_before_name(url: str) -> None:
    engine = open_database(url)
    one, two = dispatchable_order(number=1, idempotency_key="k"), dispatchable_order(number=2)
    write(engine, changes((one, None), (two, None)))
    assert read_order(engine, name=two.name, idempotency_key="k") == one


def test_versions_of_one_commit_leave_the_last_with_its_whole_history(url: str) -> None:
    engine = open_database(url)
    first = dispatchable_order()
    second = first.deferred("nobody is free", NOW)
    third = second.deferred("all are offline", NOW)
    write(engine, changes((first, None), (second, first)))
    write(engine, changes((third, second)))
    assert read_order(engine, name=first.name) == third
    done = third.assigned("V-1", [("A",)], "near", NOW).finished(NOW)
    write(engine, changes((done, third)))
    assert read_order(engine, name=first.name) == done


def test_merged_changes_write_what_the_single_ones_would(url: str) -> None:
    engine = open_database(url)
    first = dispatchable_order()
    second = first.deferred("nobody is free", NOW)
    third = second.deferred("all are offline", NOW)
    both = changes((first, None))
    both.merge(changes((second, first)))
    both.merge(changes((third, second)))
    write(engine, both)
    assert read_order(engine, name=first.name) == third


def test_unfinished_are_orders_and_missions_that_a_restart_takes_up(url: str) -> None:
    engine = open_database(url)
    waiting = dispatchable_order(number=1)
    running = assigned_order(number=2)
    ended = assigned_order(number=7).finished(NOW)
    made = changes((waiting, None), (running, None), (ended, None))
    made.put_mission(2, "mission of 2")
    write(engine, made)
    found = read_unfinished(engine)
    assert found.orders == (waiting, running)
    assert found.missions == {2: "mission of 2"}
    assert found.last_number == 7


def test_mission_is_replaced_and_forgotten(url: str) -> None:
    engine = open_database(url)
    made = changes((assigned_order(number=2), None))
    made.put_mission(2, "first")
    write(engine, made)
    for document, expected in (("second", {2: "second"}), (None, {})):
        later = Changes()
        later.put_mission(2, document)
        write(engine, later)
        assert read_unfinished(engine).missions == expected


def test_pages_are_newest_first_and_go_on_behind_the_cursor(url: str) -> None:
    engine = open_database(url)
    write(engine, changes(*((dispatchable_order(number=n), None) for n in range(1, 6))))
    page = read_orders(engine, OrderFilter(limit=2))
    assert [order.number for order in page] == [5, 4]
    assert [order.number for order in read_orders(engine, OrderFilter(before=4))] == [3, 2, 1]


def test_filters_choose_by_state_and_intended_vehicle(url: str) -> None:
    engine = open_database(url)
    write(
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
    write(engine, changes((dispatchable_order(number=1), None)))
    with pytest.raises(Exception, match="UNIQUE"):
        write(
            engine,
            changes((dispatchable_order(number=2), None), (dispatchable_order(number=3, name="T-1"), None)),
        )
    assert [order.number for order in read_orders(engine, OrderFilter())] == [1]


def test_names_with_quotes_are_only_names(url: str) -> None:
    engine = open_database(url)
    order = dispatchable_order(intended_vehicle="' OR '1'='1")
    write(engine, changes((order, None), (dispatchable_order(number=2), None)))
    assert read_orders(engine, OrderFilter(intended_vehicle="' OR '1'='1")) == (order,)


def test_sqlite_is_durable(url: str) -> None:
    with open_database(url).connect() as connection:
        assert connection.execute(text("PRAGMA journal_mode")).scalar() == "wal"
        assert connection.execute(text("PRAGMA synchronous")).scalar() == 2


@pytest.mark.parametrize(
    "bad", ["sqlite:////no/such/folder/x.db", "nonsense", "mysql://user:secret@host/orders", "gibberish://x"]
)
def test_store_that_cannot_be_opened_is_one_line_without_secrets(bad: str) -> None:
    with pytest.raises(StoreError, match=r"store\.url cannot be used: .*sqlite:///orders\.db") as caught:
        open_database(bad)
    assert "secret" not in str(caught.value)


def test_store_of_another_version_is_refused(url: str) -> None:
    engine = open_database(url)
    with engine.begin() as connection:
        connection.execute(text("UPDATE schema_version SET version = 99"))
    with pytest.raises(StoreError, match="version 99"):
        open_database(url)


def test_file_that_is_no_database_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "orders.db"
    file.write_text("This is a letter, and no database at all." * 100)
    with pytest.raises(StoreError, match="not a database"):
        open_database(f"sqlite:///{file}")


def test_a_store_with_what_nobody_can_read_is_named_at_the_start(url: str) -> None:
    engine = open_database(url)
    write(engine, changes((dispatchable_order(), None)))
    with engine.begin() as connection:
        connection.execute(text("UPDATE transport_orders SET document = '{}'"))
    with pytest.raises(StoreError, match=r"store\.url cannot be read"):
        read_unfinished(engine)


def test_tables_of_another_program_are_named_at_the_start(url: str) -> None:
    with create_engine(url).begin() as connection:
        connection.execute(text("CREATE TABLE transport_orders (x INTEGER)"))
    with pytest.raises(StoreError, match=r"store\.url cannot be read.*no such column"):
        read_unfinished(open_database(url))
