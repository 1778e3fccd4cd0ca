"""Broker and PostgreSQL from the images of docker-compose.yml, killed and started again under orders."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.broker import Broker
from support.images import ImageBroker, ImagePostgres, image_of, why_not_there
from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.postgres import Postgres
from support.waiting import awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

LOAD = {"locationName": "Goods in", "operation": "Load cargo"}
UNLOAD = {"locationName": "Storage", "operation": "Unload cargo"}


def is_there(variable: str, instead: str) -> bool:
    """Return whether an image can be used, and warn if a local program replaces it."""
    image = image_of(variable)
    why = why_not_there(image)
    if why:
        warnings.warn(f"{instead} of this machine stands in for the image {image}: {why}", stacklevel=2)
    return not why


@pytest.fixture
def site_broker() -> Iterator[Broker | ImageBroker]:
    made = ImageBroker() if is_there("MOSQUITTO_IMAGE", "Mosquitto") else Broker()
    yield made
    made.close()


@pytest.fixture
def site_database() -> Iterator[Postgres | ImagePostgres]:
    made = ImagePostgres() if is_there("POSTGRES_IMAGE", "PostgreSQL") else Postgres()
    yield made
    made.close()


@pytest.mark.parametrize(
    ("fixture", "local", "told"),
    [
        ("site_broker", Broker, "Mosquitto of this machine stands in for the image eclipse-mosquitto:"),
        ("site_database", Postgres, "PostgreSQL of this machine stands in for the image postgres:"),
    ],
)
def test_missing_image_is_replaced_by_a_local_program_with_a_notice(
    fixture: str,
    local: type[Broker | Postgres],
    told: str,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys.modules[__name__], "why_not_there", "no image {}: docker pull".format)

    with pytest.warns(UserWarning, match=rf"^{re.escape(told)}\S+: no image \S+: docker pull$"):
        made = request.getfixturevalue(fixture)

    assert isinstance(made, local)


@pytest.fixture
def site(
    site_broker: Broker | ImageBroker,
    site_database: Postgres | ImagePostgres,
    interface_name: str,
    tmp_path: Path,
) -> Iterator[Fleet]:
    made = Fleet(site_broker, interface_name, tmp_path, store_url=site_database.url)
    with made.stack:
        yield made


async def test_orders_survive_restarts_of_broker_and_database(
    site: Fleet, site_broker: Broker | ImageBroker, site_database: Postgres | ImagePostgres
) -> None:
    service = site.order_service()
    client = await service.client()
    site.agent()
    await vehicle_idle(client)

    async def create(name: str) -> int:
        order = {"name": name, "idempotencyKey": name, "destinations": [LOAD, UNLOAD]}
        return (await client.post("/v1/transportOrders", json=order)).status_code

    assert await create("T-1") == 201
    await order_in(client, "T-1", "FINISHED")

    site_broker.kill()
    assert await create("T-2") == 201
    site_broker.start()
    await order_in(client, "T-2", "FINISHED")

    assert await create("T-3") == 201
    await order_in(client, "T-3", "BEING_PROCESSED", "FINISHED")
    site_database.stop()
    assert await create("T-4") == 503
    site_database.start()
    assert await awaited(lambda: create("T-4"), lambda code: code != 503, what="orders are taken") in (
        200,
        201,
    )

    service.kill()
    client = await site.order_service().client()
    for name in ("T-1", "T-2", "T-3", "T-4"):
        assert (await order_in(client, name, "FINISHED", "FAILED"))["state"] == "FINISHED"
