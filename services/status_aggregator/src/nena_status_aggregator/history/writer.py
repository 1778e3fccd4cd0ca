"""Writes what happens, in batches, beside the event loop."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from functools import partial
from typing import TypeVar

from sqlalchemy import Engine
from sqlalchemy.exc import DataError, IntegrityError, SQLAlchemyError

from nena_shared.clock import Clock
from nena_shared.database_lines import hang_up
from nena_shared.log import get_logger
from nena_status_aggregator.fleet.events import Code, Happening
from nena_status_aggregator.history import database
from nena_status_aggregator.history.database import HistoryError
from nena_status_aggregator.settings import HistorySettings

log = get_logger(__name__)

R = TypeVar("R")

LONGEST_PAUSE = 10.0
"""Seconds between two tries while the database fails."""

EXPIRY_INTERVAL = 300.0
"""Seconds between two looks for entries that are too old."""

LAST_WRITE_SECONDS = 3.0
"""Seconds that the program's end waits for what is still to be written."""


class HistoryWriter:
    """Takes happenings at once and writes them soon.

    The rule of its queue: while the database is slow or away, up to ``queue_limit`` happenings wait; then the
    oldest go, are counted in ``dropped``, and an entry ``historyGap`` tells readers how many are missing.
    """

    def __init__(self, settings: HistorySettings, engine: Engine, clock: Clock) -> None:
        self._settings = settings
        self._engine = engine
        self._clock = clock
        self._queue: deque[Happening] = deque()
        self._news = asyncio.Event()
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="history")
        self._gap = 0
        self.ready = False
        """Whether the last access to the database went well."""
        self.written = 0
        self.dropped = 0
        self.failures = 0

    @property
    def waiting(self) -> int:
        """How many happenings are not written yet."""
        return len(self._queue)

    def tell(self, happening: Happening) -> None:
        """Take in a happening; never waits."""
        if len(self._queue) >= self._settings.queue_limit:
            self._queue.popleft()
            self._lose(1)
        self._queue.append(happening)
        self._news.set()

    async def open(self) -> None:
        """Make the tables, before anything else is started.

        A database server may be away at the moment; a file that cannot be written is a mistake.

        Raises:
            HistoryError: the history cannot be used as it is set.

        """
        try:
            await self._in_thread(partial(database.prepare, self._engine))
        except SQLAlchemyError as error:
            if self._engine.dialect.name == "sqlite":
                message = (
                    f"history.url cannot be used: {_words(error)}. Name a file that can be written: "
                    "sqlite:///nena-history.db; or keep no history: --history.url none"
                )
                raise HistoryError(message) from error
            self._failed(error)

    async def run(self) -> None:
        """Write until cancelled, then write what is left."""
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._keep_writing(), name="history writer")
                tasks.create_task(self._keep_expiring(), name="history expiry")
        finally:
            await self._write_the_rest()

    async def _keep_writing(self) -> None:
        pause = self._settings.interval
        while True:
            await self._news.wait()
            await asyncio.sleep(pause)  # gathers a batch, or lets the database come back
            failures = self.failures
            while self._queue and self.failures == failures:
                await self._write_batch()
            failed = self.failures > failures
            pause = min(2 * pause, LONGEST_PAUSE) if failed else self._settings.interval

    async def _write_batch(self) -> None:
        batch = [self._queue.popleft() for _ in range(min(len(self._queue), self._settings.batch_limit))]
        gap = self._gap
        if gap:
            batch.insert(0, self._gap_entry(gap))
        if not self._queue:
            self._news.clear()
        try:
            await self._in_thread(partial(self._prepare_and_write, batch))
        except (DataError, IntegrityError):  # would fail for ever, and hold up all others
            log.exception("happenings cannot be stored, dropped", number=len(batch))
            self._lose(len(batch) - bool(gap))
        except (SQLAlchemyError, HistoryError) as error:
            self._failed(error)
            self._take_back(batch[1:] if gap else batch)
        else:
            self._gap -= gap
            self.written += len(batch)

    def _prepare_and_write(self, batch: list[Happening]) -> None:
        if not self.ready:
            database.prepare(self._engine)
        database.write(self._engine, batch)

    def _take_back(self, batch: list[Happening]) -> None:
        """Put a batch back before what waits, as far as there is room; the oldest go first."""
        room = max(0, self._settings.queue_limit - len(self._queue))
        lost = max(0, len(batch) - room)
        self._lose(lost)
        self._queue.extendleft(reversed(batch[lost:]))
        self._news.set()

    def _lose(self, number: int) -> None:
        self.dropped += number
        self._gap += number

    def _gap_entry(self, dropped: int) -> Happening:
        text = f"{dropped} happenings before this one were not written."
        return Happening(self._clock.now(), Code.HISTORY_GAP, text, values={"dropped": dropped})

    async def _keep_expiring(self) -> None:
        while True:
            try:
                await self._expire()
            except SQLAlchemyError as error:
                self._failed(error)
            await asyncio.sleep(EXPIRY_INTERVAL)

    async def _expire(self) -> None:
        await self._expire_after(self._settings.retention_days, None)
        await self._expire_after(self._settings.track_days, Code.POSITION)

    async def _expire_after(self, days: float, code: Code | None) -> None:
        before = self._clock.now() - timedelta(days=days)
        deleted = database.EXPIRED_PER_COMMIT
        while deleted == database.EXPIRED_PER_COMMIT:
            deleted = await self._in_thread(partial(database.expire, self._engine, before=before, code=code))

    async def _write_the_rest(self) -> None:
        try:
            async with asyncio.timeout(LAST_WRITE_SECONDS):
                await self._in_thread(int)  # what the thread still had to do is done then
                failures = self.failures
                while self._queue and self.failures == failures:
                    await self._write_batch()
        except TimeoutError:
            log.warning("history not written to its end", waiting=len(self._queue))
        hang_up(self._engine)
        self._thread.shutdown(wait=False, cancel_futures=True)
        self._engine.dispose()

    async def _in_thread(self, work: Callable[[], R]) -> R:
        future = asyncio.get_running_loop().run_in_executor(self._thread, work)
        result = await asyncio.shield(future)  # a batch that is begun is written also when the program ends
        self.ready = True
        return result

    def _failed(self, error: Exception) -> None:
        if self.ready or not self.failures:
            log.error("history cannot be written, trying on", reason=_words(error))
        self.ready = False
        self.failures += 1


def _words(error: Exception) -> str:
    return str(getattr(error, "orig", None) or error).splitlines()[0]
