"""The database of the store: its tables, opening it by URL, and migrating it."""

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
    """The store cannot be used; the message says why and what to do."""


class FencedError(StoreError):
    """Another order service has taken over the store; this one must not write any more."""

    def __init__(self) -> None:
        super().__init__(
            "another order service is now active on this store, so this one has exited. Restart it as standby"
        )


class StoreLostError(StoreError):
    """The database file is not the one that was opened; anything committed now is lost after a restart."""

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"{reason}, so orders could not be saved. Restore the file or a backup, then restart"
        )


VERSION_TABLE = "order_service_version"
"""Table in which Alembic stores the revision; the database may also contain the aggregator's tables."""

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
"""``document`` is the order as JSON without its history. ``change_number`` is the number of the order's last
change, counted over all orders: a client that has the changes up to a number has missed those above it."""

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
"""The sent order (what was last sent to a robot) of each order that has not ended."""

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
"""Last known position of each robot, and what it does without an order."""

path_locks = Table(
    "path_locks",
    metadata,
    Column("path", Text, primary_key=True),
    Column("locked", Boolean, nullable=False),
)
"""Paths that hosts have locked or unlocked; takes precedence over the plant model."""

documents = Table(
    "documents",
    metadata,
    Column("kind", String(20), primary_key=True),
    Column("name", String(200), primary_key=True),
    Column("document", Text, nullable=False),
)
"""Documents uploaded by hosts, such as the plant model."""

leadership = Table(
    "leadership",
    metadata,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("epoch", BigInteger, nullable=False),
    Column("commits", BigInteger, nullable=False),
    Column("url", Text, nullable=False),
)
"""One row. ``epoch`` rises with each takeover of a shared store, ``commits`` counts the leader's commits, and
``url`` is the leader's address for hosts."""

LEADERSHIP_ID = 1


log = get_logger(__name__)

FIRST = "0001"
"""Revision of stores created before migrations existed, whose tables say version 1.

After a migration they say version 2, so that releases without migrations refuse tables that they do not know.
"""


def migrate(engine: Engine) -> None:
    """Create or migrate the tables in one transaction.

    Raises:
        StoreError: the tables are from a newer release.
        SQLAlchemyError: the database rejects the change.
    """
    logging.getLogger("alembic").setLevel(logging.WARNING)
    with engine.begin() as connection:
        if connection.dialect.name == "postgresql":
            connection.execute(
                text(f"SET LOCAL idle_in_transaction_session_timeout = '{MIGRATION_STUCK_SECONDS}s'")
            )
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
"""Errors of a database that is unavailable, busy or full; any other error is a fault of the statement."""

SIGNS_OF_NO_ROOM = ("disk is full", "disk I/O error", "No space left on device")
"""Messages of SQLite and PostgreSQL about a full disk."""
ROOM = "Check the disk and its free space"
PLACE = (
    "Name a file that can be written, sqlite:///orders.db, or a database of PostgreSQL, "
    "postgresql://USER@HOST/DATABASE"
)

UNMASKED = "write an @ in a password as %40"

STUCK_SECONDS = 3
"""Seconds after which PostgreSQL ends the transaction of a program that hangs."""

MIGRATION_STUCK_SECONDS = 60
"""The same during a migration, which reads and changes documents between its statements."""

POSTGRESQL = "postgresql+psycopg"

TIMEOUTS = {
    "connect_timeout": 5,
    # A server that disappears silently is noticed within about ten seconds.
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
        StoreError: it is not a database URL, or the database is neither SQLite nor PostgreSQL.

    """
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError):
        # The URL may contain a password, so errors repeat neither it nor messages about its parts.
        raise unusable("not a database URL") from None
    if "@" in (parsed.host or ""):  # the end of a password, otherwise reported as an unknown host
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
    """Create the database engine without opening a connection.

    Raises:
        StoreError: the database is of another kind, or its driver is not installed.

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
    """Open the database and migrate its tables.

    Raises:
        StoreError: the database does not exist, cannot be written, or belongs to another release.

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
    # The driver begins transactions itself, but not before DDL, so this is turned off.
    connection.isolation_level = None
    cursor = connection.cursor()
    for setting in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000"):
        cursor.execute(f"PRAGMA {setting}")
    cursor.close()


def _begin(connection: Connection) -> None:
    connection.exec_driver_sql("BEGIN")
