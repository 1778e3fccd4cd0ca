"""Stores of the order service, also such as older releases have made, and newer ones will."""

from __future__ import annotations

import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

from sqlalchemy import text

from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store import schema
from nena_order_service.store.database import Changes
from nena_order_service.store.schema import is_shared, make_engine, open_database

STORES = Path(__file__).parents[1] / "fixtures" / "stores"
OLDEST_STORE = STORES / "revision_0008.sql"
"""Orders of a first release that was killed during work, in the tables of November 2026."""


def older_store(url: str, content: Path = OLDEST_STORE) -> None:
    """Put the store of an older release into an empty database."""
    script = content.read_text(encoding="utf-8")
    if is_shared(url):
        statements = script.removeprefix("BEGIN TRANSACTION;\n").removesuffix("COMMIT;\n").split(";\n")
        with make_engine(url, pooled=False).begin() as connection:
            for statement in sorted(statements, key=_rank):
                connection.exec_driver_sql(statement.replace("%", "%%"))
    else:
        with closing(sqlite3.connect(url.removeprefix("sqlite:///"))) as store:
            store.executescript(script)


def _rank(statement: str) -> int:
    """Rank tables, and the rows of orders, before what refers to them; SQLite's dumps go by name."""
    if statement.startswith("CREATE TABLE"):
        return 1 if "REFERENCES" in statement else 0
    return 2 if statement.startswith('INSERT INTO "transport_orders"') else 3


def freeze(release: str) -> Path:
    """Write the oldest store's orders in the tables of this release into the fixtures; return the file."""
    target = STORES / f"{release}.sql"
    with TemporaryDirectory() as folder:
        url = f"sqlite:///{folder}/orders.db"
        older_store(url)
        open_database(url).dispose()
        with closing(sqlite3.connect(f"{folder}/orders.db")) as store:
            target.write_text("\n".join(store.iterdump()) + "\n", encoding="utf-8")
    return target


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
