"""Long answers are built in slices, so that other requests are not delayed."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from nena_order_service.api import encoding, host_requests
from nena_order_service.api.encoding import SLICE, EncodedPage, encode
from nena_order_service.api.host_requests import STATUSES_AT_ONCE, HostRequests
from nena_shared.fleet_api.requests import TransportOrderPage
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import dispatchable_order
from support.pausing import turn_passes
from support.plants import point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine


class Turns:
    """Counts what is done between two turns of the event loop."""

    def __init__(self) -> None:
        self.most = self._now = 0

    def count(self) -> None:
        self._now += 1
        self.most = max(self.most, self._now)

    async def run(self) -> None:
        while True:
            self._now = 0
            await turn_passes()


@pytest.mark.parametrize("number", [0, 1, SLICE, SLICE + 1, 10 * SLICE])
@pytest.mark.parametrize("exclude_none", [False, True])
async def test_a_page_is_the_same_in_slices(number: int, *, exclude_none: bool) -> None:
    orders = tuple(dispatchable_order(number=each + 1).status for each in range(number))
    for page in (
        TransportOrderPage(transport_orders=orders, next="7"),
        TransportOrderPage(transport_orders=orders, next=None),
    ):
        whole = page.model_dump_json(by_alias=True, exclude_none=exclude_none)
        assert json.loads(await encode(page, exclude_none=exclude_none)) == json.loads(whole)


async def test_a_long_page_is_encoded_in_slices(monkeypatch: pytest.MonkeyPatch) -> None:
    turns = Turns()
    dump = TransportOrderStatus.model_dump_json

    def counted(order: TransportOrderStatus, **how: Any) -> str:
        turns.count()
        return dump(order, **how)

    monkeypatch.setattr(TransportOrderStatus, "model_dump_json", counted)
    counting = asyncio.create_task(turns.run())
    order = dispatchable_order().status
    await encode(TransportOrderPage(transport_orders=(order,) * 1000, next=None))
    counting.cancel()
    assert 0 < turns.most <= encoding.SLICE


@pytest.mark.parametrize("number", [0, 1, SLICE, SLICE + 1, 1000])
async def test_a_page_is_sent_in_slices(number: int) -> None:
    order = dispatchable_order().status
    page = EncodedPage("transportOrders", (order.model_dump_json(by_alias=True).encode(),) * number, "7")
    turns, parts = Turns(), []
    counting = asyncio.create_task(turns.run())
    async for part in page.parts():
        turns.count()
        parts.append(part)
    counting.cancel()
    whole = b"".join(parts)
    assert TransportOrderPage.model_validate_json(whole).transport_orders == (order,) * number
    assert page.size == len(whole)
    assert len(parts) <= 2 + -(-number // SLICE)
    assert turns.most <= 2


async def test_a_large_fleet_is_listed_in_slices(monkeypatch: pytest.MonkeyPatch) -> None:
    names = [f"V{number:03}" for number in range(200)]
    plant = PlantModel(name="p", points=(point("A"),), vehicles=tuple(Vehicle(name=each) for each in names))
    engine = await make_engine(plant, MemoryStore(), ScriptedFleet({}))
    turns, status = Turns(), engine.status

    def counted(vehicle: Any) -> Any:
        turns.count()
        return status(vehicle)

    monkeypatch.setattr(engine, "status", counted)
    requests = HostRequests(engine)
    counting = asyncio.create_task(turns.run())
    assert [each.name async for each in requests.vehicles()] == names
    counting.cancel()
    assert 0 < turns.most <= host_requests.STATUSES_AT_ONCE == STATUSES_AT_ONCE
    assert [each.name async for each in requests.vehicles("V100")] == names[101:]
