"""The database of the store: its tables, opening it by URL, and migrating it to the present tables."""

from __future__ import annotations

import logging

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.util import CommandError
from sqlalchemy import (
    URL,
    BigInteger,
    Boolean,
    Column,
    Connection,
    Engine,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    create_engine,
    event,
    inspect,
    text,
)
from sqlalchemy.engine import make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import (
    ArgumentError,
    DBAPIError,
    InterfaceError,
    InternalError,
    OperationalError,
    SQLAlchemyError,
)
from sqlalchemy.pool import ConnectionPoolEntry, NullPool

from nena_shared.database_lines import remember
from nena_shared.log import get_logger
from nena_shared.program import StartError


class StoreError(StartError):
    """The store cannot be used; the text says why, and what to do."""


class FencedError(StoreError):
    """Another order service has taken over the store; this one must not write any more."""

    def __init__(self) -> None:
        super().__init__(
            "another order service is now active on this store, so this one has exited. Restart it as standby"
        )


class StoreLostError(StoreError):
    """The database file is not the one that was opened; what is committed there is gone after a restart."""

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"{reason}, so orders could not be saved. Restore the file or a backup, then restart"
        )


VERSION_TABLE = "order_service_version"
"""Where Alembic keeps the revision; a database may hold tables of other programs too, the aggregator's."""

metadata = MetaData()

transport_orders = Table(
    "transport_orders",
    metadata,
    Column("number", BigInteger, primary_key=True, autoincrement=False),
    Column("name", String(200), nullable=False, unique=True),
    Column("idempotency_key", String(200), unique=True),
    Column("state", String(20), nullable=False),
    Column("intended_vehicle", String(200)),
    Column("document", Text, nullable=False),
    Column("change_number", BigInteger, nullable=False, server_default="0"),
    Index("transport_orders_by_state", "state", "number"),
    Index("transport_orders_by_vehicle", "intended_vehicle", "number"),
    Index("transport_orders_by_change", "change_number"),
)
"""``document`` is the order as JSON, without its history; ``change_number`` counts the changes of all orders
and is that of this order's last one: who followed the orders up to some number has missed those above it."""

history = Table(
    "history",
    metadata,
    Column("order_number", BigInteger, ForeignKey("transport_orders.number"), primary_key=True),
    Column("entry", Integer, primary_key=True),
    Column("document", Text, nullable=False),
)

missions = Table(
    "missions",
    metadata,
    Column("order_number", BigInteger, ForeignKey("transport_orders.number"), primary_key=True),
    Column("document", Text, nullable=False),
)
"""What was last sent to a robot for each order that is not at its end."""

order_sequences = Table(
    "order_sequences",
    metadata,
    Column("number", BigInteger, primary_key=True, autoincrement=False),
    Column("name", String(200), nullable=False, unique=True),
    Column("idempotency_key", String(200), unique=True),
    Column("finished", Boolean, nullable=False),
    Column("intended_vehicle", String(200)),
    Column("document", Text, nullable=False),
    Index("order_sequences_by_finished", "finished", "number"),
)
"""``document`` is the order sequence as JSON, with its history."""

vehicles = Table(
    "vehicles",
    metadata,
    Column("robot", String(400), primary_key=True),
    Column("document", Text, nullable=False),
)
"""Where each robot was at last, and what it does without an order."""

path_locks = Table(
    "path_locks",
    metadata,
    Column("path", Text, primary_key=True),
    Column("locked", Boolean, nullable=False),
)
"""Paths that hosts have locked or unlocked; it counts more than the plant model."""

documents = Table(
    "documents",
    metadata,
    Column("kind", String(20), primary_key=True),
    Column("name", String(200), primary_key=True),
    Column("document", Text, nullable=False),
)
"""What hosts have put here as a whole: the plant model."""

leadership = Table(
    "leadership",
    metadata,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("epoch", BigInteger, nullable=False),
    Column("commits", BigInteger, nullable=False),
    Column("url", Text, nullable=False),
)
"""One row. ``epoch`` counts the takings-over of a store that several order services share, ``commits`` the
commits of the one that is active, ``url`` is where hosts find it."""

LEADERSHIP_ID = 1


log = get_logger(__name__)

FIRST = "0001"
"""The tables of stores that were made before there were migrations; they say version 1.

Brought up to date they say 2: releases from then look there, and would work on tables that they do not know.
"""


def migrate(engine: Engine) -> None:
    """Create or migrate the tables in one transaction.

    Raises:
        StoreError: the tables are from a newer release.
        SQLAlchemyError: the database rejects the change.
    """
    logging.getLogger("alembic").setLevel(logging.WARNING)
    with engine.begin() as connection:
        config = Config()
        config.set_main_option("script_location", "nena_order_service.store:migrations")
        config.attributes["connection"] = connection
        before = _revision(connection)
        try:
            if _is_from_before_migrations(connection):
                command.stamp(config, FIRST)
                connection.execute(text("UPDATE schema_version SET version = 2"))
            command.upgrade(config, "head")
        except CommandError as error:
            message = (
                f"the store belongs to another release ({error}): "
                "use that release, restore a backup, or set another store.url"
            )
            raise StoreError(message) from error
        if before != (now := _revision(connection)):
            log.info("migrating the tables of the store", before=before, now=now)


def _revision(connection: Connection) -> str | None:
    options = {"version_table": VERSION_TABLE}
    return MigrationContext.configure(connection, opts=options).get_current_revision()


def _is_from_before_migrations(connection: Connection) -> bool:
    tables = set(inspect(connection).get_table_names())
    if VERSION_TABLE in tables or not tables >= {"schema_version", "transport_orders"}:
        return False
    version = connection.execute(text("SELECT version FROM schema_version")).scalar()
    if version == 1:
        return True
    message = (
        f"the store has tables of version {version}, which no release has created: "
        "restore a backup, or set another store.url"
    )
    raise StoreError(message)


PASSING = (OperationalError, InterfaceError, InternalError)
"""Errors of a database that is away, busy or full; anything else is a fault of the statement."""

SIGNS_OF_NO_ROOM = ("disk is full", "disk I/O error", "No space left on device")
"""Messages of SQLite and PostgreSQL about a full disk."""
ROOM = "Check the disk and its free space"
PLACE = (
    "Name a file that can be written, sqlite:///orders.db, or a database of PostgreSQL, "
    "postgresql://USER@HOST/DATABASE"
)

UNMASKED = "write an @ in a password as %40"

STUCK_SECONDS = 3
"""How long PostgreSQL waits for a program that hangs within a transaction, before it ends the transaction."""

POSTGRESQL = "postgresql+psycopg"

TIMEOUTS = {
    "connect_timeout": 5,
    # A server that is gone without a word is noticed within about ten seconds.
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 2,
    "tcp_user_timeout": 10_000,
    "options": f"-c idle_in_transaction_session_timeout={STUCK_SECONDS * 1000}",
}
"""Arguments of libpq, which the URL may override."""


def parse_url(url: str) -> URL:
    """Read a database URL.

    Raises:
        StoreError: it is none, or of another database than SQLite and PostgreSQL.

    """
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError):
        # The URL may contain a password, so neither it nor messages about its parts are repeated.
        raise unusable("not a database URL") from None
    if "@" in (parsed.host or ""):  # the end of a password, which would be reported as an unknown host
        raise unusable(UNMASKED)
    kind = parsed.get_backend_name()
    if kind == "postgresql":
        return parsed.set(drivername=POSTGRESQL)
    if kind != "sqlite":
        message = f"{kind} is not supported"
        raise unusable(message)
    return parsed


def unusable(reason: str) -> StoreError:
    """Return the error for an unusable store, with the reason and what to do."""
    advice = ROOM if any(sign in reason for sign in SIGNS_OF_NO_ROOM) else PLACE
    return StoreError(f"store.url cannot be used: {reason}. {advice}")


def is_shared(url: str) -> bool:
    """Return whether several order services may use this store, one active and the others on standby."""
    return parse_url(url).get_backend_name() == "postgresql"


def make_engine(url: str, *, pooled: bool = True) -> Engine:
    """Prepare access to the database; nothing is opened yet.

    Raises:
        StoreError: it is of another kind, or its driver is not installed.

    """
    parsed = parse_url(url)
    pool = None if pooled else NullPool
    try:
        if parsed.get_backend_name() == "sqlite":
            engine = create_engine(parsed, poolclass=pool)
            event.listen(engine, "connect", _set_up_sqlite)
            event.listen(engine, "begin", _begin)
            return engine
        given = {name: value for name, value in TIMEOUTS.items() if name not in parsed.query}
        engine = create_engine(parsed, poolclass=pool, connect_args=given)
        event.listen(engine, "connect", lambda connection, _: remember(engine, connection))
    except ImportError as error:
        message = f"{error}; pip install nena-order-service[postgresql]"
        raise unusable(message) from error
    return engine


def open_database(url: str) -> Engine:
    """Open the database and bring its tables to what this program needs.

    Raises:
        StoreError: no such database, it cannot be written, or its tables are of another release.

    """
    engine = make_engine(url)
    try:
        migrate(engine)
    except SQLAlchemyError as error:
        engine.dispose()
        raise unusable(reason_of(error) if isinstance(error, DBAPIError) else str(error)) from error
    return engine


def reason_of(error: DBAPIError) -> str:
    """Return the database's error message in one line."""
    return (str(error.orig).strip() or type(error.orig).__name__).splitlines()[0]


def _set_up_sqlite(connection: DBAPIConnection, _entry: ConnectionPoolEntry) -> None:
    # The driver begins transactions itself, but not before DDL; so this is turned off.
    connection.isolation_level = None
    cursor = connection.cursor()
    for setting in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000"):
        cursor.execute(f"PRAGMA {setting}")
    cursor.close()


def _begin(connection: Connection) -> None:
    connection.exec_driver_sql("BEGIN")
