"""Waiting for the lead of a shared store, and keeping it, on a real PostgreSQL."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest
from sqlalchemy import Engine

from nena_order_service.store import lead as lead_module
from nena_order_service.store.lead import Lead
from nena_order_service.store.leadership import Fence
from nena_order_service.store.schema import FencedError, StoreError, open_database
from nena_order_service.store.store import Store
from nena_shared.tasks import end
from support.order_service import dispatchable_order
from support.postgres import Postgres
from support.stores import changes
from support.waiting import PATIENCE, until, wait_until


@pytest.fixture
async def leads(postgres: Postgres, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[tuple[Lead, Lead]]:
    monkeypatch.setattr(lead_module, "POLL", 0.02)
    monkeypatch.setattr(lead_module, "GRACE", 2.0)
    made = (Lead(postgres.url), Lead(postgres.url))
    yield made
    for lead in made:
        await lead.close()


async def test_the_lock_is_free_after_the_first_owner(leads: tuple[Lead, Lead], postgres: Postgres) -> None:
    first, second = leads
    stop = asyncio.Event()
    assert await first.take(stop)
    Fence.raise_for(open_database(postgres.url), "http://first.example")
    waiting = asyncio.create_task(second.take(stop))
    await until(lambda: second.active_url == "http://first.example")
    assert not waiting.done()
    first._lock.release()
    async with asyncio.timeout(PATIENCE):
        assert await waiting


async def test_waiting_ends_when_the_program_is_to_stop(leads: tuple[Lead, Lead]) -> None:
    stop = asyncio.Event()
    assert await leads[0].take(stop)
    waiting = asyncio.create_task(leads[1].take(stop))
    stop.set()
    async with asyncio.timeout(PATIENCE):
        assert not await waiting


async def test_waiting_ends_even_if_the_database_hangs(leads: tuple[Lead, Lead], postgres: Postgres) -> None:
    stop = asyncio.Event()
    assert await leads[0].take(stop)
    waiting = asyncio.create_task(leads[1].take(stop))
    await until(lambda: leads[1]._lock._connection is not None)
    with postgres.frozen():
        stop.set()
        async with asyncio.timeout(PATIENCE):
            assert not await waiting


async def test_the_lead_is_kept_over_a_restart_of_the_database(
    leads: tuple[Lead, Lead], postgres: Postgres
) -> None:
    first, second = leads
    stop = asyncio.Event()
    assert await first.take(stop)
    engine = open_database(postgres.url)
    fence = Fence.raise_for(engine, "http://first.example")
    store = Store(engine, fence=fence)
    keeping = asyncio.create_task(first.keep(store, engine, fence))
    waiting = asyncio.create_task(second.take(stop))
    await until(lambda: second.active_url)
    postgres.stop()
    await until(lambda: store.lead_problem and second.problem)
    assert not store.ready
    postgres.start()
    await until(lambda: store.ready and not second.problem and second.active_url)
    assert not keeping.done()
    assert not waiting.done()
    stop.set()
    keeping.cancel()
    await asyncio.gather(keeping, waiting, return_exceptions=True)
    store.close()


async def test_a_hanging_database_is_reported_and_does_not_block_shutdown(
    postgres: Postgres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lead_module, "POLL", 0.02)
    monkeypatch.setattr(lead_module, "HANG_SECONDS", 0.2)
    first = Lead(postgres.url)
    assert await first.take(asyncio.Event())
    engine = open_database(postgres.url)
    fence = Fence.raise_for(engine, "http://first.example")
    store = Store(engine, fence=fence)
    tasks = [asyncio.create_task(each) for each in (first.keep(store, engine, fence), store.run())]
    with postgres.frozen():
        await until(lambda: store.why_not_ready == "the database does not answer")
    await until(lambda: store.ready)
    assert not any(task.done() for task in tasks)
    with postgres.frozen():
        await until(lambda: not store.ready)
        store.commit(changes((dispatchable_order(number=1), None)), lambda: None)
        assert not await store.drain(0.2)
        async with asyncio.timeout(PATIENCE):
            await end(*tasks)
            await asyncio.to_thread(store.close)
            await first.close()


async def test_a_service_that_finds_another_leader_exits(
    leads: tuple[Lead, Lead], postgres: Postgres
) -> None:
    first, second = leads
    stop = asyncio.Event()
    assert await first.take(stop)
    engine = open_database(postgres.url)
    fence = Fence.raise_for(engine, "")
    store = Store(engine, fence=fence)
    first._lock.release()
    assert await second.take(stop)
    Fence.raise_for(engine, "")
    async with asyncio.timeout(PATIENCE):
        with pytest.raises(FencedError):
            await first.keep(store, engine, fence)
    store.close()


async def test_the_lead_is_held_while_the_store_is_made_ready(
    leads: tuple[Lead, Lead], postgres: Postgres, monkeypatch: pytest.MonkeyPatch
) -> None:
    held: list[bool] = []
    first, _ = leads
    assert await first.take(asyncio.Event())
    keep = first._lock.keep

    def noted() -> bool:
        held.append(keep())
        return held[-1]

    monkeypatch.setattr(first._lock, "keep", noted)

    def slow(url: str) -> Engine:
        wait_until(lambda: len(held) >= 3)
        return open_database(url)

    monkeypatch.setattr(lead_module, "open_database", slow)
    async with asyncio.timeout(PATIENCE):
        _, fence = await first.raise_fence(postgres.url, "http://first.example")
    assert fence.epoch > 0
    assert held[:3] == [True] * 3


async def test_a_store_lost_during_a_takeover_is_reported_in_one_line(
    leads: tuple[Lead, Lead], postgres: Postgres
) -> None:
    first, _ = leads
    assert await first.take(asyncio.Event())
    postgres.stop()
    try:
        with pytest.raises(StoreError, match=r"store\.url cannot be used"):
            await first.raise_fence(postgres.url, "")
    finally:
        postgres.start()


async def test_an_unreachable_database_at_startup_is_reported_in_one_line() -> None:
    lead = Lead("postgresql://user:secret@127.0.0.1:1/orders")
    with pytest.raises(StoreError, match=r"store\.url cannot be used: ") as caught:
        await lead.take(asyncio.Event())
    assert "secret" not in str(caught.value)
    await lead.close()
