"""Changes to commit together, and the statements and queries that write and read the store."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import lru_cache
from typing import Any

import sqlalchemy as sa
from pydantic import ValidationError
from pydantic_core import from_json
from sqlalchemy.dialects import sqlite
from sqlalchemy.engine import Row
from sqlalchemy.exc import SQLAlchemyError

from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store import audit, schema
from nena_order_service.store.audit import AuditChain, AuditRow
from nena_order_service.store.schema import FencedError, StoreError
from nena_shared.fleet_api.audit import AuditMark
from nena_shared.fleet_api.requests import OrderSequencesQuery
from nena_shared.fleet_api.transport_order import (
    HistoryEntry,
    OrderSequenceStatus,
    TransportOrderState,
    TransportOrderStatus,
)

Document = Callable[[], str]
"""Serialises a document; called by the writer, because most changes are replaced before they are written."""


@dataclass(frozen=True, slots=True)
class OrderChange:
    """One order's new version; its first ``unchanged_history`` history entries are already stored."""

    order: TransportOrder
    new: bool
    unchanged_history: int
    change_number: int = 0
    """Number of this change among the changes of all orders."""


@dataclass(frozen=True, slots=True)
class DriveRow:
    """A sent drive, and the number of its transport order; None: a relocation."""

    order_number: int | None
    document: Document


@dataclass(slots=True)
class Changes:
    """Changes to commit together; only the latest of each order counts."""

    orders: dict[int, OrderChange] = field(default_factory=dict)
    """Orders by number."""
    drives: dict[str, DriveRow | None] = field(default_factory=dict)
    """Sent drives by robot key; None: ended."""
    vehicles: dict[str, Document] = field(default_factory=dict)
    """Documents of vehicles by robot key."""
    sequences: dict[int, OrderSequence] = field(default_factory=dict)
    """Order sequences by number."""
    path_locks: dict[str, bool] = field(default_factory=dict)
    """Whether a path is locked, by path name."""
    documents: dict[tuple[str, str], str | None] = field(default_factory=dict)
    """Peripheral jobs, and documents uploaded by hosts, by kind and name; None: deleted."""
    audit: list[AuditRow] = field(default_factory=list)
    """New rows of the audit trail, oldest first."""
    expired_audit: AuditMark | None = None
    """Rows of the audit trail up to this one are deleted."""

    def __bool__(self) -> bool:
        single = self.orders or self.drives or self.vehicles or self.sequences
        return bool(single or self.path_locks or self.documents or self.audit or self.expired_audit)

    def put_order(self, order: TransportOrder, previous: TransportOrder | None) -> None:
        """Add an order's new version; ``previous`` is None for a new order."""
        unchanged = 0
        if previous and (old := previous.status.history):
            # Entries never change; at most the last one is replaced, by a repeated deferral.
            history, last = order.status.history, len(old) - 1
            unchanged = len(old) if len(history) > last and history[last] is old[last] else last
        earlier = self.orders.get(order.number)
        if earlier:
            change = OrderChange(order, earlier.new, min(earlier.unchanged_history, unchanged))
        else:
            change = OrderChange(order, previous is None, unchanged)
        self.orders[order.number] = change

    def merge(self, later: Changes) -> None:
        """Add ``later`` changes, which replace these where they overlap."""
        for number, change in later.orders.items():
            earlier = self.orders.get(number)
            if earlier:
                unchanged = min(earlier.unchanged_history, change.unchanged_history)
                change = replace(change, new=earlier.new, unchanged_history=unchanged)  # noqa: PLW2901 - merged
            self.orders[number] = change
        self.drives.update(later.drives)
        self.vehicles.update(later.vehicles)
        self.sequences.update(later.sequences)
        self.path_locks.update(later.path_locks)
        self.documents.update(later.documents)
        self.audit += later.audit
        self.expired_audit = later.expired_audit or self.expired_audit

    def number_orders(self, last: int) -> int:
        """Number each order's change, starting after ``last``; return the last number."""
        for number, change in self.orders.items():
            last += 1
            self.orders[number] = OrderChange(change.order, change.new, change.unchanged_history, last)
        return last


DatabaseRow = dict[str, object]
"""Values by column name."""


@lru_cache
def _statements_for(name: str) -> Mapping[str, str]:
    """Return the statements in a database's dialect, as text: it takes half the time of SQLAlchemy's objects.

    Their parameters are named like the tables' columns, also in WHERE.
    """
    orders, history, audit_rows = schema.transport_orders.c, schema.history.c, schema.audit.c
    inserting: Callable[[sa.Table], Any]
    dialect: Any
    if name == "sqlite":
        inserting, dialect = sqlite.insert, sqlite.dialect(paramstyle="named")
    else:
        from sqlalchemy.dialects import postgresql  # noqa: PLC0415 - takes 2 MB
        from sqlalchemy.dialects.postgresql import psycopg  # noqa: PLC0415

        inserting = postgresql.insert
        dialect = psycopg.dialect()  # type: ignore[no-untyped-call] # of the library
    assigned: dict[str, sa.BindParameter[Any]] = {
        column.name: sa.bindparam(column.name) for column in orders if column.name != "number"
    }
    replaced = (
        schema.drives,
        schema.vehicles,
        schema.order_sequences,
        schema.path_locks,
        schema.documents,
    )
    texts: dict[str, sa.ClauseElement] = {
        "insert transport_orders": sa.insert(schema.transport_orders),
        "update transport_orders": sa.update(schema.transport_orders)
        .where(orders.number == sa.bindparam("number"))
        .values(assigned),
        "insert history": sa.insert(schema.history),
        "delete history": sa.delete(schema.history).where(
            history.order_number == sa.bindparam("order_number"), history.entry >= sa.bindparam("entry")
        ),
        "insert audit": sa.insert(schema.audit),
        "delete audit": sa.delete(schema.audit).where(audit_rows.sequence <= sa.bindparam("sequence")),
        **{f"put {table.name}": _upsert_row(inserting, table) for table in replaced},
        **{
            f"delete {table.name}": sa.delete(table).where(
                *(column == sa.bindparam(column.name) for column in table.primary_key)
            )
            for table in (schema.drives, schema.documents)
        },
    }
    return {key: str(text.compile(dialect=dialect)) for key, text in texts.items()}


def _upsert_row(inserting: Callable[[sa.Table], Any], table: sa.Table) -> sa.ClauseElement:
    """Insert a row, or replace the one with the same key."""
    # Both dialects use the same syntax, in classes of their own.
    statement = inserting(table)
    replaced = {column.name: statement.excluded[column.name] for column in table.c if not column.primary_key}
    return statement.on_conflict_do_update(index_elements=list(table.primary_key), set_=replaced)  # type: ignore[no-any-return]


def equals_text(column: sa.Column[Any], text: str) -> sa.ColumnElement[bool]:
    """Return a condition for a host's text; with NUL, which PostgreSQL does not accept, nothing matches."""
    return sa.false() if "\0" in text else column == text


def _execute_rows(connection: sa.Connection, statement: str, rows: Sequence[DatabaseRow]) -> None:
    """Execute a statement for each row; do nothing without rows."""
    if rows:
        text = _statements_for(connection.dialect.name)[statement]
        connection.exec_driver_sql(text, list(rows) if len(rows) > 1 else rows[0])


def _replace_rows(
    connection: sa.Connection,
    table: sa.Table,
    rows: Iterable[tuple[Mapping[str, object], Mapping[str, object] | None]],
) -> None:
    """Insert or replace rows of keys and other values; None deletes a row."""
    present: list[DatabaseRow] = []
    deleted: list[DatabaseRow] = []
    for key, values in rows:
        if values is None:
            deleted.append({**key})
        else:
            present.append({**key, **values})
    _execute_rows(connection, f"put {table.name}", present)
    _execute_rows(connection, f"delete {table.name}", deleted)


def _replace_documents(connection: sa.Connection, documents: Mapping[tuple[str, str], str | None]) -> None:
    rows = (
        ({"kind": kind, "name": name}, None if text is None else {"document": text})
        for (kind, name), text in documents.items()
    )
    _replace_rows(connection, schema.documents, rows)


def read_documents(engine: sa.Engine, kind: str) -> dict[str, str]:
    """Read all documents of a kind, by name."""
    table = schema.documents
    with engine.connect() as connection:
        rows = connection.execute(sa.select(table.c.name, table.c.document).where(table.c.kind == kind))
        return {row.name: row.document for row in rows}


def read_document(engine: sa.Engine, kind: str, name: str) -> str | None:
    """Read the document of a kind and name."""
    table = schema.documents
    query = sa.select(table.c.document).where(table.c.kind == kind, equals_text(table.c.name, name))
    with engine.connect() as connection:
        return connection.execute(query).scalar()


def read_sequence(
    engine: sa.Engine, *, name: str | None = None, idempotency_key: str | None = None
) -> OrderSequence | None:
    """Read the sequence with this key, otherwise with this name."""
    with engine.connect() as connection:
        row = _find_row(connection, schema.order_sequences, name, idempotency_key)
        return _read_sequence(row) if row else None


def _find_row(
    connection: sa.Connection, table: sa.Table, name: str | None, idempotency_key: str | None
) -> Row[Any] | None:
    for column, value in ((table.c.idempotency_key, idempotency_key), (table.c.name, name)):
        if value is not None:
            row = connection.execute(sa.select(table).where(equals_text(column, value))).first()
            if row:
                return row
    return None


def read_sequences(engine: sa.Engine, wanted: OrderSequencesQuery) -> tuple[OrderSequence, ...]:
    """Read a page of sequences, newest first."""
    table = schema.order_sequences
    query = sa.select(table).order_by(table.c.number.desc()).limit(wanted.limit)
    if wanted.finished is not None:
        query = query.where(table.c.finished.is_(wanted.finished))
    if wanted.intended_vehicle is not None:
        query = query.where(equals_text(table.c.intended_vehicle, wanted.intended_vehicle))
    if wanted.since is not None:
        query = query.where(table.c.number >= read_number_at(engine, wanted.since, table))
    if wanted.until is not None:
        query = query.where(table.c.number < read_number_at(engine, wanted.until, table))
    if wanted.after is not None:
        query = query.where(table.c.number < int(wanted.after))
    with engine.connect() as connection:
        return tuple(map(_read_sequence, connection.execute(query)))


def _read_sequence(row: Row[Any]) -> OrderSequence:
    status = OrderSequenceStatus.model_validate_json(row.document)
    return OrderSequence(row.number, status, row.idempotency_key)


NUMBERS_PER_QUERY = 500
"""Maximum numbers in one query: databases limit the parameters of a statement."""

FINAL_STATES = tuple(state.value for state in TransportOrderState if state.final)


@dataclass(frozen=True, slots=True)
class OrderFilter:
    """Which orders to return, newest first; ``before`` is the number of the last one received."""

    states: tuple[TransportOrderState, ...] = ()
    intended_vehicle: str | None = None
    before: int | None = None
    limit: int = 100
    first: int = 0
    """Lowest number to return."""


@dataclass(frozen=True, slots=True)
class Unfinished:
    """Everything that a restart restores."""

    orders: tuple[TransportOrder, ...]
    drives: dict[int, str]
    """Documents of the sent drives of orders, by order number."""
    last_number: int
    """The highest number of an order; 0 if there is none."""
    relocations: tuple[str, ...] = ()
    """Documents of the sent drives that make room for others."""
    vehicles: dict[str, str] = field(default_factory=dict)
    """Documents of vehicles by robot key."""
    last_change: int = 0
    """The number of the last change of any order; 0 if there is none."""
    sequences: tuple[OrderSequence, ...] = ()
    last_sequence: int = 0
    """The highest number of an order sequence; 0 if there is none."""


LEADERSHIP_ROW = schema.leadership.c.id == schema.LEADERSHIP_ID


@dataclass(slots=True)
class Fence:
    """Admits the commits of one epoch, each only once; used by the writer's thread only."""

    epoch: int
    commits: int = 0

    @classmethod
    def raise_for(cls, engine: sa.Engine, active_url: str) -> Fence:
        """Take over the store: the previous program can no longer commit.

        Waits for a commit in progress. Raises DBAPIError if the database does not answer.
        """
        with engine.begin() as connection:
            row = connection.execute(
                sa.select(schema.leadership).where(LEADERSHIP_ROW).with_for_update()
            ).one()
            # After a restore from a backup, the stored epoch is older than one that was in use.
            epoch = max(row.epoch + 1, int(time.time()))
            taken = sa.update(schema.leadership).where(LEADERSHIP_ROW)
            connection.execute(taken.values(epoch=epoch, commits=0, url=active_url))
        return cls(epoch)

    def lets_pass(self, connection: sa.Connection) -> bool:
        """Return whether to make a commit; False: it was already made, and only the answer was lost.

        Call it first within the commit's transaction, whose lock keeps others from overtaking.

        Raises:
            FencedError: another order service has taken over the store.
        """
        row = connection.execute(sa.select(schema.leadership).where(LEADERSHIP_ROW).with_for_update()).one()
        if row.epoch != self.epoch:
            raise FencedError
        # A connection that breaks during COMMIT leaves open whether the database has made it.
        if row.commits > self.commits:
            return False
        connection.execute(
            sa.update(schema.leadership).where(LEADERSHIP_ROW).values(commits=self.commits + 1)
        )
        return True

    def count_commit(self) -> None:
        """Note that the commit was made."""
        self.commits += 1

    def is_current(self, engine: sa.Engine) -> bool:
        """Return whether this epoch is still the current one; raise DBAPIError without a database."""
        with engine.connect() as connection:
            return bool(
                connection.execute(sa.select(schema.leadership.c.epoch).where(LEADERSHIP_ROW)).scalar()
                == self.epoch
            )


def commit_changes(
    engine: sa.Engine, changes: Changes, fence: Fence | None = None, chain: AuditChain | None = None
) -> None:
    """Commit all changes together; with a fence, each commit is made once, however often it is retried.

    Args:
        engine: the database.
        changes: what to write.
        fence: refuses the commit if another order service has taken over the store.
        chain: chains the rows of the audit trail; None: the last row is read first.

    Raises:
        FencedError: another order service has taken over the store.
    """
    chain = chain or AuditChain()
    try:
        _write_changes(engine, changes, fence, chain)
    except BaseException:
        # The commit may have been made and only its answer lost: the chain then goes on after its rows.
        chain.forget_last()
        raise
    if fence:
        fence.count_commit()


def _write_changes(engine: sa.Engine, changes: Changes, fence: Fence | None, chain: AuditChain) -> None:
    # Many long requests take seconds, and PostgreSQL ends transactions that are idle for that long.
    audited = [row.to_columns() for row in changes.audit]
    with engine.begin() as connection:
        if fence and not fence.lets_pass(connection):
            return
        _write_orders(connection, changes.orders.values())
        drives = (
            (
                {"robot": robot},
                {"order_number": drive.order_number, "document": drive.document()} if drive else None,
            )
            for robot, drive in changes.drives.items()
        )
        _replace_rows(connection, schema.drives, drives)
        vehicles = (({"robot": robot}, {"document": text()}) for robot, text in changes.vehicles.items())
        _replace_rows(connection, schema.vehicles, vehicles)
        sequences = (
            (
                {"number": sequence.number},
                {
                    "name": sequence.name,
                    "idempotency_key": sequence.idempotency_key,
                    "finished": sequence.status.finished,
                    "intended_vehicle": sequence.status.intended_vehicle,
                    "document": sequence.status.model_dump_json(by_alias=True),
                },
            )
            for sequence in changes.sequences.values()
        )
        _replace_rows(connection, schema.order_sequences, sequences)
        locks = (({"path": path}, {"locked": locked}) for path, locked in changes.path_locks.items())
        _replace_rows(connection, schema.path_locks, locks)
        _replace_documents(connection, changes.documents)
        _write_audit(connection, audited, changes.expired_audit, chain)


def _write_audit(
    connection: sa.Connection, new: Sequence[DatabaseRow], expired: AuditMark | None, chain: AuditChain
) -> None:
    marks: dict[tuple[str, str], str | None] = {}
    if new:
        rows, last = chain.chain_rows(connection, new)
        _execute_rows(connection, "insert audit", rows)
        marks[audit.LAST] = last.model_dump_json(by_alias=True)
    if expired:
        _execute_rows(connection, "delete audit", [{"sequence": expired.sequence}])
        marks[audit.DELETED] = expired.model_dump_json(by_alias=True)
    _replace_documents(connection, marks)


def _write_orders(connection: sa.Connection, changes: Iterable[OrderChange]) -> None:
    new: list[DatabaseRow] = []
    changed: list[DatabaseRow] = []
    replaced: list[DatabaseRow] = []
    entries: list[DatabaseRow] = []
    for change in changes:
        order, history = change.order, change.order.status.history
        (new if change.new else changed).append(
            {
                "number": order.number,
                "name": order.name,
                "idempotency_key": order.idempotency_key,
                "state": order.state.value,
                "intended_vehicle": order.status.intended_vehicle,
                # The history grows with each event; in rows of its own, only its new entries are written.
                "document": order.status.model_dump_json(by_alias=True, exclude={"history"}),
                "change_number": change.change_number,
            }
        )
        if not change.new:
            replaced.append({"order_number": order.number, "entry": change.unchanged_history})
        entries.extend(
            {
                "order_number": order.number,
                "entry": index,
                "document": history[index].model_dump_json(by_alias=True),
            }
            for index in range(change.unchanged_history, len(history))
        )
    _execute_rows(connection, "insert transport_orders", new)
    _execute_rows(connection, "update transport_orders", changed)
    _execute_rows(connection, "delete history", replaced)
    _execute_rows(connection, "insert history", entries)


def read_unfinished(engine: sa.Engine) -> Unfinished:
    """Read everything that has not ended.

    Raises:
        StoreError: the store contains data that this program did not write.
    """
    try:
        return _read_unfinished(engine)
    except (SQLAlchemyError, ValidationError) as error:
        raise StoreError(
            f"the orders in store.url cannot be read: {str(error).splitlines()[0]}. "
            "Restore a backup, or set another store.url"
        ) from error


def _read_unfinished(engine: sa.Engine) -> Unfinished:
    orders, sequences = schema.transport_orders, schema.order_sequences
    with engine.connect() as connection:
        query = sa.select(orders).where(orders.c.state.not_in(FINAL_STATES)).order_by(orders.c.number)
        open_sequences = sa.select(sequences).where(sequences.c.finished.is_(False))
        last, last_change, last_sequence = (
            connection.execute(sa.select(sa.func.max(column))).scalar() or 0
            for column in (orders.c.number, orders.c.change_number, sequences.c.number)
        )
        drives = connection.execute(sa.select(schema.drives)).all()
        vehicles = connection.execute(sa.select(schema.vehicles))
        return Unfinished(
            orders=_read_orders(connection, connection.execute(query).all()),
            drives={row.order_number: row.document for row in drives if row.order_number is not None},
            relocations=tuple(row.document for row in drives if row.order_number is None),
            last_number=last,
            vehicles={row.robot: row.document for row in vehicles},
            last_change=last_change,
            sequences=tuple(
                map(_read_sequence, connection.execute(open_sequences.order_by(sequences.c.number)))
            ),
            last_sequence=last_sequence,
        )


def read_path_locks(engine: sa.Engine) -> dict[str, bool]:
    """Read which paths hosts have locked or unlocked, by path name."""
    with engine.connect() as connection:
        return {row.path: row.locked for row in connection.execute(sa.select(schema.path_locks))}


def read_order(
    engine: sa.Engine, *, name: str | None = None, idempotency_key: str | None = None
) -> TransportOrder | None:
    """Read the order with this key, otherwise with this name."""
    with engine.connect() as connection:
        row = _find_row(connection, schema.transport_orders, name, idempotency_key)
        return _read_orders(connection, [row])[0] if row else None


def read_orders(engine: sa.Engine, wanted: OrderFilter) -> tuple[TransportOrder, ...]:
    """Read a page of orders, newest first."""
    orders = schema.transport_orders
    query = sa.select(orders).order_by(orders.c.number.desc()).limit(wanted.limit)
    if wanted.states:
        query = query.where(orders.c.state.in_([state.value for state in wanted.states]))
    if wanted.intended_vehicle is not None:
        query = query.where(equals_text(orders.c.intended_vehicle, wanted.intended_vehicle))
    if wanted.before is not None:
        query = query.where(orders.c.number < wanted.before)
    if wanted.first:
        query = query.where(orders.c.number >= wanted.first)
    with engine.connect() as connection:
        return _read_orders(connection, connection.execute(query).all())


def read_number_at(engine: sa.Engine, moment: datetime, objects: sa.Table = schema.transport_orders) -> int:
    """Return the lowest number of the orders created at ``moment`` or later; if none, the next number.

    Found by bisection without an index, because numbers grow with the time of creation. After the clock was
    set back, orders of the repeated time may count to either side.

    ``objects`` is their table, or that of the order sequences.
    """
    with engine.connect() as connection:
        last: int | None = connection.execute(sa.select(sa.func.max(objects.c.number))).scalar()
        low, high = 0, 0 if last is None else last + 1
        number = high
        while low < high:
            middle = (low + high) // 2
            query = sa.select(objects.c.number, objects.c.document).where(objects.c.number >= middle)
            row = connection.execute(query.order_by(objects.c.number).limit(1)).first()
            if row is None or datetime.fromisoformat(from_json(row.document)["created"]) >= moment:
                number, high = row.number if row else number, middle
            else:
                low = row.number + 1
    return number


def read_changes(engine: sa.Engine, last: int, limit: int) -> tuple[tuple[int, TransportOrder], ...]:
    """Return each order changed since change number ``last``, with the number of its last change.

    The oldest change comes first. An order that has changed several times is returned once, as it is now.
    """
    table = schema.transport_orders
    number = table.c.change_number
    query = sa.select(table).where(number > last).order_by(number).limit(limit)
    with engine.connect() as connection:
        rows = connection.execute(query).all()
        orders = _read_orders(connection, rows)
    return tuple((row.change_number, order) for row, order in zip(rows, orders, strict=True))


def _read_orders(connection: sa.Connection, rows: Sequence[Row[Any]]) -> tuple[TransportOrder, ...]:
    entries: dict[int, list[HistoryEntry]] = {row.number: [] for row in rows}
    history = schema.history
    for start in range(0, len(rows), NUMBERS_PER_QUERY):
        numbers = [row.number for row in rows[start : start + NUMBERS_PER_QUERY]]
        query = sa.select(history).where(history.c.order_number.in_(numbers))
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
