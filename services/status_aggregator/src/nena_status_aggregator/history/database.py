"""Tables of the history, and blocking functions that read and write them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import (
    JSON,
    URL,
    BigInteger,
    Column,
    ColumnElement,
    Dialect,
    Engine,
    Float,
    FromClause,
    Index,
    Integer,
    MetaData,
    Select,
    String,
    Table,
    Text,
    and_,
    case,
    cast,
    create_engine,
    delete,
    event,
    func,
    insert,
    or_,
    select,
)
from sqlalchemy.engine import Row, make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import ArgumentError
from sqlalchemy.pool import ConnectionPoolEntry
from typing_extensions import TypedDict

from nena_shared.clock import iso
from nena_shared.database_connections import register_connection
from nena_shared.tasks import StartError
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.connection import ConnectionState
from nena_status_aggregator.fleet.events import Code, Event, Outcome, Values

SCHEMA_VERSION = 1
"""Incremented with each change of the tables; other versions are refused."""

ROBOT_LENGTH = 300
ORDER_LENGTH = 600
"""Maximum lengths of stored names, characters."""

metadata = MetaData()

schema_version = Table("history_schema_version", metadata, Column("version", Integer, primary_key=True))

event_table = Table(
    "happenings",
    metadata,
    # SQLite generates row numbers only for a column of exactly type INTEGER.
    Column("id", BigInteger().with_variant(Integer, "sqlite"), primary_key=True, autoincrement=True),
    Column("time", BigInteger, nullable=False),
    Column("code", String(40), nullable=False),
    Column("robot", String(ROBOT_LENGTH)),
    Column("order_name", String(ORDER_LENGTH)),
    Column("text", Text, nullable=False),
    Column("details", Text, nullable=False),
    Index("happenings_by_time", "time"),
    Index("happenings_by_robot", "robot", "id"),
    Index("happenings_by_order", "order_name", "id"),
    Index("happenings_by_code", "code", "time"),
)
"""``time`` in ms since 1970-01-01 UTC; ``details`` holds the values as JSON."""


class HistoryEntry(TypedDict):
    """An event and its number; numbers increase."""

    id: int
    time: str
    code: str
    robot: str | None
    order: str | None
    text: str
    values: Values


@dataclass(frozen=True, slots=True)
class HistoryFilter:
    """Filter for entries; None and empty match all."""

    robot: str | None = None
    order: str | None = None
    codes: tuple[Code, ...] = ()
    """Empty: all except positions."""
    since: datetime | None = None
    """Earliest time, inclusive."""
    until: datetime | None = None
    """Latest time, exclusive."""
    order_part: str | None = None
    """A part of the order's name, in upper or lower case."""
    problems: bool = False
    """Only what :func:`_is_problem` lists."""


STOPPED = ("ERROR", "BROKEN", "SILENT", "BLOCKED")
"""Conditions that are problems."""
FAILED_ORDERS = ("FAILED", "UNROUTABLE")

EXPIRED_PER_COMMIT = 5000
"""Maximum number of rows deleted in one transaction, to keep the wait of writes short."""

CONNECT_SECONDS = 10

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MILLISECOND = timedelta(milliseconds=1)

NUL = "\x00"
"""Not allowed in texts by PostgreSQL."""


class HistoryError(StartError):
    """The history settings are invalid or its database is unusable."""


def make_engine(url: str) -> Engine:
    """Create the engine; nothing is opened yet.

    Raises:
        HistoryError: the URL has no file name, or the database driver is not installed.
    """
    try:
        parsed = _parse_url(url)
        timeouts = {"connect_timeout": CONNECT_SECONDS} if parsed.get_backend_name() == "postgresql" else {}
        engine = create_engine(parsed, pool_pre_ping=True, connect_args=timeouts)
    except (ArgumentError, ImportError) as error:
        raise HistoryError(
            f"history.url is unusable: {error}. Use for example sqlite:///nena-history.db"
        ) from error
    if engine.dialect.name == "sqlite":
        if parsed.database in (None, "", ":memory:"):
            raise HistoryError("history.url has no file name. Use for example sqlite:///nena-history.db")
        event.listen(engine, "connect", _set_up_sqlite)
    if engine.dialect.driver == "psycopg":
        event.listen(engine, "connect", lambda connection, _: register_connection(engine, connection))
    return engine


def _parse_url(url: str) -> URL:
    """Parse a URL. Errors never quote it, as it may contain a password."""
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError):
        raise ArgumentError("not a database URL") from None
    if "@" in (parsed.host or ""):  # the end of a password, which would appear in an error as an unknown host
        raise ArgumentError("write an @ in a password as %40")
    return parsed


def _set_up_sqlite(connection: DBAPIConnection, _entry_of: ConnectionPoolEntry) -> None:
    cursor = connection.cursor()
    # NORMAL may lose the last transactions in a power failure, but never corrupts the file.
    for setting in ("journal_mode=WAL", "synchronous=NORMAL", "busy_timeout=5000"):
        cursor.execute(f"PRAGMA {setting}")
    cursor.close()


def prepare(engine: Engine) -> None:
    """Create missing tables.

    Raises:
        HistoryError: the tables have another version.
        SQLAlchemyError: the database is not reachable or writable.
    """
    with engine.begin() as connection:
        metadata.create_all(connection)
        version = connection.execute(select(schema_version.c.version)).scalar()
        if version is None:
            connection.execute(insert(schema_version).values(version=SCHEMA_VERSION))
        elif version != SCHEMA_VERSION:
            raise HistoryError(
                f"the history database has schema version {version}; this program needs {SCHEMA_VERSION}. "
                "Use the release that created it, or another history.url"
            )


def write(engine: Engine, events: Sequence[Event]) -> None:
    """Write ``events`` in one transaction, in order."""
    with engine.begin() as connection:
        connection.execute(insert(event_table), [_row_of(entry) for entry in events])


def _row_of(entry: Event) -> dict[str, object]:
    return {
        "time": milliseconds(entry.time),
        "code": entry.code.value,
        "robot": _storable_text(entry.robot, ROBOT_LENGTH),
        "order_name": _storable_text(entry.order, ORDER_LENGTH),
        "text": _storable_text(entry.text, None),
        "details": json.dumps(_without_nul(entry.values)),
    }


def _without_nul(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """Return a JSON value whose texts PostgreSQL can store."""
    if isinstance(value, str):
        return _storable_text(value, None)
    if isinstance(value, Mapping):
        return {name: _without_nul(item) for name, item in value.items()}
    return [_without_nul(item) for item in value] if isinstance(value, list | tuple) else value


def _storable_text(text: str | None, length: int | None) -> str | None:
    return text.replace(NUL, "\ufffd")[:length] if text else text


def milliseconds(time: datetime) -> int:
    """Return a time in ms since 1970, as stored."""
    return (time - EPOCH) // MILLISECOND


NUL_IN_JSON = "\\u0000"
"""Text from which PostgreSQL reads no JSON."""


@dataclass(frozen=True, slots=True)
class EventValues:
    """Values of the events of a table, in the SQL of a dialect; null if absent."""

    dialect: Dialect
    table: FromClause

    def text(self, name: str) -> ColumnElement[Any]:
        """Return a text."""
        details = self.table.c.details
        if self.dialect.name == "sqlite":
            return func.json_extract(details, f"$.{name}")
        readable = func.strpos(details, NUL_IN_JSON) == 0
        return case((readable, cast(details, JSON)[name].as_string()))

    def number(self, name: str) -> ColumnElement[Any]:
        """Return a number."""
        return cast(self.text(name), Float)

    def truth(self, name: str) -> ColumnElement[Any]:
        """Return a truth value as 1 or 0."""
        value = self.text(name)
        return value if self.dialect.name == "sqlite" else case((value == "true", 1), (value == "false", 0))


def iso_of(stored: int) -> str:
    """Return a stored time as ISO 8601 in UTC."""
    return iso(EPOCH + stored * MILLISECOND)


def read_newest(
    engine: Engine, wanted: HistoryFilter, *, before: int | None, limit: int
) -> list[HistoryEntry]:
    """Read a page, newest first, of the entries with numbers below ``before``."""
    table = event_table
    query = _select_entries(wanted, engine.dialect).order_by(table.c.id.desc()).limit(limit)
    return _read_entries(engine, query if before is None else query.where(table.c.id < before))


def read_oldest(
    engine: Engine, wanted: HistoryFilter, *, after: int, upto: int, limit: int
) -> list[HistoryEntry]:
    """Read a page, oldest first, of the entries with numbers above ``after`` up to ``upto``."""
    number = event_table.c.id
    query = _select_entries(wanted, engine.dialect).where(number > after, number <= upto)
    return _read_entries(engine, query.order_by(number).limit(limit))


def _select_entries(wanted: HistoryFilter, dialect: Dialect) -> Select[Any]:
    table = event_table
    query = select(table)
    if wanted.robot is not None:
        query = query.where(table.c.robot == wanted.robot)
    if wanted.order is not None:
        query = query.where(table.c.order_name == wanted.order)
    if wanted.codes:
        query = query.where(table.c.code.in_([code.value for code in wanted.codes]))
    else:
        query = query.where(table.c.code != Code.POSITION.value)
    if wanted.order_part:
        query = query.where(table.c.order_name.icontains(wanted.order_part, autoescape=True))
    if wanted.problems:
        query = query.where(_is_problem(EventValues(dialect, table)))
    if wanted.since is not None:
        query = query.where(table.c.time >= milliseconds(wanted.since))
    if wanted.until is not None:
        query = query.where(table.c.time < milliseconds(wanted.until))
    return query


def _is_problem(values: EventValues) -> ColumnElement[bool]:
    """Return the condition for events that a person should look at."""
    code, text = values.table.c.code, values.text
    ended_as = func.coalesce(text("outcome"), text("state"))  # events of earlier releases have no outcome
    failed = ended_as.in_(FAILED_ORDERS), func.coalesce(values.truth("gaveWay"), 0) == 0
    # A robot that has just connected is silent until its first state comes: that is how each one begins.
    stopped = text("condition").in_(STOPPED), func.coalesce(text("reason"), "") != "expected"
    return or_(
        code.in_((Code.ERROR_RAISED.value, Code.HISTORY_GAP.value)),
        and_(code == Code.CONDITION.value, *stopped),
        and_(code == Code.CONNECTION.value, func.coalesce(text("state"), "") != ConnectionState.ONLINE.value),
        and_(code == Code.LINK.value, values.truth("connected") == 0),
        and_(code == Code.ORDER_ENDED.value, text("outcome") == Outcome.ABANDONED.value),
        and_(code == Code.ACTION_ENDED.value, text("status") == ActionStatus.FAILED.value),
        and_(code == Code.TRANSPORT_ORDER.value, *failed),
    )


def _read_entries(engine: Engine, query: Select[Any]) -> list[HistoryEntry]:
    with engine.connect() as connection:
        return [_entry_of(row) for row in connection.execute(query)]


def _entry_of(row: Row[Any]) -> HistoryEntry:
    return {
        "id": row.id,
        "time": iso_of(row.time),
        "code": row.code,
        "robot": row.robot,
        "order": row.order_name,
        "text": row.text,
        "values": json.loads(row.details),
    }


def expire(engine: Engine, *, before: datetime, code: Code | None = None) -> int:
    """Delete up to EXPIRED_PER_COMMIT entries older than ``before``; return their number.

    Args:
        engine: the database.
        before: delete older entries.
        code: delete only this kind; None: all kinds.
    """
    table = event_table
    old = select(table.c.id).where(table.c.time < milliseconds(before)).limit(EXPIRED_PER_COMMIT)
    if code is not None:
        old = old.where(table.c.code == code.value)
    with engine.begin() as connection:
        return connection.execute(delete(table).where(table.c.id.in_(old.scalar_subquery()))).rowcount
