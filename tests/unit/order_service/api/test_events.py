"""The event stream by a real HTTP server."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import httpx
import pytest

from nena_order_service.service import OrderService
from nena_shared.web.server import HttpServer
from nena_shared.web.settings import HttpSettings
from support.waiting import PATIENCE

BODY = {"name": "T-1", "destinations": [{"locationName": "South 2"}]}


@pytest.fixture
async def served(service: OrderService) -> AsyncIterator[httpx.AsyncClient]:
    server = HttpServer(service.app, HttpSettings(port=0))
    task = asyncio.create_task(server.run())
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{server.port}", timeout=PATIENCE) as client:
        yield client
    service.stream.close()
    server.stop()
    await asyncio.wait_for(task, PATIENCE)


async def heard(lines: AsyncIterator[str], event: str) -> list[str]:
    """Read to the end of the next event of this kind; return its lines."""
    found: list[str] = []
    async with asyncio.timeout(PATIENCE):
        async for line in lines:
            if line:
                found.append(line)
            elif f"event: {event}" in found:
                return found
            else:
                found.clear()
    raise AssertionError(event)


async def test_stream_is_followed_and_resumed(served: httpx.AsyncClient) -> None:
    async with served.stream("GET", "/v1/events", params={"kind": "transportOrder"}) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        assert answer.headers["cache-control"] == "no-store"
        lines = answer.aiter_lines()
        assert "id: 0" in await heard(lines, "synced")
        await served.post("/v1/transportOrders", json=BODY)
        assert "id: 1" in await heard(lines, "transportOrder")
    await served.post("/v1/transportOrders/T-1/withdrawal")
    headers = {"Last-Event-ID": "1"}
    async with served.stream("GET", "/v1/events", headers=headers) as answer:
        told = await heard(answer.aiter_lines(), "transportOrder")
        assert told[0] == "id: 2"
        assert '"state":"FAILED"' in told[-1]
    assert (await served.get("/v1/events", params={"kind": "weather"})).status_code == 422


async def test_too_many_clients_is_a_problem(served: httpx.AsyncClient, service: OrderService) -> None:
    service.stream.clients = 100
    answer = await served.get("/v1/events")
    service.stream.clients = 0
    assert answer.status_code == 503
    assert "events.clients" in answer.json()["detail"]
