"""The statements of each commit, as text: SQLAlchemy makes it once for each kind of database.

Having it made anew at each commit takes longer than the commit itself; see decision 0022.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from sqlalchemy import (
    BindParameter,
    ClauseElement,
    Column,
    ColumnElement,
    Connection,
    Engine,
    Table,
    bindparam,
    delete,
    false,
    insert,
    update,
)
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.dialects.postgresql import psycopg

from nena_order_service.store import schema

DatabaseRow = dict[str, object]
"""Values by the names of columns."""


@dataclass(frozen=True, slots=True)
class Statements:
    """SQL with parameters by name; they are those of the tables' columns, keys in WHERE too."""

    insert_order: str
    update_order: str
    insert_history: str
    forget_history: str
    """Entries of ``order_number`` from ``entry`` on."""
    put_mission: str
    forget_mission: str
    put_vehicle: str
    put_sequence: str
    put_path_lock: str
    put_document: str
    forget_document: str


def statements(engine: Engine) -> Statements:
    """Give the statements in the words of this database."""
    return _statements(engine.dialect.name)


@lru_cache
def _statements(name: str) -> Statements:
    orders, history, missions = schema.transport_orders, schema.history, schema.missions
    documents = schema.documents
    others: dict[str, BindParameter[Any]] = {
        column.name: bindparam(column.name) for column in orders.c if column.name != "number"
    }
    texts: dict[str, ClauseElement] = {
        "insert_order": insert(orders),
        "update_order": update(orders).where(orders.c.number == bindparam("number")).values(others),
        "insert_history": insert(history),
        "forget_history": delete(history).where(
            history.c.order_number == bindparam("order_number"), history.c.entry >= bindparam("entry")
        ),
        "put_mission": _put(name, missions),
        "forget_mission": delete(missions).where(missions.c.order_number == bindparam("order_number")),
        "put_vehicle": _put(name, schema.vehicles),
        "put_sequence": _put(name, schema.order_sequences),
        "put_path_lock": _put(name, schema.path_locks),
        "put_document": _put(name, documents),
        "forget_document": delete(documents).where(
            documents.c.kind == bindparam("kind"), documents.c.name == bindparam("name")
        ),
    }
    dialect = sqlite.dialect(paramstyle="named") if name == "sqlite" else psycopg.dialect()  # type: ignore[no-untyped-call] # of the library
    return Statements(**{key: str(text.compile(dialect=dialect)) for key, text in texts.items()})


def _put(name: str, table: Table) -> ClauseElement:
    """Insert a row, or lay it over the one that has the same key."""
    # Both dialects have the same words for it, in classes of their own.
    statement: Any = (sqlite.insert if name == "sqlite" else postgresql.insert)(table)
    others = {column.name: statement.excluded[column.name] for column in table.c if not column.primary_key}
    return statement.on_conflict_do_update(index_elements=list(table.primary_key), set_=others)  # type: ignore[no-any-return]


def equals(column: Column[Any], text: str) -> ColumnElement[bool]:
    """Ask for rows with what a host says; PostgreSQL takes no text with NUL, so there is none."""
    return false() if "\0" in text else column == text


def execute(connection: Connection, statement: str, rows: Sequence[DatabaseRow]) -> None:
    """Execute a statement for each row; nothing where there is none."""
    if rows:
        connection.exec_driver_sql(statement, list(rows) if len(rows) > 1 else rows[0])
