"""Web hooks to a real receiver: signed, and kept while the receiver or the order service is away."""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI, Request

from nena_shared.web.server import HttpServer
from nena_shared.web.settings import HttpSettings
from support.broker import free_port
from support.order_service_fleet import Fleet, running
from support.waiting import PATIENCE, awaited, until

pytestmark = pytest.mark.broker

KEY = b"0123456789abcdef0123456789abcdef"
ORDER = {"destinations": [{"locationName": "Storage", "operation": "NOP"}]}


@asynccontextmanager
async def receiving(port: int) -> AsyncIterator[list[str]]:
    """Receive at a port; yield the orders of correctly signed messages."""
    app, orders = FastAPI(), list[str]()

    @app.post("/hook")
    async def hook(request: Request) -> None:
        body, headers = await request.body(), request.headers
        content = f"{headers['webhook-id']}.{headers['webhook-timestamp']}.".encode() + body
        digest = base64.b64encode(hmac.new(KEY, content, hashlib.sha256).digest()).decode()
        assert headers["webhook-signature"] == f"v1,{digest}"
        orders.append((await request.json())["data"]["name"])

    server = HttpServer(app, HttpSettings(port=port))
    task = asyncio.create_task(server.run())
    yield orders
    server.stop()
    await asyncio.wait_for(task, PATIENCE)


async def test_a_message_survives_an_absent_receiver_and_a_restart(fleet: Fleet, tmp_path: Path) -> None:
    port, secret = free_port(), tmp_path / "secret"
    secret.write_text("whsec_" + base64.b64encode(KEY).decode())
    hook = {"name": "wms", "url": f"http://127.0.0.1:{port}/hook", "secret_file": secret}
    settings = fleet.settings(webhooks=[hook])

    async with running(settings) as client:

        async def shown() -> dict[str, Any]:
            found: dict[str, Any] = (await client.get("/v1/webhooks")).json()["webhooks"][0]
            return found

        async with receiving(port) as orders:
            await client.post("/v1/transportOrders", json={"name": "T-1", **ORDER})
            await until(lambda: "T-1" in orders)
        await client.post("/v1/transportOrders", json={"name": "T-2", **ORDER})
        # The first attempt may still find the connection of the message before, and read nothing from it.
        await awaited(shown, lambda hook: "ConnectError" in hook["reason"], what="a refused connection")
        assert (await shown())["state"] == "RETRYING"

    async with receiving(port) as orders, running(settings):
        await until(lambda: "T-2" in orders)
