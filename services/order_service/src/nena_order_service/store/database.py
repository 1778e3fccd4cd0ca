"""Reads and writes the tables; every function blocks and belongs into a thread of the store."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError
from sqlalchemy import Connection, Engine, create_engine, delete, event, func, insert, select, update
from sqlalchemy.engine import Row, make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import ArgumentError, SQLAlchemyError
from sqlalchemy.pool import ConnectionPoolEntry

from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store import schema
from nena_order_service.store.changes import Changes, OrderChange
from nena_shared.fleet_api.transport_order import (
    HistoryEntry,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.program import StartError

NUMBERS_PER_QUERY = 500
"""Databases bound the parameters of a statement."""

FINAL_STATES = tuple(state.value for state in TransportOrderState if state.final)


class StoreError(StartError):
    """The store cannot be used; the text says why, and what to do."""


@dataclass(frozen=True, slots=True)
class OrderFilter:
    """Which orders are asked for, newest first; ``before`` is the number of the last one had already."""

    states: tuple[TransportOrderState, ...] = ()
    intended_vehicle: str | None = None
    before: int | None = None
    limit: int = 100


@dataclass(frozen=True, slots=True)
class Unfinished:
    """What a restart takes up."""

    orders: tuple[TransportOrder, ...]
    missions: dict[int, str]
    """Mission documents by the orders' numbers."""
    last_number: int
    """The greatest number that an order has; 0 for none."""


def open_database(url: str) -> Engine:
    """Open the database and make its tables where there are none.

    Raises:
        StoreError: there is no such database, it cannot be written, or its tables are of another version.

    """
    try:
        engine = create_engine(make_url(url))
        if engine.dialect.name == "sqlite":
            event.listen(engine, "connect", _make_sqlite_durable)
        with engine.begin() as connection:
            _prepare(connection)
    except (ArgumentError, ImportError, SQLAlchemyError) as error:
        # The URL may hold a password, so it is not repeated.
        reason = str(getattr(error, "orig", None) or error)
        message = f"store.url cannot be used: {reason}. Name a file that can be written: sqlite:///orders.db"
        raise StoreError(message) from error
    return engine


def _make_sqlite_durable(connection: DBAPIConnection, _entry: ConnectionPoolEntry) -> None:
    cursor = connection.cursor()
    for setting in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000"):
        cursor.execute(f"PRAGMA {setting}")
    cursor.close()


def _prepare(connection: Connection) -> None:
    schema.metadata.create_all(connection)
    version = connection.execute(select(schema.schema_version.c.version)).scalar()
    if version is None:
        connection.execute(insert(schema.schema_version).values(version=schema.SCHEMA_VERSION))
    elif version != schema.SCHEMA_VERSION:
        message = (
            f"the store has tables of version {version}, this program needs {schema.SCHEMA_VERSION}: "
            "use the release that made the store, or another store.url"
        )
        raise StoreError(message)


def write(engine: Engine, changes: Changes) -> None:
    """Commit all changes together."""
    with engine.begin() as connection:
        _write_orders(connection, changes.orders.values())
        _write_missions(connection, changes.missions)


def _write_orders(connection: Connection, changes: Iterable[OrderChange]) -> None:
    orders, history = schema.transport_orders, schema.history
    new = [_order_row(change.order) for change in changes if change.new]
    if new:
        connection.execute(insert(orders), new)
    entries = []
    for change in changes:
        number = change.order.number
        if not change.new:
            row = _order_row(change.order)
            connection.execute(update(orders).where(orders.c.number == number).values(row))
            replaced = history.c.entry >= change.unchanged_history
            connection.execute(delete(history).where(history.c.order_number == number, replaced))
        entries.extend(_history_rows(change))
    if entries:
        connection.execute(insert(history), entries)


def _write_missions(connection: Connection, documents: dict[int, str | None]) -> None:
    if not documents:
        return
    missions = schema.missions
    connection.execute(delete(missions).where(missions.c.order_number.in_(documents)))
    rows = [
        {"order_number": number, "document": document}
        for number, document in documents.items()
        if document is not None
    ]
    if rows:
        connection.execute(insert(missions), rows)


def _order_row(order: TransportOrder) -> dict[str, object]:
    return {
        "number": order.number,
        "name": order.name,
        "idempotency_key": order.idempotency_key,
        "state": order.state.value,
        "intended_vehicle": order.status.intended_vehicle,
        "document": order.status.model_dump_json(by_alias=True, exclude={"history"}),
    }


def _history_rows(change: OrderChange) -> list[dict[str, object]]:
    entries = change.order.status.history
    return [
        {
            "order_number": change.order.number,
            "entry": index,
            "document": entries[index].model_dump_json(by_alias=True),
        }
        for index in range(change.unchanged_history, len(entries))
    ]


def read_unfinished(engine: Engine) -> Unfinished:
    """Read all that is not at its end.

    Raises:
        StoreError: there is something in the store that this program has not written.

    """
    try:
        return _read_unfinished(engine)
    except (SQLAlchemyError, ValidationError) as error:
        message = (
            f"the orders in store.url cannot be read: {str(error).splitlines()[0]}. "
            "Go back to a copy of the store, or name another store.url"
        )
        raise StoreError(message) from error


def _read_unfinished(engine: Engine) -> Unfinished:
    orders, missions = schema.transport_orders, schema.missions
    with engine.connect() as connection:
        query = select(orders).where(orders.c.state.not_in(FINAL_STATES)).order_by(orders.c.number)
        found = _read_orders(connection, connection.execute(query).all())
        documents = {row.order_number: row.document for row in connection.execute(select(missions))}
        last = connection.execute(select(func.max(orders.c.number))).scalar() or 0
    return Unfinished(found, documents, last)


def read_order(
    engine: Engine, *, name: str | None = None, idempotency_key: str | None = None
) -> TransportOrder | None:
    """Read the order of this key, else of this name."""
    orders = schema.transport_orders
    with engine.connect() as connection:
        for column, value in ((orders.c.idempotency_key, idempotency_key), (orders.c.name, name)):
            if value is not None and (
                row := connection.execute(select(orders).where(column == value)).first()
            ):
                return _read_orders(connection, [row])[0]
    return None


def read_orders(engine: Engine, wanted: OrderFilter) -> tuple[TransportOrder, ...]:
    """Read a page of orders, newest first."""
    orders = schema.transport_orders
    query = select(orders).order_by(orders.c.number.desc()).limit(wanted.limit)
    if wanted.states:
        query = query.where(orders.c.state.in_([state.value for state in wanted.states]))
    if wanted.intended_vehicle is not None:
        query = query.where(orders.c.intended_vehicle == wanted.intended_vehicle)
    if wanted.before is not None:
        query = query.where(orders.c.number < wanted.before)
    with engine.connect() as connection:
        return _read_orders(connection, connection.execute(query).all())


def _read_orders(connection: Connection, rows: Sequence[Row[Any]]) -> tuple[TransportOrder, ...]:
    entries: dict[int, list[HistoryEntry]] = {row.number: [] for row in rows}
    history = schema.history
    for start in range(0, len(rows), NUMBERS_PER_QUERY):
        numbers = [row.number for row in rows[start : start + NUMBERS_PER_QUERY]]
        query = select(history).where(history.c.order_number.in_(numbers))
        for row in connection.execute(query.order_by(history.c.order_number, history.c.entry)):
            entries[row.order_number].append(HistoryEntry.model_validate_json(row.document))
    return tuple(
        TransportOrder(
            row.number,
            TransportOrderStatus.model_validate_json(row.document).model_copy(
                update={"history": tuple(entries[row.number])}
            ),
            row.idempotency_key,
        )
        for row in rows
    )
