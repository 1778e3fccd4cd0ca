from __future__ import annotations

import asyncio

import pytest

from nena_order_service.errors import UnknownPathError
from nena_order_service.service import OrderService
from nena_order_service.store.database import Changes


async def test_lock_of_a_removed_path_is_ignored(service: OrderService) -> None:
    changes = Changes()
    known = service.engine.plant.paths[0].name
    changes.path_locks.update({"gone": True, known: True})
    service.store.commit(changes, lambda: None)
    assert await service.store.drain(30)
    await service.hosts.locks.load()
    assert [path.name for path in service.hosts.locks.all() if path.locked] == [known]
    with pytest.raises(UnknownPathError, match="gone"):
        service.hosts.locks.get("gone")


async def test_lock_takes_effect_only_after_the_commit(service: OrderService) -> None:
    name = service.engine.plant.paths[0].name
    locked = await service.hosts.locks.set(name, locked=True)
    assert locked.locked
    assert await service.store.read_path_locks() == {name: True}


async def test_traffic_respects_locks_also_after_a_restart(service: OrderService) -> None:
    name = service.engine.plant.paths[0].name
    crossings = service.engine.traffic.resources._crossings
    await service.hosts.locks.set(name, locked=True)
    assert crossings._locks == {name: True}

    crossings.set_locks({})
    await service.hosts.locks.load()
    assert crossings._locks == {name: True}


async def test_pending_lock_is_answered_when_the_engine_closes(service: OrderService) -> None:
    name = service.engine.plant.paths[0].name

    async def close() -> None:
        service.engine.close("the plant model is being changed")

    locked, _ = await asyncio.gather(service.hosts.locks.set(name, locked=True), close())
    assert locked.locked
    assert await service.store.read_path_locks() == {name: True}
