from __future__ import annotations

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

from nena_order_service.store.database import open_database
from nena_order_service.store.engine import is_shared, make_engine, reason_of, unusable
from nena_order_service.store.errors import StoreError


def test_sqlite_is_durable(sqlite_url: str) -> None:
    with open_database(sqlite_url).connect() as connection:
        assert connection.execute(text("PRAGMA journal_mode")).scalar() == "wal"
        assert connection.execute(text("PRAGMA synchronous")).scalar() == 2


def test_changes_of_tables_are_taken_back_too(url: str) -> None:
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
def test_store_that_cannot_be_opened_is_one_line_without_secrets(bad: str) -> None:
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
def test_a_disk_that_takes_nothing_is_looked_at(reason: str) -> None:
    assert str(unusable(reason)) == (
        f"store.url cannot be used: {reason}. Look at the room on its disk, and at the disk itself"
    )


def test_any_name_of_postgresql_means_the_one_driver() -> None:
    for name in ("postgresql", "postgresql+psycopg", "postgresql+asyncpg"):
        assert make_engine(f"{name}://host/orders").dialect.driver == "psycopg"
    assert is_shared("postgresql://host/orders")
    assert not is_shared("sqlite:///orders.db")


def test_reason_is_what_the_database_says_in_one_line(url: str) -> None:
    with pytest.raises(DBAPIError) as caught, make_engine(url).connect() as connection:
        connection.execute(text("SELECT * FROM nothing"))
    assert "nothing" in reason_of(caught.value)
    assert "\n" not in reason_of(caught.value)
