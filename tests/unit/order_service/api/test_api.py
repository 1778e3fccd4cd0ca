from __future__ import annotations

from importlib.metadata import version

import httpx
from starlette.routing import Mount, Router

from nena_order_service.service import OrderService
from support.problems import problem

ORDERS = "/v1/transportOrders"


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


async def test_below_another_path_operations_are_answered_alike(service: OrderService) -> None:
    transport = httpx.ASGITransport(Router([Mount("/site", service.app)]))
    async with httpx.AsyncClient(transport=transport, base_url="http://order-service") as client:
        body = {"name": "T-1", "destinations": [{"locationName": "Goods in"}]}
        made = await client.post(f"/site{ORDERS}", json=body)
        assert (made.status_code, made.headers["location"]) == (201, f"{ORDERS}/T-1")
        problem(await client.post(f"/site{ORDERS}", json=[]), 422)
        problem(await client.get(f"/site{ORDERS}/T-9"), 404)


async def test_a_header_that_an_operation_does_not_know_is_ignored(client: httpx.AsyncClient) -> None:
    body = {"location": "Door 1", "operation": "open", "reservationToken": "host"}
    answer = await client.post("/v1/peripheralJobs", json=body, headers={"Idempotency-Key": "key-1"})
    assert "Door 1" in problem(answer, 404).detail
