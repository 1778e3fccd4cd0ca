from __future__ import annotations

import asyncio

import httpx
import pytest
from fastapi import FastAPI

from nena_order_service.http_server import HttpServer
from nena_shared.program import StartError
from nena_shared.settings import HttpSettings


async def test_answers_on_a_free_port_until_it_is_stopped() -> None:
    app = FastAPI()
    app.add_api_route("/here", lambda: "yes")
    server = HttpServer(app, HttpSettings(port=0))
    task = asyncio.create_task(server.run())
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{server.port}") as client:
        assert (await client.get("/here")).json() == "yes"
    server.stop()
    await asyncio.wait_for(task, 10)


def test_port_in_use_is_one_line_that_says_what_to_do() -> None:
    first = HttpServer(FastAPI(), HttpSettings(port=0))
    with pytest.raises(StartError, match=rf"port {first.port}: Address already in use\. Set http\.port"):
        HttpServer(FastAPI(), HttpSettings(port=first.port))
    first._socket.close()


def test_address_of_another_machine_is_refused() -> None:
    with pytest.raises(StartError, match=r"192\.0\.2\.1 port 0"):
        HttpServer(FastAPI(), HttpSettings(host="192.0.2.1", port=0))
