"""An internal error at each step of an order: the service restarts by itself, and the order is done once."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

from nena_order_service import runner as runner_module
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.state import Orders
from nena_order_service.fleet.link import FleetLink
from nena_order_service.fleet.outputs import (
    FleetOutput,
    NodePassed,
    OperationStarted,
    VdaOrderAccepted,
    VdaOrderFinished,
)
from support.order_service_fleet import Fleet, actions_done, order_in, vehicle_idle
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.broker, pytest.mark.provokes_failures]

Start = Callable[..., Awaitable[httpx.AsyncClient]]
EVENTS = (VdaOrderAccepted, NodePassed, OperationStarted, VdaOrderFinished)


class ProvokedError(Exception):
    """What the test makes fail."""


class Faults:
    """Fails once at each step; the services that are built one after another share it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.provoked: list[str] = []
        put, start, handle = Orders.put, FleetLink.start_vda_order, Engine._on_event

        def put_order(orders: Orders, order: Any) -> None:
            put(orders, order)
            self.fail_once(f"order {order.state}")

        def start_vda_order(link: FleetLink, *values: Any) -> None:
            self.fail_once("sent")
            start(link, *values)

        def on_event(engine: Engine, event: FleetOutput) -> None:
            handle(engine, event)
            if isinstance(event, EVENTS):
                self.fail_once(type(event).__name__)

        monkeypatch.setattr(Orders, "put", put_order)
        monkeypatch.setattr(FleetLink, "start_vda_order", start_vda_order)
        monkeypatch.setattr(Engine, "_on_event", on_event)

    def fail_once(self, step: str) -> None:
        if step not in self.provoked:
            self.provoked.append(step)
            raise ProvokedError(step)


async def test_the_order_is_done_once(fleet: Fleet, service: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner_module, "RESTART_PAUSE", 0.0)
    wire = fleet.peer()
    client = await service()
    fleet.agent()
    await vehicle_idle(client)
    faults = Faults(monkeypatch)
    body = {
        "name": "T-1",
        "idempotencyKey": "T-1",
        "destinations": [
            {"locationName": "Goods in", "operation": "Load cargo"},
            {"locationName": "Storage", "operation": "Unload cargo"},
        ],
    }

    async def create() -> int:
        return (await client.post("/v1/transportOrders", json=body)).status_code

    assert await create() == 500
    await awaited(create, lambda status: status in (200, 201), seconds=PATIENCE, what="T-1 is accepted")
    ended = await order_in(client, "T-1", "FINISHED", "FAILED", seconds=3 * PATIENCE)
    assert ended["state"] == "FINISHED", ended["reason"]
    assert actions_done(wire, fleet) == {"T-1-0": 1, "T-1-1": 1}
    states = ("DISPATCHABLE", "BEING_PROCESSED", "FINISHED")
    events = (each.__name__ for each in EVENTS)
    assert set(faults.provoked) == {*(f"order {state}" for state in states), "sent", *events}
