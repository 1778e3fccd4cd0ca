"""Leadership: at most one order service commands the robots of a store.

**One mechanism on PostgreSQL**: an advisory lock on a connection of its own. The server frees it when the
connection ends, for whatever reason, and ends the connection of a holder that is silent for
:data:`HANG_SECONDS`. Another order service with the same database stands by until it gets the lock.

**Why two never act at once.** A holder learns late that its lock is gone, because it hung or its network did.
Until then it may do two things, and each has its limit:

1. *Commit.* Each takeover raises the epoch in the table ``leadership``, and each commit locks that row and
   checks the epoch first (:class:`Fence`). A takeover waits for a commit in progress; after it, no commit of
   an older epoch succeeds. What is new for robots or hosts is sent only after its commit.
2. *Send again* what was committed. So the MQTT link asks at each write to its socket for a :class:`Lease`,
   which lasts for :data:`LEASE_SECONDS` from before the database was asked, by a clock that also counts
   suspend. The server frees the lock of a silent holder HANG_SECONDS after it was asked, later than the end
   of the lease. If it frees the lock earlier, as at a broken connection, the standby that gets it sends
   nothing for LEASE_SECONDS. So the former lease has ended in both cases. Only clocks of the same rate are
   needed, not of the same time. A program that gets the lock as soon as it starts does not wait: a leader
   whose connection was ended sees that within :data:`POLL` seconds, before a start is complete.

**A lost database.** Without the lease nothing is sent. The former leader has :data:`GRACE` seconds to connect
again before a standby tries; if a standby was faster, the leader sees the newer epoch and exits.

**Two stores, one fleet** share neither lock nor epoch; ``fleet/guard.py`` guards against them at the broker.
A SQLite store is one file of one machine, which ``instance_lock.py`` locks.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from math import inf
from secrets import token_hex
from typing import Any, TypeVar

import sqlalchemy as sa
from sqlalchemy.exc import DBAPIError

from nena_order_service.store import schema
from nena_order_service.store.database import LEADERSHIP_ROW, Fence
from nena_order_service.store.schema import FencedError, make_engine, open_database, reason_of, unusable
from nena_order_service.store.store import Store
from nena_shared.database_connections import close_connections
from nena_shared.log import get_logger
from nena_shared.tasks import end

log = get_logger(__name__)

T = TypeVar("T")

STORE_ID = "storeId"
"""Kind of the document that names the store."""

LOCK_CLASS = 5_050_022
"""First of the two numbers of the advisory lock; the second identifies the schema."""

HANG_SECONDS = 3
"""Seconds of silence after which a holder loses the lock, because it or its network hangs."""

LEASE_SECONDS = 2.0
"""Seconds for which the leader may act after it asked the database that confirmed its lock."""

POLL = 0.25
"""Seconds between two attempts of a standby, and between two questions of the leader."""

GRACE = 2.0
"""Seconds for the former leader to connect again after the database was unavailable."""

NOT_ANSWERED = "the database does not answer"

_TAKE = sa.text("SELECT pg_try_advisory_lock(:lock_class, hashtext(current_schema()))")
# idle_session_timeout (since PostgreSQL 14) frees the lock of a holder that hangs between two questions.
_SETTINGS = (f"SET idle_session_timeout = '{HANG_SECONDS}s'", "SET statement_timeout = '2s'")


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


class Leadership:
    """Waits for the lock of a shared store, and keeps it in a thread that a busy loop does not delay."""

    def __init__(self, url: str) -> None:
        """Prepare it without opening a connection.

        Raises:
            StoreError: the URL names no PostgreSQL, or its driver is not installed.
        """
        self._url = url
        self._engine = make_engine(url, pooled=False)
        self._connection: sa.Connection | None = None
        """Holds the lock; used by the thread only."""
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="leadership")
        self._ended = threading.Event()
        self._renewing: asyncio.Future[None]
        self.lease = Lease()
        self.active_url = ""
        """URL of the active instance while it is known and not this one."""
        self.problem = ""
        """Why the database does not answer a standby; empty if it does."""

    async def win(self, stop: asyncio.Event) -> bool:
        """Wait until this program is the leader; return False if ``stop`` was set first.

        Raises:
            StoreError: the database cannot be reached at all.
        """
        winning = asyncio.create_task(self._win_lock(), name="stand by")
        stopping = asyncio.create_task(stop.wait(), name="wait for the end")
        try:
            await asyncio.wait((winning, stopping), return_when=asyncio.FIRST_COMPLETED)
            if not stop.is_set():
                winning.result()
            return not stop.is_set()
        finally:
            await end(winning, stopping)  # a question to a database that hangs ends with its connection

    async def take_over(self, own_url: str) -> tuple[sa.Engine, Fence]:
        """Open the database, upgrade its tables, and fence off the previous leader.

        Raises:
            StoreError: the store cannot be used.
        """
        engine = await asyncio.to_thread(open_database, self._url)
        try:
            return engine, await asyncio.to_thread(Fence.raise_for, engine, own_url)
        except DBAPIError as error:
            raise unusable(reason_of(error)) from error

    async def keep(self, store: Store, engine: sa.Engine, fence: Fence) -> None:
        """Renew the lease until cancelled; while it is uncertain, the store accepts no new orders.

        Raises:
            FencedError: another order service is the leader now.
        """
        try:
            while True:
                # Wait until the lock is lost; while the database hangs, accept no orders.
                while not self._renewing.done():
                    await asyncio.wait((self._renewing,), timeout=POLL)
                    late = self.lease.age > HANG_SECONDS
                    if late and not store.lead_problem:
                        log.warning(NOT_ANSWERED, seconds=HANG_SECONDS)
                    store.lead_problem = NOT_ANSWERED if late else ""
                await self._renewing
                await self._win_again(store, engine, fence)
        finally:
            self.lease.end()
            self._ended.set()

    async def close(self) -> None:
        """Give up the lead, even while the database does not answer."""
        self._ended.set()
        close_connections(self._engine)
        await self._run_in_thread(self._hang_up)
        self._thread.shutdown()

    async def _win_lock(self) -> None:
        try:
            await self._run_in_thread(self._open_connection)
        except DBAPIError as error:
            raise unusable(reason_of(error)) from error
        stood_by = False
        while not await self._try_to_win():
            stood_by = True
            await asyncio.sleep(POLL)
        if stood_by:  # the lease of the former leader may last that long, however it lost the lock
            self.lease.not_before = seconds_since_boot() + LEASE_SECONDS
        self._renewing = asyncio.ensure_future(self._run_in_thread(self._renew_lease))

    async def _try_to_win(self) -> bool:
        try:
            is_new = self._connection is None
            await self._run_in_thread(self._open_connection)
            if is_new:
                # The database was unavailable: the former leader gets the lock again if it still runs.
                await asyncio.sleep(GRACE)
            won = await self._run_in_thread(self._take_lock)
            self.active_url = "" if won else await self._run_in_thread(self._read_active_url)
        except DBAPIError as error:
            if not self.problem:
                log.warning("standing by, but the database does not answer", reason=reason_of(error))
            self.problem = reason_of(error)
            return False
        self.problem = ""
        return won

    async def _win_again(self, store: Store, engine: sa.Engine, fence: Fence) -> None:
        log.warning("connection of the instance lock lost; taking the lock again")
        store.lead_problem = "the connection to the database was lost"
        won = False
        while not won:
            try:
                won = await self._run_in_thread(self._take_lock)
                # The lock may be free again although another program had it meanwhile: the epoch tells.
                if not await self._run_in_thread(lambda: fence.is_current(engine)):
                    raise FencedError
            except DBAPIError as error:
                won, store.lead_problem = False, reason_of(error)
            if not won:
                await asyncio.sleep(POLL)
        self._renewing = asyncio.ensure_future(self._run_in_thread(self._renew_lease))
        store.lead_problem = ""
        log.info("instance lock kept")

    async def _run_in_thread(self, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._thread, work)

    # In the thread

    def _renew_lease(self) -> None:
        """Renew the lease as long as the lock is held."""
        while not self._ended.is_set():
            asked_at = seconds_since_boot()
            try:
                if self._connection is None:
                    break
                self._ask_database(sa.text("SELECT 1"))
            except DBAPIError:
                break
            self.lease.renew(asked_at)
            self._ended.wait(POLL)
        self.lease.end()

    def _take_lock(self) -> bool:
        # Without waiting: a waiting query would occupy the thread, and the server's timeout would end it.
        return bool(self._ask_database(_TAKE, lock_class=LOCK_CLASS))

    def _read_active_url(self) -> str:
        if self._ask_database(sa.text("SELECT to_regclass('leadership')")) is None:
            return ""
        return str(self._ask_database(sa.select(schema.leadership.c.url).where(LEADERSHIP_ROW)) or "")

    def _ask_database(self, statement: sa.Executable, **values: object) -> Any:  # noqa: ANN401 - of any column
        try:
            return self._open_connection().execute(statement, values).scalar()
        except DBAPIError:
            self._hang_up()
            raise

    def _open_connection(self) -> sa.Connection:
        if self._connection is None:
            connection = self._engine.connect().execution_options(isolation_level="AUTOCOMMIT")
            for setting in _SETTINGS:
                connection.exec_driver_sql(setting)
            self._connection = connection
        return self._connection

    def _hang_up(self) -> None:
        """End the connection, and with it the lock."""
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.invalidate()  # closes it in any state
            connection.close()


def begin_epoch(engine: sa.Engine) -> int:
    """Start a new epoch on a store that is not shared, and return it.

    A store that cannot be written does not prevent the start: its commits report it. The epoch is then the
    Unix time alone.
    """
    try:
        return Fence.raise_for(engine, "").epoch
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
            identifier = connection.execute(sa.select(documents.c.document).where(*own)).scalar()
            if identifier is None:
                identifier = token_hex(8)
                connection.execute(sa.insert(documents).values(kind=STORE_ID, name="", document=identifier))
    except DBAPIError:
        return token_hex(8)
    return str(identifier)
