"""Opens the database that ``store.url`` names."""

from __future__ import annotations

from sqlalchemy import URL, Connection, Engine, create_engine, event
from sqlalchemy.engine import make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import ArgumentError, DBAPIError, InterfaceError, InternalError, OperationalError
from sqlalchemy.pool import ConnectionPoolEntry, NullPool

from nena_order_service.store.errors import StoreError
from nena_shared.database_lines import remember

PASSING = (OperationalError, InterfaceError, InternalError)
"""Errors of a database that is away, busy or full; anything else is a fault of the statement."""

SIGNS_OF_NO_ROOM = ("disk is full", "disk I/O error", "No space left on device")
"""What SQLite and PostgreSQL say of a disk that takes nothing."""
ROOM = "Look at the room on its disk, and at the disk itself"
PLACE = (
    "Name a file that can be written, sqlite:///orders.db, or a database of PostgreSQL, "
    "postgresql://USER@HOST/DATABASE"
)

UNMASKED = "an @ in a password has to stand there as %40"

STUCK_SECONDS = 3
"""How long PostgreSQL waits for a program that hangs within a transaction, before it ends the transaction."""

POSTGRESQL = "postgresql+psycopg"

PATIENCE = {
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
        # The URL may hold a password, so neither it nor what is said of its parts is repeated.
        raise unusable("it is no database URL") from None
    if "@" in (parsed.host or ""):  # the end of a password, which would be told as a host that is not found
        raise unusable(UNMASKED)
    kind = parsed.get_backend_name()
    if kind == "postgresql":
        return parsed.set(drivername=POSTGRESQL)
    if kind != "sqlite":
        message = f"{kind} is not supported"
        raise unusable(message)
    return parsed


def unusable(reason: str) -> StoreError:
    """Make the error that says why the store cannot be used, and what to do."""
    advice = ROOM if any(sign in reason for sign in SIGNS_OF_NO_ROOM) else PLACE
    return StoreError(f"store.url cannot be used: {reason}. {advice}")


def is_shared(url: str) -> bool:
    """Tell whether several order services may use this store, one active and the others standing by."""
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
        given = {name: value for name, value in PATIENCE.items() if name not in parsed.query}
        engine = create_engine(parsed, poolclass=pool, connect_args=given)
        event.listen(engine, "connect", lambda connection, _: remember(engine, connection))
    except ImportError as error:
        message = f"{error}; pip install nena-order-service[postgresql]"
        raise unusable(message) from error
    return engine


def reason_of(error: DBAPIError) -> str:
    """Give in one line what the database says."""
    return (str(error.orig).strip() or type(error.orig).__name__).splitlines()[0]


def _set_up_sqlite(connection: DBAPIConnection, _entry: ConnectionPoolEntry) -> None:
    # The driver begins transactions by itself, but not before DDL; so it is told not to.
    connection.isolation_level = None
    cursor = connection.cursor()
    for setting in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000"):
        cursor.execute(f"PRAGMA {setting}")
    cursor.close()


def _begin(connection: Connection) -> None:
    connection.exec_driver_sql("BEGIN")
