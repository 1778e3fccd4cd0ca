from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager, suppress
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Engine

from nena_status_aggregator.fleet.events import Code, Event
from nena_status_aggregator.history import database
from nena_status_aggregator.history import writer as writer_module
from nena_status_aggregator.history.database import HistoryEntry, HistoryError, HistoryFilter
from nena_status_aggregator.history.writer import HistoryWriter
from nena_status_aggregator.settings import HistorySettings
from support.clocks import ManualClock
from support.fleet_examples import START
from support.postgres import Postgres
from support.waiting import PATIENCE, until


def event(number: int, code: Code = Code.CONDITION) -> Event:
    return Event(START + timedelta(seconds=number), code, f"number {number}")


def writer_of(engine: Engine, *, days: float = 0.0, **settings: Any) -> HistoryWriter:
    """Make a writer ``days`` after the start."""
    chosen = HistorySettings(interval=0.01, **settings)
    return HistoryWriter(chosen, engine, ManualClock(seconds=days * 86400, start=START))


@asynccontextmanager
async def running(writer: HistoryWriter) -> AsyncIterator[None]:
    await writer.open()
    task = asyncio.create_task(writer.run(), name="history")
    yield
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task


def entries(engine: Engine) -> list[HistoryEntry]:
    return database.read_oldest(engine, HistoryFilter(), after=0, upto=10**6, limit=1000)


def texts(engine: Engine) -> list[str]:
    return [each["text"] for each in entries(engine)]


async def test_events_are_written_promptly_in_order(engine: Engine) -> None:
    writer = writer_of(engine, batch_limit=7)
    async with running(writer):
        for number in range(20):
            writer.add(event(number))
        await until(lambda: writer.written == 20, what="twenty entries")
        assert texts(engine) == [f"number {number}" for number in range(20)]
        assert (writer.waiting, writer.dropped, writer.failures) == (0, 0, 0)


async def test_shutdown_writes_remaining_events(engine: Engine) -> None:
    writer = writer_of(engine)
    async with running(writer):
        writer.add(event(1))
        await until(lambda: writer.written == 1, what="the first entry")
        writer.add(event(2))
    assert texts(engine) == ["number 1", "number 2"]


async def test_overflow_drops_the_oldest_events_and_records_a_gap(engine: Engine) -> None:
    writer = writer_of(engine, queue_limit=3)
    for number in range(5):
        writer.add(event(number))
    assert (writer.waiting, writer.dropped) == (3, 2)
    async with running(writer):
        await until(lambda: not writer.waiting and writer.written, what="the rest")
    gap, *rest = entries(engine)
    assert (gap["code"], gap["values"]) == ("historyGap", {"dropped": 2})
    assert [each["text"] for each in rest] == ["number 2", "number 3", "number 4"]


async def test_a_failure_of_the_database_is_survived(engine: Engine) -> None:
    writer = writer_of(engine, queue_limit=5)
    async with running(writer):
        database.metadata.drop_all(engine)
        for number in range(3):
            writer.add(event(number))
        await until(lambda: writer.written == 3, what="entries in tables that were made again")
        assert writer.failures >= 1, "the expiry of old entries may miss the tables, too"
        assert writer.dropped == 0
        assert texts(engine) == ["number 0", "number 1", "number 2"]


async def test_unavailable_server_is_retried_with_a_bounded_queue(
    postgres: Postgres,
) -> None:
    engine = database.make_engine(postgres.url)
    database.metadata.drop_all(engine)
    postgres.stop()
    writer = writer_of(engine, queue_limit=10, batch_limit=10)
    try:
        async with running(writer):
            for number in range(10):
                writer.add(event(number))
            await until(lambda: writer.failures >= 2, what="two tries")
            for number in range(10, 14):
                writer.add(event(number))
            await until(lambda: writer.failures >= 4, what="more tries")
            assert writer.waiting <= 10
            postgres.start()
            await until(lambda: writer.ready and not writer.waiting, what="the server's return")
    finally:
        with suppress(AssertionError):
            postgres.start()
    engine = database.make_engine(postgres.url)
    gap, *rest = entries(engine)
    assert gap["values"] == {"dropped": 4}
    assert [each["text"] for each in rest] == [f"number {number}" for number in range(4, 14)]
    engine.dispose()


async def test_hanging_server_does_not_block_shutdown(
    postgres: Postgres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database, "CONNECT_SECONDS", 2)
    monkeypatch.setattr(writer_module, "LAST_WRITE_SECONDS", 0.2)
    writer = writer_of(database.make_engine(postgres.url))
    with ExitStack() as stack:
        async with running(writer):
            writer.add(event(0))
            await until(lambda: writer.written == 1, what="one is written")
            stack.enter_context(postgres.frozen())
            writer.add(event(1))
        (thread,) = writer._thread._threads
        await asyncio.to_thread(thread.join, PATIENCE)
        assert not thread.is_alive()


async def test_old_entries_expire_automatically(engine: Engine) -> None:
    old = [event(0), event(1, Code.POSITION)]
    database.write(engine, old)
    async with running(writer_of(engine, days=3, retention_days=5, track_days=2)):
        positions = HistoryFilter(codes=(Code.POSITION,))
        await until(
            lambda: not database.read_newest(engine, positions, before=None, limit=1), what="no positions"
        )
        assert texts(engine) == ["number 0"]
    async with running(writer_of(engine, days=6, retention_days=5)):
        await until(lambda: not texts(engine), what="an empty history")


async def test_a_file_that_cannot_be_written_ends_the_start(tmp_path: Path) -> None:
    engine = database.make_engine(f"sqlite:///{tmp_path / 'missing' / 'history.db'}")
    with pytest.raises(HistoryError, match=r"unable to open.*--history.url none"):
        await writer_of(engine).open()
