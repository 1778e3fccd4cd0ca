from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest

from nena_demo.plants import sample_plant_path
from nena_order_service.plant_file import load_plant
from nena_order_service.service import OrderService, build
from nena_order_service.settings import OrderServiceSettings, StoreSettings
from nena_order_service.store.schema import open_database
from nena_order_service.store.store import Store
from nena_shared.tasks import Supervisor


@pytest.fixture
def settings(tmp_path: Path) -> OrderServiceSettings:
    return OrderServiceSettings(
        plant=sample_plant_path(),
        store=StoreSettings.model_validate({"url": f"sqlite:///{tmp_path}/orders.db"}),
        max_body=4096,
    )


@pytest.fixture
async def service(settings: OrderServiceSettings) -> AsyncIterator[OrderService]:
    """Give an order service without a broker, so that orders are taken and wait."""
    store = Store(open_database(settings.store.location()))
    made = build(settings, load_plant(settings.plant).model, store)
    async with Supervisor() as supervisor:
        supervisor.start("store", made.store.run())
        await made.hosts.locks.load()
        await made.engine.start(made.fleet)
        yield made
    made.store.close()


@pytest.fixture
def failing_create(service: OrderService, monkeypatch: pytest.MonkeyPatch) -> str:
    """Have a fault of the program in the creation of orders; gives what its error says."""
    inside = "secret"

    def fail(*_: object) -> None:
        raise KeyError(inside)

    monkeypatch.setattr(service.engine, "create", fail)
    return inside


@pytest.fixture
async def client(service: OrderService) -> AsyncIterator[httpx.AsyncClient]:
    transport = httpx.ASGITransport(service.app, raise_app_exceptions=False)
    async with httpx.AsyncClient(transport=transport, base_url="http://order-service") as made:
        yield made
