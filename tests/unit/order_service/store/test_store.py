from __future__ import annotations

import asyncio
import sqlite3
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from nena_order_service.errors import StoreNotReadyError
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store import store as store_module
from nena_order_service.store.database import Changes
from nena_order_service.store.instance_lock import InstanceLock
from nena_order_service.store.schema import StoreLostError, open_database
from nena_order_service.store.store import ChangeNumbers, Store
from nena_shared.fleet_api.reasons import Reason
from support.order_service import NOW, dispatchable_order
from support.pausing import turn_passes
from support.stores import changes
from support.waiting import PATIENCE, until


@asynccontextmanager
async def running(store: Store) -> AsyncIterator[Store]:
    task = asyncio.create_task(store.run())
    try:
        yield store
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def change(order: TransportOrder, before: TransportOrder | None = None) -> Changes:
    made = Changes()
    made.put_order(order, before)
    return made


def fail() -> None:
    raise RuntimeError


async def test_published_only_after_the_commit(make_store: Callable[[], Store]) -> None:
    other = make_store()
    async with running(make_store()) as store:
        told = asyncio.Event()
        store.commit(change(dispatchable_order()), told.set)
        assert not told.is_set()
        await told.wait()
        assert await other.read_order(name="T-1") == dispatchable_order()


async def test_pending_changes_are_committed_together_and_published_in_order(
    make_store: Callable[[], Store],
) -> None:
    told: list[int] = []
    async with running(make_store()) as store:
        for number in range(1, 101):
            store.commit(change(dispatchable_order(number=number)), lambda n=number: told.append(n))  # type: ignore[misc] # n is bound at once
        store.commit(Changes(), lambda: told.append(0))
        await until(lambda: len(told) == 101)
        assert told == [*range(1, 101), 0]
        assert store.commits <= 2


async def test_an_empty_commit_completes_at_once(make_store: Callable[[], Store]) -> None:
    told: list[str] = []
    make_store().commit(Changes(), lambda: told.append("now"))
    assert told == ["now"]


async def test_changes_of_one_order_while_it_is_written_are_all_kept(make_store: Callable[[], Store]) -> None:
    async with running(make_store()) as store:
        order: TransportOrder | None = None
        last = dispatchable_order()
        for number in range(50):
            before, order = order, last
            store.commit(change(order, before), lambda: None)
            last = order.deferred(Reason.of(f"reason {number}"), NOW)
            await turn_passes()
        assert await store.drain(PATIENCE)
        assert await store.read_order(name="T-1") == order


@pytest.mark.provokes_failures
async def test_a_failing_listener_does_not_prevent_others(make_store: Callable[[], Store]) -> None:
    async with running(make_store()) as store:
        told = asyncio.Event()
        store.commit(change(dispatchable_order()), fail)
        store.commit(Changes(), told.set)
        async with asyncio.timeout(PATIENCE):
            await told.wait()


async def test_locked_database_is_waited_for(sqlite_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store_module, "RETRY_PAUSE", 0.01)
    store = Store(open_database(sqlite_url))
    blocker = sqlite3.connect(sqlite_url.removeprefix("sqlite:///"), isolation_level=None)
    blocker.execute("BEGIN IMMEDIATE")
    async with running(store):
        told = asyncio.Event()
        store.commit(change(dispatchable_order()), told.set)
        await until(lambda: store.problem)
        assert "locked" in store.problem
        assert not store.ready
        assert not told.is_set()
        blocker.execute("ROLLBACK")
        blocker.close()
        async with asyncio.timeout(PATIENCE):
            await told.wait()
        await until(lambda: store.ready)
        assert await store.read_order(name="T-1") == dispatchable_order()
    store.close()


async def test_drain_reports_when_the_store_rejects_writes(make_store: Callable[[], Store]) -> None:
    store = make_store()
    store.commit(change(dispatchable_order()), lambda: None)
    assert not await store.drain(0.01)


async def test_too_many_pending_commits_make_the_store_unready(
    make_store: Callable[[], Store], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, "WAITING_LIMIT", 3)
    store = make_store()
    for number in range(1, 4):
        assert store.ready
        store.commit(change(dispatchable_order(number=number)), lambda: None)
    assert not store.ready


def delete(url: str) -> None:
    Path(url.removeprefix("sqlite:///")).unlink()


async def test_nothing_more_is_published_once_the_file_is_deleted(
    sqlite_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No robot may get an order whose host was told that it was not saved."""
    monkeypatch.setattr(store_module, "LOSS_SHOWN", 0.0)
    store = Store(open_database(sqlite_url), InstanceLock.take(sqlite_url))
    told: list[int] = []

    def lose() -> None:
        delete(sqlite_url)
        assert not store.ready

    store.commit(change(dispatchable_order()), lose)
    for number in range(2, 12):
        store.commit(change(dispatchable_order(number=number)), lambda n=number: told.append(n))  # type: ignore[misc] # n is bound at once
    with pytest.raises(StoreLostError, match="was deleted while in use"):
        await asyncio.wait_for(store.run(), PATIENCE)
    assert told == []
    store.close()


async def test_commits_to_a_deleted_file_are_not_published(
    sqlite_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, "LOSS_SHOWN", 0.0)
    lock = InstanceLock.take(sqlite_url)
    store = Store(open_database(sqlite_url), lock)
    told: list[str] = []
    answer: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    store.fail_on_loss(answer)
    store.commit(change(dispatchable_order()), lambda: told.append("told"))
    delete(sqlite_url)

    with pytest.raises(StoreLostError, match="was deleted while in use"):
        await asyncio.wait_for(store.run(), PATIENCE)

    assert not store.ready
    assert told == []
    with pytest.raises(StoreNotReadyError):
        await answer
    store.close()


def test_each_change_has_the_next_number_and_all_versions_of_a_step_have_one() -> None:
    numbers = ChangeNumbers()
    numbers.continue_after(7)
    first = dispatchable_order()
    second = first.deferred(Reason.of("nobody is free"), NOW)
    numbers.number_changes(changes((second, None)))
    numbers.number_changes(changes((dispatchable_order(number=2), None)))
    third = second.failed(Reason.of("withdrawn"), NOW)
    numbers.number_changes(changes((third, second)))
    assert numbers.last == 10
    versions = [order.status.version for order in (first, second, third)]
    assert numbers.published == 7
    assert [numbers.number_of("T-1", version) for version in versions[:2]] == [(8, False), (8, True)]
    assert numbers.published == 8
    assert numbers.number_of("T-2", dispatchable_order().status.version) == (9, True)
    assert numbers.number_of("T-1", versions[2]) == (10, True)
    assert numbers.published == 10


def test_unchanged_objects_have_no_change_number() -> None:
    numbers = ChangeNumbers()
    assert numbers.number_of("T-1", 3) == (0, False)
    numbers.number_changes(changes((dispatchable_order(), None)))
    assert numbers.number_of("T-1", 99) == (0, False)
    assert numbers.published == 0
