"""The database of the store: its tables, opening it by URL, and migrating it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, Final

import sqlalchemy as sa
from sqlalchemy import exc
from sqlalchemy.engine import make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.pool import ConnectionPoolEntry, NullPool

from nena_shared.database_connections import register_connection
from nena_shared.log import get_logger
from nena_shared.tasks import StartError

log = get_logger(__name__)


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
"""Table with the revision of the tables; the database may also contain the aggregator's tables."""

metadata = sa.MetaData()

transport_orders = sa.Table(
    "transport_orders",
    metadata,
    sa.Column("number", sa.BigInteger, primary_key=True, autoincrement=False),
    sa.Column("name", sa.String(200), nullable=False, unique=True),
    sa.Column("idempotency_key", sa.String(200), unique=True),
    sa.Column("state", sa.String(20), nullable=False),
    sa.Column("intended_vehicle", sa.String(200)),
    sa.Column("document", sa.Text, nullable=False),
    sa.Column("change_number", sa.BigInteger, nullable=False, server_default="0"),
    sa.Index("transport_orders_by_state", "state", "number"),
    sa.Index("transport_orders_by_vehicle", "intended_vehicle", "number"),
    sa.Index("transport_orders_by_change", "change_number"),
)
"""``document`` is the order as JSON without its history. ``change_number`` is the number of the order's last
change, counted over all orders: a client that has the changes up to a number has missed those above it."""

history = sa.Table(
    "history",
    metadata,
    sa.Column("order_number", sa.BigInteger, sa.ForeignKey("transport_orders.number"), primary_key=True),
    sa.Column("entry", sa.Integer, primary_key=True),
    sa.Column("document", sa.Text, nullable=False),
)

drives = sa.Table(
    "drives",
    metadata,
    sa.Column("robot", sa.String(400), primary_key=True),
    sa.Column("order_number", sa.BigInteger, sa.ForeignKey("transport_orders.number")),
    sa.Column("document", sa.Text, nullable=False),
)
"""The drive that was last sent to each robot, until it has ended; without an order, it makes room."""

order_sequences = sa.Table(
    "order_sequences",
    metadata,
    sa.Column("number", sa.BigInteger, primary_key=True, autoincrement=False),
    sa.Column("name", sa.String(200), nullable=False, unique=True),
    sa.Column("idempotency_key", sa.String(200), unique=True),
    sa.Column("finished", sa.Boolean, nullable=False),
    sa.Column("intended_vehicle", sa.String(200)),
    sa.Column("document", sa.Text, nullable=False),
    sa.Index("order_sequences_by_finished", "finished", "number"),
)
"""``document`` is the order sequence as JSON, with its history."""

vehicles = sa.Table(
    "vehicles",
    metadata,
    sa.Column("robot", sa.String(400), primary_key=True),
    sa.Column("document", sa.Text, nullable=False),
)
"""What is known of each robot before it reports again, such as what it holds."""

path_locks = sa.Table(
    "path_locks",
    metadata,
    sa.Column("path", sa.Text, primary_key=True),
    sa.Column("locked", sa.Boolean, nullable=False),
)
"""Paths that hosts have locked or unlocked; takes precedence over the plant model."""

documents = sa.Table(
    "documents",
    metadata,
    sa.Column("kind", sa.String(20), primary_key=True),
    sa.Column("name", sa.String(200), primary_key=True),
    sa.Column("document", sa.Text, nullable=False),
)
"""Documents uploaded by hosts, such as the plant model, peripheral jobs, and the ends of the audit trail."""

audit = sa.Table(
    "audit",
    metadata,
    sa.Column("sequence", sa.BigInteger, primary_key=True, autoincrement=False),
    sa.Column("time", sa.BigInteger, nullable=False),
    sa.Column("user_name", sa.String(200), nullable=False),
    sa.Column("interface", sa.String(20), nullable=False),
    sa.Column("client", sa.String(100), nullable=False),
    sa.Column("operation", sa.String(200), nullable=False),
    sa.Column("object_kind", sa.String(50), nullable=False),
    sa.Column("object_name", sa.String(200), nullable=False),
    sa.Column("request", sa.Text, nullable=False),
    sa.Column("state_before", sa.Text, nullable=False),
    sa.Column("state_after", sa.Text, nullable=False),
    sa.Column("result", sa.String(20), nullable=False),
    sa.Column("reason", sa.Text, nullable=False),
    sa.Column("hash", sa.String(64), nullable=False),
    sa.Index("audit_by_time", "time"),
    sa.Index("audit_by_user", "user_name", "sequence"),
    sa.Index("audit_by_operation", "operation", "sequence"),
    sa.Index("audit_by_object", "object_name", "sequence"),
)
"""The audit trail. ``time`` is in ms since 1970; :mod:`nena_shared.fleet_api.audit` has the ``hash``."""

leadership = sa.Table(
    "leadership",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("epoch", sa.BigInteger, nullable=False),
    sa.Column("commits", sa.BigInteger, nullable=False),
    sa.Column("url", sa.Text, nullable=False),
)
"""One row. ``epoch`` rises with each takeover of a shared store, ``commits`` counts the leader's commits, and
``url`` is the leader's address for hosts."""

LEADERSHIP_ID = 1


REVISION = "0009"
"""Revision of the tables above; a change of them needs the next one, and a step from this one in STEPS."""

_version = sa.Table(
    VERSION_TABLE,
    sa.MetaData(),
    sa.Column("version_num", sa.String(32), nullable=False),
    sa.PrimaryKeyConstraint("version_num", name=f"{VERSION_TABLE}_pkc"),
)


def migrate(engine: sa.Engine) -> None:
    """Create or upgrade the tables in one transaction.

    Raises:
        StoreError: the tables are from another release.
        SQLAlchemyError: the database rejects the change.
    """
    with engine.begin() as connection:
        revision = None
        if sa.inspect(connection).has_table(VERSION_TABLE):
            revision = connection.execute(sa.select(_version.c.version_num)).scalar()
        if revision == REVISION:
            return
        if revision is None:
            metadata.create_all(connection, checkfirst=False)
            connection.execute(leadership.insert().values(id=LEADERSHIP_ID, epoch=0, commits=0, url=""))
            _version.create(connection)
            connection.execute(_version.insert().values(version_num=REVISION))
        elif revision in STEPS:
            STEPS[revision](connection)
            connection.execute(_version.update().values(version_num=REVISION))
        else:
            raise StoreError(
                f"the store belongs to another release (revision {revision}): "
                "use that release, restore a backup, or set another store.url"
            )
        log.info("store migrated", before=revision, now=REVISION)


def _sent_orders_to_drives(connection: sa.Connection) -> None:
    """Upgrade revision 0008: drives were sent orders, those that make room were kept with their vehicles."""
    drives.create(connection)
    for number, document in connection.execute(
        sa.text("SELECT order_number, document FROM sent_orders")
    ).all():
        _insert_drive(connection, number, json.loads(document))
    connection.execute(sa.text("DROP TABLE sent_orders"))
    for robot, document in connection.execute(sa.select(vehicles)).all():
        record = json.loads(document)
        if relocation := record.pop("evasion", None):
            _insert_drive(connection, None, relocation)
            changed = vehicles.update().where(vehicles.c.robot == robot)
            connection.execute(changed.values(document=json.dumps(record)))


def _insert_drive(connection: sa.Connection, order_number: int | None, sent_order: dict[str, Any]) -> None:
    state = "ACCEPTED" if sent_order.pop("accepted") else "SENT"
    robot = f"{sent_order['manufacturer']}/{sent_order['serial_number']}"
    document = json.dumps({**sent_order, "order_number": order_number, "state": state})
    connection.execute(drives.insert().values(robot=robot, order_number=order_number, document=document))


STEPS: Final[Mapping[str, Callable[[sa.Connection], None]]] = {"0008": _sent_orders_to_drives}
"""How tables of older revisions become those above."""


TRANSIENT_ERRORS = (exc.OperationalError, exc.InterfaceError, exc.InternalError)
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


def parse_url(url: str) -> sa.URL:
    """Read a database URL.

    Raises:
        StoreError: it is not a database URL, or the database is neither SQLite nor PostgreSQL.
    """
    try:
        parsed = make_url(url)
    except (exc.ArgumentError, ValueError):
        # The URL may contain a password, so errors repeat neither it nor messages about its parts.
        raise unusable("not a database URL") from None
    if "@" in (parsed.host or ""):  # the end of a password, otherwise reported as an unknown host
        raise unusable(UNMASKED)
    kind = parsed.get_backend_name()
    if kind == "postgresql":
        return parsed.set(drivername=POSTGRESQL)
    if kind != "sqlite":
        raise unusable(f"{kind} is not supported")
    return parsed


def unusable(reason: str) -> StoreError:
    """Return the error for an unusable store, with the reason and what to do."""
    advice = ROOM if any(sign in reason for sign in SIGNS_OF_NO_ROOM) else PLACE
    return StoreError(f"store.url cannot be used: {reason}. {advice}")


def is_shared(url: str) -> bool:
    """Return whether several order services may use this store, one active and the others on standby."""
    return parse_url(url).get_backend_name() == "postgresql"


def make_engine(url: str, *, pooled: bool = True) -> sa.Engine:
    """Create the database engine without opening a connection.

    Raises:
        StoreError: the database is of another kind, or its driver is not installed.
    """
    parsed = parse_url(url)
    pool = None if pooled else NullPool
    try:
        if parsed.get_backend_name() == "sqlite":
            engine = sa.create_engine(parsed, poolclass=pool)
            sa.event.listen(engine, "connect", _set_up_sqlite)
            sa.event.listen(engine, "begin", lambda connection: connection.exec_driver_sql("BEGIN"))
            return engine
        timeouts = {name: value for name, value in TIMEOUTS.items() if name not in parsed.query}
        engine = sa.create_engine(parsed, poolclass=pool, connect_args=timeouts)
        sa.event.listen(engine, "connect", lambda connection, _: register_connection(engine, connection))
    except ImportError as error:
        raise unusable(f"{error}; install the extra nena-order-service[postgresql]") from error
    return engine


def open_database(url: str) -> sa.Engine:
    """Open the database and migrate its tables.

    Raises:
        StoreError: the database does not exist, cannot be written, or belongs to another release.
    """
    engine = make_engine(url)
    try:
        migrate(engine)
    except exc.SQLAlchemyError as error:
        engine.dispose()
        raise unusable(reason_of(error) if isinstance(error, exc.DBAPIError) else str(error)) from error
    return engine


def reason_of(error: exc.DBAPIError) -> str:
    """Return the database's error message in one line."""
    return (str(error.orig).strip() or type(error.orig).__name__).splitlines()[0]


def _set_up_sqlite(connection: DBAPIConnection, _entry: ConnectionPoolEntry) -> None:
    # The driver begins transactions itself, but not before DDL, so this is turned off: a migration that
    # fails halfway must leave the tables as they were.
    connection.isolation_level = None
    cursor = connection.cursor()
    # In WAL mode, readers do not wait for the writer. NORMAL instead of FULL would lose the last commits
    # when the power fails.
    for setting in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000"):
        cursor.execute(f"PRAGMA {setting}")
    cursor.close()
