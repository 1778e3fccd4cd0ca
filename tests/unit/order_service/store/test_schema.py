"""Stores of older releases are brought up to date with all that is in them."""

from __future__ import annotations

import sqlite3
import sys
from pathlib import Path
from typing import Any

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from sqlalchemy import Connection, text
from sqlalchemy.exc import DBAPIError, SQLAlchemyError

from nena_order_service import store as store_package
from nena_order_service.orders.automatic import park_request
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import SentOrder
from nena_order_service.store import migrations, schema
from nena_order_service.store.database import (
    OrderFilter,
    read_changes,
    read_order,
    read_orders,
    read_unfinished,
    write,
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
from support.order_service import NOW, dispatchable_order
from support.stores import STORES, changes, first_store, first_tables, make_newer


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


def differences(connection: Connection) -> list[Any]:
    """Return how the tables of a store differ from those that the program knows."""
    context = MigrationContext.configure(
        connection, opts={"compare_type": True, "version_table": schema.VERSION_TABLE}
    )
    assert context.get_current_revision() == schema.HEAD
    return list(compare_metadata(context, schema.metadata))


def leadership_of(connection: Connection) -> list[tuple[Any, ...]]:
    return [tuple(row) for row in connection.execute(text("SELECT * FROM leadership"))]


def test_new_tables_are_those_that_the_program_knows(url: str) -> None:
    with open_database(url).connect() as connection:
        assert differences(connection) == []
        assert leadership_of(connection) == [(1, 0, 0, "")]


def test_migrations_lead_to_the_tables_of_a_new_store(url: str) -> None:
    with make_engine(url).begin() as connection:
        migrations.upgrade(connection, is_versioned=True)
        assert differences(connection) == []
        assert leadership_of(connection) == [(1, 0, 0, "")]


def test_only_a_store_of_another_release_needs_alembic(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(store_package, "migrations")
    monkeypatch.setitem(sys.modules, "nena_order_service.store.migrations", None)  # importing it fails
    for _ in range(2):
        open_database(url).dispose()
    make_newer(url)
    with pytest.raises(ImportError):
        open_database(url)


@pytest.mark.parametrize("release", [pytest.param(each, id=each.stem) for each in sorted(STORES.iterdir())])
def test_upgrading_the_store_of_each_release_keeps_its_content(sqlite_url: str, release: Path) -> None:
    first_store(sqlite_url, release)
    engine = open_database(sqlite_url)
    assert {order.name: order.state.value for order in read_orders(engine, OrderFilter())} == {
        "done-1": "FINISHED",
        "withdrawn-2": "FAILED",
        "unroutable-3": "UNROUTABLE",
        "running-4": "BEING_PROCESSED",
        "waiting-5": "DISPATCHABLE",
    }
    found = read_unfinished(engine)
    assert [order.name for order in found.orders] == ["running-4", "waiting-5"]
    assert [SentOrder.model_validate_json(text).vda_order.order_id for text in found.missions.values()]
    done = read_order(engine, idempotency_key="key-done-1")
    assert done is not None
    assert [entry.event_code for entry in done.status.history][-1] == "nena:finalStateReached"
    assert (found.last_number, found.last_change) == (5, 5)
    write(engine, changes((dispatchable_order(number=6), None)))
    assert [number for number, _ in read_changes(engine, 3, 10)] == [4, 5]


def test_the_first_release_refuses_an_upgraded_store(sqlite_url: str) -> None:
    file = first_store(sqlite_url)
    for _ in range(2):
        open_database(sqlite_url).dispose()
        with sqlite3.connect(file) as store:
            looked_at_by_it = store.execute("SELECT version FROM schema_version").fetchall()
        assert looked_at_by_it == [(2,)], "it works on with a store of version 1, or of none"


def test_migrating_again_changes_nothing(url: str) -> None:
    engine = open_database(url)
    order = dispatchable_order()
    write(engine, changes((order, None)))
    migrate(engine)
    assert read_order(engine, name=order.name) == order


def test_a_failed_migration_leaves_the_store_unchanged(sqlite_url: str) -> None:
    file = first_store(sqlite_url)
    with sqlite3.connect(file) as store:
        store.execute("CREATE TABLE leadership (other INTEGER)")
        before = list(store.iterdump())
    with pytest.raises(StoreError, match="leadership already exists"):
        open_database(sqlite_url)
    with sqlite3.connect(file) as store:
        assert list(store.iterdump()) == before


def test_store_of_a_newer_release_is_refused(url: str) -> None:
    engine = open_database(url)
    with engine.begin() as connection:
        connection.execute(text("UPDATE order_service_version SET version_num = '9999'"))
    with pytest.raises(StoreError, match=r"another release .*9999"):
        open_database(url)


def test_first_tables_of_an_unknown_version_are_refused(sqlite_url: str) -> None:
    file = first_store(sqlite_url)
    with sqlite3.connect(file) as store:
        store.execute("UPDATE schema_version SET version = 99")
    with pytest.raises(StoreError, match="version 99"):
        open_database(sqlite_url)


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
    write(engine, changes((dispatchable_order(), None)))
    with engine.connect() as connection:
        assert connection.execute(text("SELECT version FROM schema_version")).scalar() == 7


@pytest.mark.parametrize(
    ("name", "fields", "automatic"),
    [
        ("Park-0123456789abcdef012345", {}, True),
        ("Recharge-0123456789abcdef012345", {"type": "Charge"}, True),
        ("Park-1", {}, False),
        ("Recharge-0123456789abcdef012345", {}, False),
        ("Park-0123456789abcdef012345", {"on_failure": None}, False),
        ("Park-0123456789abcdef012345", {"intended_vehicle": None}, False),
        ("Park-0123456789abcdef012345", {"idempotency_key": "of a host"}, False),
    ],
)
def test_automatic_orders_of_an_older_release_are_recognised(
    url: str, name: str, fields: dict[str, Any], *, automatic: bool
) -> None:
    asked = park_request("V1", "P").model_copy(update=fields)
    order = TransportOrder.created(asked, number=1, name=name, now=NOW)
    engine = open_database(url)
    write(engine, changes((order, None)))
    with engine.begin() as connection:
        connection.execute(text("UPDATE order_service_version SET version_num = '0005'"))
        connection.execute(text("DROP TABLE audit"))
    found = read_order(open_database(url), name=name)
    assert found is not None
    assert found.status.automatic is automatic
    assert found.status.model_copy(update={"automatic": False}) == order.status


def test_a_migration_may_pause_longer_than_other_transactions(
    url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It reads documents between its statements, which takes long in a large store or on a busy machine."""
    if not url.startswith("postgresql"):
        pytest.skip("SQLite ends no transactions")
    shown: list[str] = []
    upgrade = command.upgrade

    def watched(config: Config, revision: str) -> None:
        shown.append(timeout(config.attributes["connection"]))
        upgrade(config, revision)

    first_tables(url)
    monkeypatch.setattr(command, "upgrade", watched)
    engine = open_database(url)
    with engine.begin() as connection:
        shown.append(timeout(connection))

    assert shown == ["1min", "3s"]


def timeout(connection: Connection) -> str:
    return str(connection.execute(text("SHOW idle_in_transaction_session_timeout")).scalar())
