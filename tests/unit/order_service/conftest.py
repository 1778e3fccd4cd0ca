from __future__ import annotations

import re
from collections.abc import AsyncIterator, Callable
from http import HTTPStatus
from pathlib import Path
from typing import Any

import httpx
import pytest

from nena_demo.plants import sample_plant_path
from nena_order_service.extension import installed
from nena_order_service.plant_file import load_plant
from nena_order_service.service import OrderService
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.schema import open_database
from nena_order_service.store.store import Store
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.settings import settings_with
from nena_shared.tasks import Supervisor
from nena_shared.web.problem import MEDIA_TYPE
from support.scripted_fleet import MemoryStore

CHECKED = {each.status for each in Refusal} - {HTTPStatus.UNPROCESSABLE_ENTITY}
"""422 is also the status of malformed requests, which any operation may answer."""


def documented_statuses(openapi: dict[str, Any]) -> list[tuple[str, re.Pattern[str], set[str]]]:
    """Return method, pattern of the path, and documented statuses of each operation."""
    return [
        (method.upper(), re.compile(re.sub(r"\{[^}]*\}", "[^/]+", path)), set(operation["responses"]))
        for path, methods in openapi["paths"].items()
        for method, operation in methods.items()
    ]


@pytest.fixture
def settings(tmp_path: Path) -> OrderServiceSettings:
    """Return settings without openTCS's web API, which takes half of the time to build a service."""
    return settings_with(OrderServiceSettings, installed()).model_validate(
        {
            "plant": sample_plant_path(),
            "store": {"url": f"sqlite:///{tmp_path}/orders.db"},
            "max_body": 4096,
            "opentcs_prefix": "",
        }
    )


@pytest.fixture
async def service(settings: OrderServiceSettings) -> AsyncIterator[OrderService]:
    """Yield an order service without a broker, so that orders are accepted and wait."""
    store = Store(open_database(settings.store.location()))
    made = OrderService(settings, load_plant(settings.plant).model, store)
    async with Supervisor() as supervisor:
        supervisor.start("store", made.store.run())
        await made.hosts.locks.load()
        await made.engine.start(made.fleet)
        yield made
    made.store.close()


@pytest.fixture
def failing_create(service: OrderService, monkeypatch: pytest.MonkeyPatch) -> str:
    """Make the creation of orders raise an unexpected error; return its text."""
    inside = "secret"

    def fail(*_: object) -> None:
        raise KeyError(inside)

    monkeypatch.setattr(service.engine, "create", fail)
    return inside


@pytest.fixture(scope="session")
def documented() -> list[tuple[str, re.Pattern[str], set[str]]]:
    """Return what :func:`documented_statuses` has returned; the first client that needs it fills the list.

    The description takes 0.3 s, and is the same for each service.
    """
    return []


@pytest.fixture
async def client(
    service: OrderService, documented: list[tuple[str, re.Pattern[str], set[str]]]
) -> AsyncIterator[httpx.AsyncClient]:
    transport = httpx.ASGITransport(service.app, raise_app_exceptions=False)

    async def check(answer: httpx.Response) -> None:
        """Expect a refusal of an operation to be documented by its status, not only as 4XX."""
        request, refused = answer.request, answer.status_code in {status.value for status in CHECKED}
        if not refused or not answer.headers["content-type"].startswith(MEDIA_TYPE):
            return
        if not documented:
            documented.extend(documented_statuses(service.app.openapi()))
        for method, pattern, statuses in documented:
            if method == request.method and pattern.fullmatch(request.url.path):
                assert str(answer.status_code) in statuses, (method, request.url.path, await answer.aread())
                return

    hooks: dict[str, list[Callable[..., Any]]] = {"response": [check]}
    async with httpx.AsyncClient(
        transport=transport, base_url="http://order-service", event_hooks=hooks
    ) as made:
        yield made


@pytest.fixture
def store() -> MemoryStore:
    return MemoryStore()
