from __future__ import annotations

from importlib.metadata import version

import httpx

from nena_order_service.service import OrderService


async def test_health_and_readiness(client: httpx.AsyncClient, service: OrderService) -> None:
    alive = await client.get("/healthz")
    assert (alive.status_code, alive.text) == (
        200,
        f"ok\nnena-order-service {version('nena-order-service')}\n",
    )
    answer = await client.get("/readyz")
    assert answer.status_code == 503
    assert "broker" in answer.json()["problems"][0]
    service.mqtt.state.connected = True
    assert (await client.get("/readyz")).json() == {
        "ready": True,
        "role": "active",
        "brokerConnected": True,
        "storeReady": True,
        "loopLag": 0.0,
        "problems": [],
    }
    service.store.problem = "disk full"
    assert "disk full" in (await client.get("/readyz")).json()["problems"][0]


async def test_openapi_describes_every_path(client: httpx.AsyncClient) -> None:
    paths = (await client.get("/openapi.json")).json()["paths"]
    assert {
        "/v1/transportOrders",
        "/v1/transportOrders/{name}",
        "/v1/transportOrders/{name}/withdrawal",
        "/v1/vehicles",
        "/v1/vehicles/{name}",
        "/v1/vehicles/{name}/dispatch",
        "/v1/vehicles/{name}/instantActions",
        "/v1/plantModel",
    } <= set(paths)
