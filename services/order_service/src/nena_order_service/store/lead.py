"""The lead of a store that several order services share: waits for it, and keeps it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from sqlalchemy import Engine
from sqlalchemy.exc import DBAPIError

from nena_order_service.store.database import open_database
from nena_order_service.store.engine import reason_of, unusable
from nena_order_service.store.errors import FencedError
from nena_order_service.store.leadership import HANG_SECONDS, Fence, LeaderLock
from nena_order_service.store.store import Store
from nena_shared.log import get_logger
from nena_shared.tasks import end

log = get_logger(__name__)

T = TypeVar("T")

POLL = 0.25
"""Seconds between tries to take the lead, and between signs of life of the one who has it."""

GRACE = 2.0
"""Seconds that a standby leaves to the active one to come back, after a database that was away."""


class Lead:
    """The lock in a thread of its own, so that an event loop that is busy does not lose it."""

    def __init__(self, url: str) -> None:
        """Prepare it; nothing is opened yet.

        Raises:
            StoreError: the URL names no PostgreSQL, or its driver is not installed.

        """
        self._lock = LeaderLock(url)
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="store lead")
        self.active_url = ""
        """While another one is active: where it is, as far as it has said so."""
        self.problem = ""
        """Why the database cannot be asked; empty when it can."""

    async def take(self, stop: asyncio.Event) -> bool:
        """Wait until this program has the lead; False: it is to stop before.

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
                    return True
                await _pause(stop, POLL)
        finally:
            await end(hanging_up)
        return False

    async def raise_fence(self, url: str, active_url: str) -> tuple[Engine, Fence]:
        """Open the database, bring its tables up to date, and keep from now on whoever wrote before from it.

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
        """Keep the lead until cancelled; while it is not sure, the store takes no new orders.

        Raises:
            FencedError: another order service has it now.

        """
        while True:
            await asyncio.sleep(POLL)
            if not await self._is_kept(store):
                await self._take_again(store, engine, fence)

    async def close(self) -> None:
        """Let another one have the lead, also while the database says nothing."""
        self._lock.hang_up()
        await self._run(self._lock.release)
        self._thread.shutdown()

    async def _hang_up_at(self, stop: asyncio.Event) -> None:
        """Let a database that says nothing keep nobody from ending."""
        await stop.wait()
        self._lock.hang_up()

    async def _is_kept(self, store: Store) -> bool:
        """Ask whether the lead is kept; a database that hangs says neither, and takes no orders meanwhile."""
        asked = asyncio.ensure_future(self._run(self._lock.keep))
        answered, _ = await asyncio.wait((asked,), timeout=HANG_SECONDS)
        if not answered:
            store.lead_problem = "the database does not answer"
            log.warning("the database does not answer", seconds=HANG_SECONDS)
        kept = await asked
        if kept:
            store.lead_problem = ""
        return kept

    async def _hold(self) -> None:
        """Give signs of life while the store is made ready, which may take longer than silence is borne."""
        while True:
            await self._run(self._lock.keep)
            await asyncio.sleep(POLL)

    async def _try_to_take(self) -> bool:
        try:
            if await self._run(self._lock.connect):
                # The database was away: the one that was active shall have it again if it is still there.
                await asyncio.sleep(GRACE)
            taken = await self._run(self._lock.take)
            self.active_url = "" if taken else await self._run(self._lock.active_url)
        except DBAPIError as error:
            self._set_problem(reason_of(error))
            return False
        self._set_problem("")
        return taken

    async def _take_again(self, store: Store, engine: Engine, fence: Fence) -> None:
        log.warning("the connection that holds the lead has ended; taking it again")
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
        log.info("the lead is kept")

    def _set_problem(self, problem: str) -> None:
        if problem and not self.problem:
            log.warning("standing by, but the database does not answer", reason=problem)
        self.problem = problem

    async def _run(self, work: Callable[[], T]) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._thread, work)


async def _pause(stop: asyncio.Event, seconds: float) -> None:
    try:
        async with asyncio.timeout(seconds):
            await stop.wait()
    except TimeoutError:
        return
