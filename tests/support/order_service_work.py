"""Work of a fleet that is stopped and goes on: robots, orders, and programs that end in order."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from typing import Any

import httpx

from support.broker import MqttPeer
from support.order_service_fleet import Fleet, actions_done, every_order_ended
from support.programs import ENDED_WITHIN, OrderServiceProgram, Program
from support.waiting import PATIENCE, awaited

LOAD = {"locationName": "Goods in", "operation": "Load cargo"}
UNLOAD = {"locationName": "Storage", "operation": "Unload cargo"}
PLACES = ((3.0, 2.0), (15.0, 2.0))
"""Where robots stand, m."""


def start_robots(fleet: Fleet, places: Sequence[tuple[float, float]] = PLACES) -> None:
    """Start robots that ignore their loads, as if a person had unloaded them when necessary."""
    for number, (x, y) in enumerate(places, start=1):
        serial = f"robot-0{number}"
        text = fleet.agent_file(serial, x=x, y=y)
        fleet.agent_of(text.replace('load = "take"\n', "").replace('load = "give"\n', ""), serial)


async def order(client: httpx.AsyncClient, name: str) -> int:
    """Create a transport order with this name, and return the answer's status: 201 new, 200 known."""
    body = {"name": name, "idempotencyKey": name, "destinations": [LOAD, UNLOAD]}
    answer = await client.post("/v1/transportOrders", json=body)
    assert answer.is_success, answer.text
    return answer.status_code


async def orders_of(client: httpx.AsyncClient) -> dict[str, dict[str, Any]]:
    """Return all orders by their names; none while the service does not answer."""
    try:
        found = await client.get("/v1/transportOrders", params={"limit": 1000})
        return {each["name"]: each for each in found.json()["transportOrders"]}
    except (httpx.TransportError, KeyError):
        return {}


async def finished(client: httpx.AsyncClient, number: int) -> None:
    """Wait until so many orders are FINISHED."""

    async def look() -> list[tuple[str, str]]:
        return [(each["state"], each["reason"]) for each in (await orders_of(client)).values()]

    await awaited(
        look,
        lambda found: sum(state == "FINISHED" for state, _ in found) >= number,
        seconds=2 * PATIENCE,
        what=f"{number} orders are FINISHED",
    )


async def every_order_finished_once(fleet: Fleet, wire: MqttPeer, names: Sequence[str]) -> None:
    """Start an order service on the store; it has these orders, and each of their actions is done once."""
    client = await started(fleet.order_service())
    assert [await order(client, name) for name in names] == [200] * len(names)
    orders = await every_order_ended(client)
    assert {each["name"]: each["state"] for each in orders} == dict.fromkeys(names, "FINISHED")
    assert actions_done(wire, fleet) == {f"{name}-{leg}": 1 for name in names for leg in range(2)}


async def in_mid_work(fleet: Fleet, names: Sequence[str]) -> tuple[OrderServiceProgram, httpx.AsyncClient]:
    """Start an order service and robots, create orders, and wait until one of them is FINISHED."""
    program = fleet.order_service()
    client = await started(program)
    start_robots(fleet)
    for name in names:
        await order(client, name)
    await finished(client, 1)
    return program, client


async def started(program: OrderServiceProgram) -> httpx.AsyncClient:
    """Wait until an order service is the active one."""
    client = await program.client()

    async def look() -> bool:
        return (await client.get("/v1/transportOrders")).is_success

    await awaited(look, bool, seconds=PATIENCE, what="it answers")
    return client


def ended(program: Program) -> None:
    """End a program in order."""
    program.process.send_signal(signal.SIGTERM)
    assert program.process.wait(ENDED_WITHIN) == 0, program.log
