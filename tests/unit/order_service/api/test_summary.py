from __future__ import annotations

import httpx

ORDER = {"destinations": [{"locationName": "South 2"}]}


async def test_orders_and_vehicles_are_counted_by_state(client: httpx.AsyncClient) -> None:
    empty = await client.get("/v1/summary")
    assert empty.json() == {"transportOrders": {}, "vehicles": {"UNKNOWN": 2}, "oldestOrder": None}

    for name in ("TO-1", "TO-2", "TO-3"):
        assert (await client.post("/v1/transportOrders", json={**ORDER, "name": name})).status_code == 201
    await client.post("/v1/transportOrders/TO-1/withdrawal")

    found = (await client.get("/v1/summary")).json()
    assert sum(found["transportOrders"].values()) == 2
    assert found["oldestOrder"] == "TO-2"


async def test_the_traffic_plan_is_empty_without_positions(
    client: httpx.AsyncClient,
) -> None:
    plan = (await client.get("/v1/traffic/plan")).json()
    assert (plan["horizon"], plan["vehicles"]) == (60, [])
