"""Answers to hosts with concurrent requests."""

from __future__ import annotations

import asyncio
from typing import Any

from nena_order_service.api.orders import OrderOperations
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import NOW, assigned_order, request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine
from support.waiting import PATIENCE

PLANT = PlantModel(
    name="line",
    points=(point("A", 0), point("B", 2000)),
    paths=(path("A B", 2000),),
    vehicles=(Vehicle(name="V1"),),
)


class AskedStore(MemoryStore):
    """Has one ended order, and answers when all expected queries have arrived."""

    ready = True

    def __init__(self, askers: int) -> None:
        super().__init__()
        self.ended = assigned_order("B", number=1, name="D").finished(NOW)
        self._everybody = asyncio.Barrier(askers)

    async def read_order(self, *, name: str | None = None, **_: Any) -> TransportOrder | None:
        await self._everybody.wait()
        return self.ended if name == "D" else None


async def test_concurrent_identical_requests_create_one_order() -> None:
    engine = await make_engine(PLANT, AskedStore(askers=2), ScriptedFleet({}))
    requests = OrderOperations(engine)
    wanted = request("B", name="T", idempotencyKey="key", dependencies=["D"])
    async with asyncio.timeout(PATIENCE):
        (one, new), (other, also_new) = await asyncio.gather(
            requests.create_order(wanted), requests.create_order(wanted)
        )
    assert one.name == other.name == "T"
    assert sorted((new, also_new)) == [False, True]
    assert len(list(engine.state.orders.present())) == 1
