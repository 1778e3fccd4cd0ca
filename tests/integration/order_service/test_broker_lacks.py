"""Brokers that do less than MQTT requires: what is missing is said, and made up for as far as possible."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from nena_demo.plants import sample_plant_path
from nena_plant_formats.files import read
from nena_shared.mqtt.broker_check import LACKS, BrokerLack
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, BrokerAddress
from support.brokers import RabbitMq
from support.order_service_fleet import Fleet, listening, running, vehicle_idle
from support.waiting import PATIENCE, awaited

pytestmark = pytest.mark.broker

TRIP = [
    {"locationName": "Goods in", "operation": "Load cargo"},
    {"locationName": "Storage", "operation": "Unload cargo"},
]


@pytest.fixture
def fleet(each_broker: BrokerAddress, interface_name: str, tmp_path: Path) -> Iterator[Fleet]:
    made = Fleet(each_broker, interface_name, tmp_path)
    with made.stack:
        yield made


async def problems(client: httpx.AsyncClient) -> list[str]:
    return list((await client.get("/readyz")).json()["problems"])


async def test_aggregator_that_starts_last_shows_the_fleet(fleet: Fleet) -> None:
    """A robot that has gone, one that waits, and the orders: RabbitMQ retains them, but delivers none."""
    lacks = ["retained"] if isinstance(fleet.broker, RabbitMq) else []
    async with running(fleet.settings()) as client:
        await listening(client)
        gone = fleet.agent("robot-02", x=1.0, y=7.0)
        await vehicle_idle(client, "Robot-02")
        gone.process.terminate()
        fleet.agent()
        await vehicle_idle(client)
        body = {"name": "waits", "intendedVehicle": "Robot-02", "destinations": TRIP}
        assert (await client.post("/v1/transportOrders", json=body)).status_code == 201
        said = [LACKS[BrokerLack(each)] for each in lacks]
        await awaited(lambda: problems(client), said.__eq__, what=f"the problems {said}")

        options = ["--interface_name", fleet.interface, "--interface_name_v3", fleet.interface]
        options += ["--mqtt.port", str(fleet.broker.port), "--topic_prefix", fleet.prefix, "--http.port", "0"]
        with AggregatorProcess(*options) as aggregator:
            async with httpx.AsyncClient(base_url=await aggregator.url(), timeout=PATIENCE) as panel:

                async def shown() -> Any:
                    return (await panel.get("/api/v1/fleet")).json()

                def is_complete(view: Any) -> bool:
                    robots = {robot["name"]: robot["connection"] for robot in view["robots"]}
                    return (
                        robots == {"Robot-01": "ONLINE", "Robot-02": "OFFLINE"}
                        and [order["name"] for order in view["orders"]] == ["waits"]
                        and view["orderService"]["brokerLacks"] == lacks
                    )

                await awaited(shown, is_complete, what="the whole fleet")
                assert ("problem" in (await panel.get("/readyz")).json()) is bool(lacks)


async def test_names_that_the_broker_changes_are_told(fleet: Fleet) -> None:
    found = json.loads(read(sample_plant_path().read_bytes()).model.to_json())
    found["vehicles"][1]["properties"]["vda5050:serialNumber"] = "Robot.2"
    file = fleet.folder / "plant.json"
    file.write_text(json.dumps(found))
    lack = not isinstance(fleet.broker, Broker)
    async with running(fleet.settings(plant=file)) as client:
        await listening(client)
        await awaited(
            lambda: problems(client), lambda told: (LACKS[BrokerLack.NAMES] in told) is lack, what="the names"
        )


async def test_a_broker_that_changes_all_topics_is_told(
    changing_broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    fleet = Fleet(changing_broker, interface_name, tmp_path)
    with fleet.stack:
        async with running(fleet.settings()) as client:
            found = await awaited(lambda: problems(client), bool, what="the changed topics")
    assert "mount_point" in found[0]
