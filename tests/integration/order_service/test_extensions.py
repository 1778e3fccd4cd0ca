"""The order service's extension of docs/extensions.md works when it is installed as its page says."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path

import pytest

from nena_order_service.extension import GROUP, installed
from support.extension_packages import chat_room, install, install_example
from support.order_service_fleet import Fleet, running
from support.waiting import PATIENCE

pytestmark = pytest.mark.broker

ORDER = {"name": "T-1", "destinations": [{"locationName": "Storage", "operation": "NOP"}]}


@pytest.fixture
def packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Yield a folder from which Python imports packages."""
    monkeypatch.syspath_prepend(tmp_path)
    installed.cache_clear()
    yield tmp_path
    installed.cache_clear()
    sys.modules.pop("acme_chat", None)


async def test_the_example_tells_of_a_failed_order(fleet: Fleet, packages: Path) -> None:
    install_example(packages, GROUP)
    async with chat_room() as (url, posted), running(fleet.settings(chat={"url": url})) as client:
        await client.post("/v1/transportOrders", json=ORDER)
        await client.post("/v1/transportOrders/T-1/withdrawal", json={"reason": "not needed"})
        async with asyncio.timeout(PATIENCE):
            assert "T-1 failed: " in (await posted.get())["text"]


@pytest.mark.provokes_failures
async def test_an_extension_adds_operations_routes_and_applications_and_may_fail(
    fleet: Fleet, packages: Path
) -> None:
    code = """
from fastapi import APIRouter, FastAPI
from pydantic import BaseModel
from nena_order_service.extension import Extension, Handler
from nena_shared.fleet_api.operations.operation import Operation

class Greeting(BaseModel):
    text: str

class Broken(Extension):
    def order_changed(self, status):
        raise ValueError

    def handlers(self):
        greet = Operation("greet", "Greet.", "GET", "/v1/greetings", Greeting)
        yield Handler(greet, lambda: Greeting(text="hello"))

    def routers(self):
        router = APIRouter(prefix="/v1/weather")
        router.get("")(lambda: {"rain": False})
        return [router]

    def apps(self):
        app = FastAPI()
        app.get("/v1/list")(lambda: ["a"])
        return {"/legacy": app}
"""
    install(packages, "acme_chat", code, group=GROUP, entry="broken = acme_chat:Broken")
    async with running(fleet.settings()) as client:
        created = await client.post("/v1/transportOrders", json=ORDER)
        assert created.status_code == HTTPStatus.CREATED
        assert (await client.get("/v1/greetings")).json() == {"text": "hello"}
        assert (await client.get("/v1/weather")).json() == {"rain": False}
        assert (await client.get("/legacy/v1/list")).json() == ["a"]
        assert "/v1/greetings" in (await client.get("/openapi.json")).json()["paths"]
