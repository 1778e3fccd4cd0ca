"""Stores of older releases are brought up to date with all that is in them."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Connection, MetaData, inspect, text
from sqlalchemy.exc import DBAPIError, SQLAlchemyError

from nena_order_service.orders.drive import Drive
from nena_order_service.store import schema
from nena_order_service.store.database import (
    OrderFilter,
    commit_changes,
    read_changes,
    read_order,
    read_orders,
    read_unfinished,
)
from nena_order_service.store.schema import (
    StoreError,
    is_shared,
    make_engine,
    migrate,
    open_database,
    reason_of,
    unusable,
)
from support.order_service import dispatchable_order
from support.stores import STORES, changes, older_store


def test_sqlite_is_durable(sqlite_url: str) -> None:
    with open_database(sqlite_url).connect() as connection:
        assert connection.execute(text("PRAGMA journal_mode")).scalar() == "wal"
        assert connection.execute(text("PRAGMA synchronous")).scalar() == 2


def test_schema_changes_are_rolled_back_too(url: str) -> None:
    engine = make_engine(url)
    with engine.connect() as connection:
        connection.execute(text("CREATE TABLE half_done (x INTEGER)"))
        connection.rollback()
        with pytest.raises(DBAPIError, match="half_done"):
            connection.execute(text("SELECT * FROM half_done"))


@pytest.mark.parametrize(
    "bad",
    [
        "sqlite:////no/such/folder/x.db",
        "nonsense",
        "mysql://user:secret@host/orders",
        "gibberish://x",
        "postgresql://user:secret@127.0.0.1:1/orders",
        "postgresql://user:an@secret@127.0.0.1:1/orders",
        "postgresql://user:an@other:secret@127.0.0.1:1/orders",
        "postgresql://user@127.0.0.1:secret/orders",
    ],
)
def test_unusable_store_is_reported_in_one_line_without_secrets(bad: str) -> None:
    with pytest.raises(StoreError, match=r"store\.url cannot be used: .*sqlite:///orders\.db") as caught:
        open_database(bad)
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "reason",
    [
        "database or disk is full",
        "disk I/O error",
        'could not extend file "base/1": No space left on device',
    ],
)
def test_a_store_error_asks_to_check_the_disk(reason: str) -> None:
    assert str(unusable(reason)) == (f"store.url cannot be used: {reason}. Check the disk and its free space")


def test_any_name_of_postgresql_means_the_one_driver() -> None:
    for name in ("postgresql", "postgresql+psycopg", "postgresql+asyncpg"):
        assert make_engine(f"{name}://host/orders").dialect.driver == "psycopg"
    assert is_shared("postgresql://host/orders")
    assert not is_shared("sqlite:///orders.db")


def test_reason_is_the_databases_message_in_one_line(url: str) -> None:
    with pytest.raises(DBAPIError) as caught, make_engine(url).connect() as connection:
        connection.execute(text("SELECT * FROM nothing"))
    assert "nothing" in reason_of(caught.value)
    assert "\n" not in reason_of(caught.value)


def described(connection: Connection) -> dict[str, Any]:
    """Return the tables of a store, as the database describes them."""
    names = [*schema.metadata.tables, schema.VERSION_TABLE]
    look = inspect(connection)
    return {
        name: (
            [(column["name"], str(column["type"]), column["nullable"]) for column in look.get_columns(name)],
            look.get_pk_constraint(name),
            sorted(map(str, look.get_foreign_keys(name))),
            sorted(str(index["column_names"]) for index in look.get_indexes(name)),
            sorted(str(unique["column_names"]) for unique in look.get_unique_constraints(name)),
        )
        for name in names
    }


def leadership_of(connection: Connection) -> list[tuple[Any, ...]]:
    return [tuple(row) for row in connection.execute(text("SELECT * FROM leadership"))]


def test_a_new_store_has_no_leader(url: str) -> None:
    with open_database(url).connect() as connection:
        assert leadership_of(connection) == [(1, 0, 0, "")]


def test_an_upgraded_store_has_the_tables_of_a_new_one(url: str) -> None:
    engine = open_database(url)
    with engine.begin() as connection:
        new = described(connection)
        everything = MetaData()
        everything.reflect(connection)
        everything.drop_all(connection)
    older_store(url)
    with open_database(url).connect() as connection:
        assert described(connection) == new
        assert not inspect(connection).has_table("sent_orders")


@pytest.mark.parametrize("release", [pytest.param(each, id=each.stem) for each in sorted(STORES.iterdir())])
def test_upgrading_the_store_of_each_release_keeps_its_content(url: str, release: Path) -> None:
    older_store(url, release)
    engine = open_database(url)
    assert {order.name: order.state.value for order in read_orders(engine, OrderFilter())} == {
        "done-1": "FINISHED",
        "withdrawn-2": "FAILED",
        "unroutable-3": "UNROUTABLE",
        "running-4": "BEING_PROCESSED",
        "waiting-5": "DISPATCHABLE",
    }
    found = read_unfinished(engine)
    assert [order.name for order in found.orders] == ["running-4", "waiting-5"]
    (sent,) = map(Drive.model_validate_json, found.drives.values())
    assert (sent.order_id, sent.order_number, set(found.drives)) == ("running-4-0", 4, {4})
    done = read_order(engine, idempotency_key="key-done-1")
    assert done is not None
    assert [entry.event_code for entry in done.status.history][-1] == "nena:finalStateReached"
    assert (found.last_number, found.last_change) == (5, 5)
    commit_changes(engine, changes((dispatchable_order(number=6), None)))
    assert [number for number, _ in read_changes(engine, 3, 10)] == [4, 5]


def test_an_upgrade_keeps_what_makes_room_for_others(url: str) -> None:
    older_store(url)
    vda_order = {"orderId": "evasion-1", "nodes": [], "edges": []}
    robot = {"manufacturer": "NeNa", "serial_number": "V1"}
    evasion = {**robot, "drive_order_index": None, "accepted": True, "vda_order": vda_order}
    document = json.dumps({**robot, "evasion": evasion})
    with make_engine(url).begin() as connection:
        connection.execute(schema.vehicles.insert().values(robot="NeNa/V1", document=document))
    (relocation,) = map(Drive.model_validate_json, read_unfinished(open_database(url)).relocations)
    assert (relocation.order_id, relocation.accepted, relocation.relocation) == ("evasion-1", True, True)


def test_migrating_again_changes_nothing(url: str) -> None:
    engine = open_database(url)
    order = dispatchable_order()
    commit_changes(engine, changes((order, None)))
    migrate(engine)
    assert read_order(engine, name=order.name) == order


def test_a_failed_migration_leaves_the_store_unchanged(sqlite_url: str) -> None:
    older_store(sqlite_url)
    with sqlite3.connect(sqlite_url.removeprefix("sqlite:///")) as store:
        store.execute("CREATE TABLE drives (other INTEGER)")
        before = list(store.iterdump())
    with pytest.raises(StoreError, match="drives already exists"):
        open_database(sqlite_url)
    with sqlite3.connect(sqlite_url.removeprefix("sqlite:///")) as store:
        assert list(store.iterdump()) == before


def test_store_of_a_newer_release_is_refused(url: str) -> None:
    engine = open_database(url)
    with engine.begin() as connection:
        connection.execute(text("UPDATE order_service_version SET version_num = '9999'"))
    with pytest.raises(StoreError, match=r"another release .*9999"):
        open_database(url)


def test_a_database_that_rejects_writes_is_a_database_error(tmp_path: Path) -> None:
    file = tmp_path / "orders.db"
    file.touch()
    with pytest.raises(SQLAlchemyError, match="readonly"):
        migrate(make_engine(f"sqlite:///file:{file}?mode=ro&uri=true"))


def test_foreign_tables_in_the_same_database_are_untouched(url: str) -> None:
    with make_engine(url).begin() as connection:
        connection.execute(text("CREATE TABLE schema_version (version INTEGER)"))
        connection.execute(text("INSERT INTO schema_version VALUES (7)"))
    engine = open_database(url)
    commit_changes(engine, changes((dispatchable_order(), None)))
    with engine.connect() as connection:
        assert connection.execute(text("SELECT version FROM schema_version")).scalar() == 7
