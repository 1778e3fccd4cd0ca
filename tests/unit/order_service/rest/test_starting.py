from __future__ import annotations

import httpx
import pytest

from nena_order_service.api.server import make_starting_app
from nena_shared.fleet_api.transport_order import Problem


def client(problem: str) -> httpx.AsyncClient:
    transport = httpx.ASGITransport(make_starting_app(lambda: problem))
    return httpx.AsyncClient(transport=transport, base_url="http://starting")


async def test_it_is_well_and_says_what_it_waits_for() -> None:
    async with client("database or disk is full") as starting:
        assert (await starting.get("/healthz")).status_code == 200
        ready = await starting.get("/readyz")

    assert ready.status_code == 503
    assert (ready.json()["role"], ready.json()["ready"], ready.json()["storeReady"]) == (
        "starting",
        False,
        False,
    )
    assert "database or disk is full" in ready.json()["problems"][0]


@pytest.mark.parametrize("method", ["GET", "POST", "PUT", "DELETE"])
async def test_everything_else_is_for_later(method: str) -> None:
    async with client("database or disk is full") as starting:
        answer = await starting.request(method, "/v1/transportOrders")

    told = Problem.model_validate_json(answer.content)
    assert (answer.status_code, told.status, answer.headers["retry-after"]) == (503, 503, "1")
    assert "database or disk is full" in told.detail
    assert "store.url" in told.detail
