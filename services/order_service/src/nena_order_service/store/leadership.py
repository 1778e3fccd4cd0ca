"""Leadership among order services that share one PostgreSQL.

A database lock, held by a separate connection, decides which instance may be active. It becomes free as soon
as the connection ends, for whatever reason. The lock alone is no fence, because a program learns late that
its connection has ended. So each takeover raises an epoch in the store, and each commit of the active
instance checks it first: a program of another epoch cannot commit. The epoch is the Unix time in seconds, or
one more than the previous epoch, whichever is greater, so it also rises after a restore from a backup.

Messages to robots are not commits. So the active instance also holds a :class:`Lease` by its own clock, which
ends before the database frees the lock of a hanging program. Without the lease, nothing is published.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from math import inf
from secrets import token_hex

import sqlalchemy as sa
from sqlalchemy.exc import DBAPIError

from nena_order_service.store import schema
from nena_order_service.store.schema import FencedError, make_engine
from nena_shared.database_connections import close_connections

STORE_ID = "storeId"
"""Kind of the document that names the store."""

LOCK_CLASS = 5_050_022
"""First of the two numbers of the advisory lock; the second identifies the schema."""

HANG_SECONDS = 3
"""Seconds of silence after which a holder loses the lock, because it or its network hangs."""

LEASE_SECONDS = 2.0
"""Seconds for which the leader may act after the database last confirmed its lock; less than HANG_SECONDS, so
that it stops before another one can start."""

_TAKE = sa.text("SELECT pg_try_advisory_lock(:lock_class, hashtext(current_schema()))")
_SETTINGS = (f"SET idle_session_timeout = '{HANG_SECONDS}s'", "SET statement_timeout = '2s'")

_leadership = schema.leadership.c
_ROW = _leadership.id == schema.LEADERSHIP_ID
_next_epoch = sa.case(
    (_leadership.epoch < sa.bindparam("utc"), sa.bindparam("utc")),
    else_=_leadership.epoch + sa.bindparam("one"),
)
_TAKE_OVER = (
    sa.update(schema.leadership)
    .where(_ROW)
    .values(epoch=_next_epoch, commits=0, url=sa.bindparam("active_url"))
    .returning(_leadership.epoch)
)
_PASS = (
    sa.update(schema.leadership)
    .where(_ROW, _leadership.epoch == sa.bindparam("own_epoch"))
    .values(commits=sa.bindparam("next_commit"))
)


def seconds_since_boot() -> float:
    """Return a monotonic time in seconds that also counts suspend, where the system supports this."""
    return time.clock_gettime(getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))


class Lease:
    """The right to publish for :data:`LEASE_SECONDS` after each confirmation by the database.

    The thread that queries the database renews it; every thread may call :meth:`term`.
    """

    def __init__(self) -> None:
        self.not_before = -inf
        """Earliest start of the lease, by :func:`seconds_since_boot`."""
        self._until = -inf
        self._term = 0

    def term(self) -> int | None:
        """Return the number of the current term of leadership; None while this program must not publish.

        A new term begins after every interruption of the lease, however short.
        """
        return self._term if self.not_before <= seconds_since_boot() < self._until else None

    @property
    def age(self) -> float:
        """Seconds since the last confirmation; infinite without one."""
        return seconds_since_boot() - (self._until - LEASE_SECONDS)

    def renew(self, asked_at: float) -> None:
        """Extend the lease; ``asked_at`` is the time just before the database was queried."""
        if asked_at >= self._until:
            self._term += 1
        self._until = asked_at + LEASE_SECONDS

    def end(self) -> None:
        """End the lease at once, because the lock is lost."""
        self._until = -inf


class LeaderLock:
    """The lock and its connection; every method blocks, and only one thread may use it at a time."""

    def __init__(self, url: str) -> None:
        """Prepare the lock without opening a connection.

        Raises:
            StoreError: the URL names no PostgreSQL, or its driver is not installed.

        """
        self._engine = make_engine(url, pooled=False)
        self._connection: sa.Connection | None = None

    def connect(self) -> bool:
        """Connect if not connected; return whether a new connection was opened.

        Raises:
            DBAPIError: the database does not answer.

        """
        fresh = self._connection is None
        self._connected()
        return fresh

    def take(self) -> bool:
        """Try to take the lock; return whether this program has it.

        Raises:
            DBAPIError: the database does not answer.

        """
        try:
            connection = self._connected()
            taken: bool = connection.execute(_TAKE, {"lock_class": LOCK_CLASS}).scalar_one()
        except DBAPIError:
            self.release()
            raise
        return taken

    def keep(self) -> bool:
        """Renew the lock; return whether it is still held.

        The lock is lost when the connection ends; :meth:`take` then opens a new one.
        """
        if self._connection is None:
            return False
        try:
            self._connection.execute(sa.text("SELECT 1"))
        except DBAPIError:
            self.release()
            return False
        return True

    def active_url(self) -> str:
        """Return the URL of the active order service; empty if none is recorded.

        Raises:
            DBAPIError: the database does not answer.

        """
        try:
            connection = self._connected()
            if connection.execute(sa.text("SELECT to_regclass('leadership')")).scalar() is None:
                return ""
            return str(connection.execute(sa.select(_leadership.url).where(_ROW)).scalar() or "")
        except DBAPIError:
            self.release()
            raise

    def release(self) -> None:
        """Release the lock and close its connection."""
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.invalidate()  # closes it in any state
            connection.close()

    def close_connections(self) -> None:
        """End the connection from another thread; the lock's own thread may wait for an answer forever."""
        close_connections(self._engine)

    def _connected(self) -> sa.Connection:
        if self._connection is None:
            made = self._engine.connect().execution_options(isolation_level="AUTOCOMMIT")
            for setting in _SETTINGS:
                made.exec_driver_sql(setting)
            self._connection = made
        return self._connection


def _next(active_url: str) -> dict[str, object]:
    return {"active_url": active_url, "utc": int(time.time()), "one": 1}


def begin_epoch(engine: sa.Engine) -> int:
    """Start a new epoch on a store that is not shared, and return it.

    A store that cannot be written does not prevent the start: its commits report it. The epoch is then the
    Unix time alone.
    """
    try:
        with engine.begin() as connection:
            return int(connection.execute(_TAKE_OVER, _next("")).scalar_one())
    except DBAPIError:
        return int(time.time())


def store_id(engine: sa.Engine) -> str:
    """Return the ID of the store, which stays the same from the first start.

    A store that cannot be written gets an ID for this run only.
    """
    documents = schema.documents
    own = (documents.c.kind == STORE_ID, documents.c.name == "")
    try:
        with engine.begin() as connection:
            found = connection.execute(sa.select(documents.c.document).where(*own)).scalar()
            if found is None:
                found = token_hex(8)
                connection.execute(sa.insert(documents).values(kind=STORE_ID, name="", document=found))
    except DBAPIError:
        return token_hex(8)
    return str(found)


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
            return cls(connection.execute(_TAKE_OVER, _next(active_url)).scalar_one())

    def lets_pass(self, connection: sa.Connection) -> bool:
        """Return whether to make a commit; False: it was already made, and only the answer was lost.

        Call it first within the commit's transaction, whose lock keeps others from overtaking.

        Raises:
            FencedError: another order service has taken over the store.
        """
        row = connection.execute(sa.select(schema.leadership).where(_ROW).with_for_update()).one()
        if row.epoch != self.epoch:
            raise FencedError
        if row.commits > self.commits:
            return False
        connection.execute(_PASS, {"own_epoch": self.epoch, "next_commit": self.commits + 1})
        return True

    def passed(self) -> None:
        """Note that the commit was made."""
        self.commits += 1

    def is_up(self, engine: sa.Engine) -> bool:
        """Return whether this epoch is still the current one; raise DBAPIError without a database."""
        with engine.connect() as connection:
            present = connection.execute(sa.select(_leadership.epoch).where(_ROW)).scalar_one()
        return bool(present == self.epoch)
