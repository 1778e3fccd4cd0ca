"""Who has the lead of a shared store, on a real PostgreSQL."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from sqlalchemy import Engine, text

from nena_order_service.errors import StoreNotReadyError
from nena_order_service.store import leadership
from nena_order_service.store.database import Changes, Fence, commit_changes, read_order
from nena_order_service.store.leadership import Leadership, begin_epoch
from nena_order_service.store.schema import FencedError, StoreError, open_database
from nena_order_service.store.store import Store
from nena_shared.tasks import end
from support.order_service import dispatchable_order
from support.pausing import pass_time
from support.postgres import Postgres
from support.stores import changes
from support.waiting import PATIENCE, until


def test_a_replaced_service_commits_nothing(postgres: Postgres) -> None:
    engine = open_database(postgres.url)
    old = Fence.raise_for(engine, "http://old.example")
    commit_changes(engine, changes((dispatchable_order(number=1), None)), old)
    new = Fence.raise_for(engine, "http://new.example")
    assert new.epoch > old.epoch
    assert new.is_current(engine)
    assert not old.is_current(engine)
    with pytest.raises(FencedError, match="Restart it as standby"):
        commit_changes(engine, changes((dispatchable_order(number=2), None)), old)
    assert read_order(engine, name="T-1") is not None
    assert read_order(engine, name="T-2") is None


async def test_requests_of_a_replaced_service_are_refused_at_once(postgres: Postgres) -> None:
    engine = open_database(postgres.url)
    store = Store(engine, fence=Fence.raise_for(engine, "http://old.example"))
    Fence.raise_for(engine, "http://new.example")
    loop = asyncio.get_running_loop()
    answers = [loop.create_future() for _ in range(2)]
    store.fail_on_loss(answers[0])
    store.commit(changes((dispatchable_order(), None)), lambda: answers[0].set_result(None))
    with pytest.raises(FencedError):
        await asyncio.wait_for(store.run(), PATIENCE)

    store.commit(Changes(), lambda: answers[1].set_result(None))  # as a repeated request for that order
    store.fail_on_loss(answers[1])
    for answer in answers:
        with pytest.raises(StoreNotReadyError, match="another order service is now active"):
            await asyncio.wait_for(answer, PATIENCE)
    assert not await asyncio.wait_for(store.drain(2 * PATIENCE), PATIENCE)
    assert "another order service is now active" in store.why_not_ready
    store.close()


def test_an_epoch_increases_regardless_of_the_clock(
    postgres: Postgres, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine = open_database(postgres.url)
    epochs = []
    for seconds in (2_000_000_000, 2_000_000_000, 1_900_000_000, 2_000_000_100):
        monkeypatch.setattr("time.time", lambda seconds=seconds: seconds)
        epochs.append(Fence.raise_for(engine, "").epoch)

    assert epochs == [2_000_000_000, 2_000_000_001, 2_000_000_002, 2_000_000_100]


def test_an_epoch_rises_over_a_restore_from_a_backup(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, url = tmp_path / "orders.db", f"sqlite:///{tmp_path}/orders.db"
    monkeypatch.setattr("time.time", lambda: 2_000_000_000)
    assert begin_epoch(open_database(url)) == 2_000_000_000
    copy = file.read_bytes()
    monkeypatch.setattr("time.time", lambda: 2_000_000_060)
    last = begin_epoch(open_database(url))
    file.write_bytes(copy)
    monkeypatch.setattr("time.time", lambda: 2_000_000_090)

    assert begin_epoch(open_database(url)) > last


def test_a_read_only_store_does_not_prevent_a_new_epoch(tmp_path: Path) -> None:
    engine = open_database(f"sqlite:///{tmp_path}/orders.db")
    with engine.begin() as connection:
        connection.execute(text("DROP TABLE leadership"))

    assert begin_epoch(engine) > 0


def test_a_takeover_waits_for_the_pending_commit(postgres: Postgres) -> None:
    engine = open_database(postgres.url)
    old = Fence.raise_for(engine, "")
    with engine.begin() as connection:
        assert old.lets_pass(connection)
        with engine.begin() as other:
            other.execute(text("SET LOCAL lock_timeout = '50ms'"))
            with pytest.raises(Exception, match="lock timeout"):
                other.execute(text("UPDATE leadership SET epoch = epoch + 1"))
            other.rollback()


def test_a_commit_with_a_lost_answer_is_not_repeated(postgres: Postgres) -> None:
    engine = open_database(postgres.url)
    fence = Fence.raise_for(engine, "")
    made = changes((dispatchable_order(number=1), None))
    commit_changes(engine, made, fence)
    fence.commits -= 1  # as if the connection had ended before the answer came
    commit_changes(engine, made, fence)
    commit_changes(engine, changes((dispatchable_order(number=2), None)), fence)
    assert read_order(engine, name="T-2") is not None
    commit_changes(engine, Changes(), fence)
    assert fence.commits == 3


@pytest.fixture
async def leads(
    postgres: Postgres, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[tuple[Leadership, Leadership]]:
    monkeypatch.setattr(leadership, "POLL", 0.02)
    monkeypatch.setattr(leadership, "GRACE", 2.0)
    made = (Leadership(postgres.url), Leadership(postgres.url))
    yield made
    for lead in made:
        await lead.close()


async def test_the_lock_is_free_after_the_first_owner(
    leads: tuple[Leadership, Leadership], postgres: Postgres
) -> None:
    first, second = leads
    stop = asyncio.Event()
    assert await first.win(stop)
    Fence.raise_for(open_database(postgres.url), "http://first.example")
    waiting = asyncio.create_task(second.win(stop))
    await until(lambda: second.active_url == "http://first.example")
    assert not waiting.done()
    await asyncio.to_thread(first._hang_up)
    async with asyncio.timeout(PATIENCE):
        assert await waiting


async def test_waiting_ends_when_the_program_is_to_stop(leads: tuple[Leadership, Leadership]) -> None:
    stop = asyncio.Event()
    assert await leads[0].win(stop)
    waiting = asyncio.create_task(leads[1].win(stop))
    stop.set()
    async with asyncio.timeout(PATIENCE):
        assert not await waiting


async def test_waiting_ends_even_if_the_database_hangs(
    leads: tuple[Leadership, Leadership], postgres: Postgres
) -> None:
    stop = asyncio.Event()
    assert await leads[0].win(stop)
    waiting = asyncio.create_task(leads[1].win(stop))
    await until(lambda: leads[1]._connection is not None)
    with postgres.frozen():
        stop.set()
        async with asyncio.timeout(PATIENCE):
            assert not await waiting


async def test_the_lead_is_kept_over_a_restart_of_the_database(
    leads: tuple[Leadership, Leadership], postgres: Postgres
) -> None:
    first, second = leads
    stop = asyncio.Event()
    assert await first.win(stop)
    engine = open_database(postgres.url)
    fence = Fence.raise_for(engine, "http://first.example")
    store = Store(engine, fence=fence)
    keeping = asyncio.create_task(first.keep(store, engine, fence))
    waiting = asyncio.create_task(second.win(stop))
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
    monkeypatch.setattr(leadership, "POLL", 0.02)
    monkeypatch.setattr(leadership, "HANG_SECONDS", 0.2)
    first = Leadership(postgres.url)
    assert await first.win(asyncio.Event())
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
    leads: tuple[Leadership, Leadership], postgres: Postgres
) -> None:
    first, second = leads
    stop = asyncio.Event()
    assert await first.win(stop)
    engine = open_database(postgres.url)
    fence = Fence.raise_for(engine, "")
    store = Store(engine, fence=fence)
    await asyncio.to_thread(first._hang_up)
    assert await second.win(stop)
    Fence.raise_for(engine, "")
    async with asyncio.timeout(PATIENCE):
        with pytest.raises(FencedError):
            await first.keep(store, engine, fence)
    store.close()


async def test_the_lead_is_kept_while_the_store_is_made_ready(
    leads: tuple[Leadership, Leadership], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = leads
    stop = asyncio.Event()
    assert await first.win(stop)
    waiting = asyncio.create_task(second.win(stop))

    def slow(url: str) -> Engine:
        pass_time(1.5 * leadership.HANG_SECONDS)
        return open_database(url)

    monkeypatch.setattr(leadership, "open_database", slow)
    _, fence = await first.take_over("http://first.example")
    assert fence.epoch > 0
    assert first.lease.term() == 1
    assert not waiting.done()
    stop.set()
    assert not await waiting


async def test_a_store_lost_during_a_takeover_is_reported_in_one_line(
    leads: tuple[Leadership, Leadership], postgres: Postgres
) -> None:
    first, _ = leads
    assert await first.win(asyncio.Event())
    postgres.stop()
    try:
        with pytest.raises(StoreError, match=r"store\.url cannot be used"):
            await first.take_over("")
    finally:
        postgres.start()


async def test_an_unreachable_database_at_startup_is_reported_in_one_line() -> None:
    lead = Leadership("postgresql://user:secret@127.0.0.1:1/orders")
    with pytest.raises(StoreError, match=r"store\.url cannot be used: ") as caught:
        await lead.win(asyncio.Event())
    assert "secret" not in str(caught.value)
    await lead.close()
