"""Leadership of a shared store: wait for it, and keep it."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from sqlalchemy import Engine
from sqlalchemy.exc import DBAPIError

from nena_order_service.store.leadership import (
    HANG_SECONDS,
    LEASE_SECONDS,
    Fence,
    LeaderLock,
    Lease,
    seconds_since_boot,
)
from nena_order_service.store.schema import FencedError, open_database, reason_of, unusable
from nena_order_service.store.store import Store
from nena_shared.log import get_logger
from nena_shared.tasks import end, set_within

log = get_logger(__name__)

T = TypeVar("T")

POLL = 0.25
"""Seconds between attempts to become active, and between heartbeats of the active program."""

GRACE = 2.0
"""Seconds for the former active instance to reconnect after the database was unavailable; not less than
LEASE_SECONDS."""

NOT_ANSWERED = "the database does not answer"


class Lead:
    """The lock and the lease, renewed in a separate thread, so that a busy event loop does not lose them."""

    def __init__(self, url: str) -> None:
        """Prepare the lock without opening a connection.

        Raises:
            StoreError: the URL names no PostgreSQL, or its driver is not installed.

        """
        self._lock = LeaderLock(url)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="store lead")
        self._stopped = threading.Event()
        """Set once the lease is no longer renewed."""
        self._stood_by = False
        self.lease = Lease()
        self.active_url = ""
        """URL of the active instance while it is known and not this one."""
        self.problem = ""
        """Why the database does not answer; empty if it does."""

    async def take(self, stop: asyncio.Event) -> bool:
        """Wait until this program is the leader; return False if ``stop`` was set first.

        Raises:
            StoreError: the database cannot be reached at all.

        """
        try:
            await self._run(self._lock.connect)
        except DBAPIError as error:
            raise unusable(reason_of(error)) from error
        hanging_up = asyncio.create_task(self._hang_up_at(stop), name="hang up at the end")
        try:
            while not stop.is_set():
                if await self._try_to_take():
                    self._wait_for_the_last_one()
                    return True
                self._stood_by = True
                await set_within(stop, POLL)
        finally:
            await end(hanging_up)
        return False

    async def raise_fence(self, url: str, active_url: str) -> tuple[Engine, Fence]:
        """Open the database, migrate its tables, and fence off the previous leader.

        Raises:
            StoreError: the store cannot be used.

        """
        loop = asyncio.get_running_loop()
        holding = asyncio.create_task(self._hold(), name="hold the lead")
        try:
            engine = await loop.run_in_executor(None, open_database, url)
            return engine, await loop.run_in_executor(None, Fence.raise_for, engine, active_url)
        except DBAPIError as error:
            raise unusable(reason_of(error)) from error
        finally:
            await end(holding)

    async def keep(self, store: Store, engine: Engine, fence: Fence) -> None:
        """Renew the lease until cancelled; while the lease is uncertain, the store accepts no new orders.

        Raises:
            FencedError: another order service is the leader now.
        """
        try:
            while True:
                await self._renew_until_lost(store)
                self.lease.end()
                await self._take_again(store, engine, fence)
        finally:
            self.lease.end()
            self._stopped.set()

    async def close(self) -> None:
        """Give up leadership, even while the database does not answer."""
        self._lock.close_connections()
        await self._run(self._lock.release)
        self._thread.shutdown()

    async def _hang_up_at(self, stop: asyncio.Event) -> None:
        """Close the connection without waiting for a database that does not answer."""
        await stop.wait()
        self._lock.close_connections()

    async def _renew_until_lost(self, store: Store) -> None:
        """Renew until the lock is lost; while the database hangs, accept no orders."""
        renewing = asyncio.ensure_future(self._run(self._renew))
        while not renewing.done():
            await asyncio.wait((renewing,), timeout=POLL)
            late = self.lease.age > HANG_SECONDS
            if late and not store.lead_problem:
                log.warning(NOT_ANSWERED, seconds=HANG_SECONDS)
            store.lead_problem = NOT_ANSWERED if late else ""
        await renewing

    def _renew(self) -> None:
        """Renew the lease as long as the lock is held; runs in the thread of the lock."""
        while not self._stopped.is_set():
            asked_at = seconds_since_boot()
            if not self._lock.keep():
                return
            self.lease.renew(asked_at)
            self._stopped.wait(POLL)

    def _wait_for_the_last_one(self) -> None:
        """Delay the lease until that of the former leader has ended, however it lost the lock."""
        if self._stood_by:
            self.lease.not_before = seconds_since_boot() + LEASE_SECONDS

    async def _hold(self) -> None:
        """Renew the lease while the store is being prepared, which may take longer than its timeout."""
        while True:
            await self._run(self._lock.keep)
            await asyncio.sleep(POLL)

    async def _try_to_take(self) -> bool:
        try:
            if await self._run(self._lock.connect):
                # The database was unavailable: the former leader gets the lock again if it still runs.
                await asyncio.sleep(GRACE)
            taken = await self._run(self._lock.take)
            self.active_url = "" if taken else await self._run(self._lock.active_url)
        except DBAPIError as error:
            self._set_problem(reason_of(error))
            return False
        self._set_problem("")
        return taken

    async def _take_again(self, store: Store, engine: Engine, fence: Fence) -> None:
        log.warning("connection of the instance lock lost; taking the lock again")
        store.lead_problem = "the connection to the database was lost"
        while True:
            try:
                taken = await self._run(self._lock.take)
                if not await self._run(lambda: fence.is_up(engine)):
                    raise FencedError
            except DBAPIError as error:
                store.lead_problem = reason_of(error)
            else:
                if taken:
                    break
            await asyncio.sleep(POLL)
        store.lead_problem = ""
        log.info("instance lock kept")

    def _set_problem(self, problem: str) -> None:
        if problem and not self.problem:
            log.warning("standing by, but the database does not answer", reason=problem)
        self.problem = problem

    async def _run(self, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._thread, work)
