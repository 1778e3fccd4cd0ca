"""Stores of the order service, also such as older releases have made, and newer ones will."""

from __future__ import annotations

import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

from alembic import command
from alembic.config import Config
from sqlalchemy import Connection, text

from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store import schema
from nena_order_service.store.database import Changes
from nena_order_service.store.migrations import FIRST
from nena_order_service.store.schema import is_shared, make_engine, open_database

STORES = Path(__file__).parents[1] / "fixtures" / "stores"
FIRST_STORE = STORES / "version_1.sql"
FIRST_TABLES = ("transport_orders", "history", "missions")


def first_store(url: str, content: Path = FIRST_STORE) -> Path:
    """Put the store of a first release, killed during work, at a SQLite URL; return the file.

    ``content`` is that store, or the same orders in the tables of a later release.
    """
    file = Path(url.removeprefix("sqlite:///"))
    with closing(sqlite3.connect(file)) as store:
        store.executescript(content.read_text(encoding="utf-8"))
    return file


def freeze(release: str) -> Path:
    """Write the first release's orders in the tables of this release into the fixtures; return the file."""
    target = STORES / f"{release}.sql"
    with TemporaryDirectory() as folder:
        url = f"sqlite:///{folder}/orders.db"
        file = first_store(url)
        open_database(url).dispose()
        with closing(sqlite3.connect(file)) as store:
            target.write_text("\n".join(store.iterdump()) + "\n", encoding="utf-8")
    return target


def first_tables(url: str) -> None:
    """Put what is in :func:`first_store` into any database.

    That release knew SQLite only: on PostgreSQL its tables are those of the first migration.
    """
    if not is_shared(url):
        first_store(url)
        return
    with make_engine(url, pooled=False).begin() as connection, closing(sqlite3.connect(":memory:")) as first:
        config = Config()
        config.set_main_option("script_location", "nena_order_service.store:migrations")
        config.attributes["connection"] = connection
        command.upgrade(config, FIRST)
        first.executescript(FIRST_STORE.read_text(encoding="utf-8"))
        for table in FIRST_TABLES:
            _copy(first, connection, table)


def _copy(first: sqlite3.Connection, connection: Connection, table: str) -> None:
    rows = first.execute(f"SELECT * FROM {table}")  # noqa: S608 - one of the names above
    names = [each[0] for each in rows.description]
    places = ", ".join(f":{name}" for name in names)
    insert = text(f"INSERT INTO {table} ({', '.join(names)}) VALUES ({places})")  # noqa: S608
    connection.execute(insert, [dict(zip(names, row, strict=True)) for row in rows])


def make_newer(url: str) -> None:
    """Mark a store as upgraded by a newer release."""
    with make_engine(url, pooled=False).begin() as connection:
        connection.execute(text(f"UPDATE {schema.VERSION_TABLE} SET version_num = '9999'"))  # noqa: S608
        connection.execute(text("CREATE TABLE of_a_newer_release (number INTEGER)"))


def changes(*versions: tuple[TransportOrder, TransportOrder | None]) -> Changes:
    """Return the changes that lead to each order from the version before it; None: it is new."""
    made = Changes()
    for order, before in versions:
        made.put_order(order, before)
    return made


if __name__ == "__main__":
    freeze(sys.argv[1])
