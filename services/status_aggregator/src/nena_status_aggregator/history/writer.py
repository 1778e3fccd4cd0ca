"""Writes events to the history in batches, outside the event loop."""

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
from nena_shared.database_connections import close_connections
from nena_shared.log import get_logger
from nena_status_aggregator.fleet.events import Code, Event
from nena_status_aggregator.history import database
from nena_status_aggregator.history.database import HistoryError
from nena_status_aggregator.settings import HistorySettings

log = get_logger(__name__)

R = TypeVar("R")

LONGEST_PAUSE = 10.0
"""Maximum delay between retries while the database is unavailable, seconds."""

EXPIRY_INTERVAL = 300.0
"""Interval between deletions of expired entries, seconds."""

LAST_WRITE_SECONDS = 3.0
"""Timeout of the last write at shutdown, seconds."""


class HistoryWriter:
    """Queues events and writes them in batches.

    While the database is slow or unavailable, up to ``queue_limit`` events are queued. Beyond, the oldest are
    dropped and counted in ``dropped`` and in a ``historyGap`` entry.
    """

    def __init__(self, settings: HistorySettings, engine: Engine, clock: Clock) -> None:
        self._settings = settings
        self._engine = engine
        self._clock = clock
        self._queue: deque[Event] = deque()
        self._news = asyncio.Event()
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="history")
        self._gap = 0
        self.ready = False
        """Whether the last database access succeeded."""
        self.written = 0
        self.dropped = 0
        self.failures = 0

    @property
    def waiting(self) -> int:
        """Number of events waiting to be written."""
        return len(self._queue)

    def add(self, event: Event) -> None:
        """Queue an event; never blocks."""
        if len(self._queue) >= self._settings.queue_limit:
            self._queue.popleft()
            self._lose_entries(1)
        self._queue.append(event)
        self._news.set()

    async def open(self) -> None:
        """Create the tables at start-up.

        A database server may be unavailable for now; an unwritable file is an error.

        Raises:
            HistoryError: the history settings are invalid.
        """
        try:
            await self._in_thread(partial(database.prepare, self._engine))
        except SQLAlchemyError as error:
            if self._engine.dialect.name == "sqlite":
                raise HistoryError(
                    f"history.url is unusable: {_first_line(error)}. Use a writable file, for example "
                    "sqlite:///nena-history.db, or disable the history with --history.url none"
                ) from error
            self._report_failure(error)

    async def run(self) -> None:
        """Write until cancelled, then write the remaining events."""
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
            await asyncio.sleep(pause)  # collects a batch, or gives the database time to recover
            failures = self.failures
            while self._queue and self.failures == failures:
                await self._write_batch()
            failed = self.failures > failures
            pause = min(2 * pause, LONGEST_PAUSE) if failed else self._settings.interval

    async def _write_batch(self) -> None:
        batch = [self._queue.popleft() for _ in range(min(len(self._queue), self._settings.batch_limit))]
        gap = self._gap
        if gap:
            text = f"{gap} events before this one were not written."
            batch.insert(0, Event(self._clock.now(), Code.HISTORY_GAP, text, values={"dropped": gap}))
        if not self._queue:
            self._news.clear()
        try:
            await self._in_thread(partial(self._prepare_and_write, batch))
        except (DataError, IntegrityError):  # would fail forever and block all others
            log.exception("dropping events that cannot be stored", number=len(batch))
            self._lose_entries(len(batch) - bool(gap))
        except (SQLAlchemyError, HistoryError) as error:
            self._report_failure(error)
            events = batch[1:] if gap else batch
            # Back to the head of the queue, where the events are older than those that came meanwhile.
            room = max(0, self._settings.queue_limit - len(self._queue))
            lost = max(0, len(events) - room)
            self._lose_entries(lost)
            self._queue.extendleft(reversed(events[lost:]))
            self._news.set()
        else:
            self._gap -= gap
            self.written += len(batch)

    def _prepare_and_write(self, batch: list[Event]) -> None:
        # After a failure the database may be a new, empty one.
        if not self.ready:
            database.prepare(self._engine)
        database.write(self._engine, batch)

    def _lose_entries(self, number: int) -> None:
        self.dropped += number
        self._gap += number

    async def _keep_expiring(self) -> None:
        while True:
            try:
                await self._expire_after(self._settings.retention_days, None)
                # Positions fill most of the table and are wanted for a shorter time.
                await self._expire_after(self._settings.track_days, Code.POSITION)
            except SQLAlchemyError as error:
                self._report_failure(error)
            await asyncio.sleep(EXPIRY_INTERVAL)

    async def _expire_after(self, days: float, code: Code | None) -> None:
        oldest = self._clock.now() - timedelta(days=days)
        # Small transactions, one after the other: new events are written in between.
        deleted = database.EXPIRED_PER_COMMIT
        while deleted == database.EXPIRED_PER_COMMIT:
            deleted = await self._in_thread(partial(database.expire, self._engine, before=oldest, code=code))

    async def _write_the_rest(self) -> None:
        try:
            async with asyncio.timeout(LAST_WRITE_SECONDS):
                await self._in_thread(int)  # waits for the thread's current work
                failures = self.failures
                while self._queue and self.failures == failures:
                    await self._write_batch()
        except TimeoutError:
            log.warning(
                "events lost at shutdown: the history database did not answer in time",
                waiting=len(self._queue),
            )
        close_connections(self._engine)
        self._thread.shutdown(wait=False, cancel_futures=True)
        self._engine.dispose()

    async def _in_thread(self, work: Callable[[], R]) -> R:
        future = asyncio.get_running_loop().run_in_executor(self._thread, work)
        result = await asyncio.shield(future)  # a started batch is written even during shutdown
        self.ready = True
        return result

    def _report_failure(self, error: Exception) -> None:
        if self.ready or not self.failures:
            log.error("history database unavailable; retrying", reason=_first_line(error))
        self.ready = False
        self.failures += 1


def _first_line(error: Exception) -> str:
    return str(getattr(error, "orig", None) or error).splitlines()[0]
