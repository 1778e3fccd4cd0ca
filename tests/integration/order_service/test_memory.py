from __future__ import annotations

import pytest

from support.order_service_fleet import Fleet, every_order_ended
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

ROBOTS = 50
LIMIT_MB = 150
"""Resident; the imports alone take 101."""


async def test_fifty_robots_need_little_memory(fleet: Fleet) -> None:
    program = fleet.order_service("--engine.adopt_unknown", "--no-engine.traffic")
    client = await program.client()
    fleet.agent("many", count=ROBOTS, x=3.0, y=2.0)

    async def idle() -> int:
        vehicles = (await client.get("/v1/vehicles")).json()["vehicles"]
        return sum(vehicle["state"] == "IDLE" for vehicle in vehicles)

    await awaited(idle, lambda count: count == ROBOTS, seconds=PATIENCE, what=f"{ROBOTS} robots are there")
    for number in range(2 * ROBOTS):
        body = {"name": f"T-{number}", "destinations": [{"locationName": "South 2"}]}
        assert (await client.post("/v1/transportOrders", json=body)).status_code == 201
    orders = await every_order_ended(client)
    assert [order["state"] for order in orders] == ["FINISHED"] * 2 * ROBOTS
    assert program.memory_mb <= LIMIT_MB
