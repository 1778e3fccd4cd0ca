"""Names that some brokers refuse or change, and robots that the broker refuses: the fleet stays online."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from nena_demo.peripheral import SimulatedPeripheral
from nena_demo.plants import sample_plant_path
from nena_plant_formats.files import read
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt.broker_check import LACKS, BrokerLack
from nena_shared.tasks import end
from support.broker import BrokerAddress, MqttPeer
from support.brokers import UNDELIVERABLE, RabbitMq
from support.order_service_fleet import Fleet, listening, order_in, running, vehicle_idle
from support.waiting import awaited

pytestmark = pytest.mark.broker

DEVICE = "$Tür 2.1/+#%*> east"
DEVICE_LEVEL = "%24Tür%202%2E1%2F%2B%23%25%2A%3E%20east"
TRIP = [
    {"locationName": "Goods in", "operation": "Load cargo"},
    {"locationName": "Storage", "operation": "Unload cargo"},
]
NO_NAMES = ("a b", "$x", "Tür", "50%", "a/b", "+", "#", "*", ">", ".hidden", "")
"""No names of orders: none of them reaches the broker."""
PERIPHERALS = {"peripherals": {"enabled": True}}


def plant(folder: Path) -> Path:
    """Write the sample plant with a device of a difficult name, and a robot that the broker refuses."""
    found = json.loads(read(sample_plant_path().read_bytes()).model.to_json())
    found["locationTypes"].append({"name": "Doors", "allowedPeripheralOperations": ["open", "close"]})
    found["locations"].append({"name": DEVICE, "xMm": 0, "yMm": 0, "type": "Doors"})
    (second,) = [each for each in found["vehicles"] if each["name"] == "Robot-02"]
    second["properties"]["vda5050:serialNumber"] = UNDELIVERABLE
    file = folder / "plant.json"
    file.write_text(json.dumps(found))
    return file


@pytest.fixture
def fleet(each_broker: BrokerAddress, interface_name: str, tmp_path: Path) -> Iterator[Fleet]:
    made = Fleet(each_broker, interface_name, tmp_path)
    with made.stack:
        yield made


def host_creates(host: MqttPeer, fleet: Fleet, name: str) -> None:
    body = json.dumps({"name": name, "destinations": TRIP})
    host.publish(f"{fleet.prefix}/hosts/wms/transportOrders/create", body)


async def connects(client: httpx.AsyncClient) -> int:
    text = (await client.get("/metrics")).text
    (found,) = re.findall(r"^nena_mqtt_connects_total (\d+)", text, re.MULTILINE)
    return int(found)


async def test_difficult_names_on_each_broker(fleet: Fleet) -> None:
    host = fleet.peer(f"{fleet.prefix}/#")
    async with running(fleet.settings(plant=plant(fleet.folder), engine=PERIPHERALS)) as client:
        await listening(client)
        device = SimulatedPeripheral(DEVICE, fleet.broker.settings, FleetTopics(fleet.prefix), seconds=0.05)
        opening = asyncio.create_task(device.link.run(), name="device")
        fleet.agent()
        await vehicle_idle(client)

        for name in NO_NAMES:
            body = {"name": name, "destinations": TRIP}
            assert (await client.post("/v1/transportOrders", json=body)).status_code == 422
            host.clear()
            host_creates(host, fleet, name)
            answer = await host.wait_for(f"{fleet.prefix}/hosts/wms/transportOrders/answer")
            assert json.loads(answer.payload)["status"] == 422
        host_creates(host, fleet, "WMS-2.2")
        created = await client.post("/v1/transportOrders", json={"name": "WMS-2.1", "destinations": TRIP})
        assert created.status_code == 201
        job = {"name": "J.1", "location": DEVICE, "operation": "open", "reservationToken": "host"}
        assert (await client.post("/v1/peripheralJobs", json=job)).status_code == 201

        for name, level in (("WMS-2.1", "WMS-2%2E1"), ("WMS-2.2", "WMS-2%2E2")):
            assert (await order_in(client, name, "FINISHED", "FAILED"))["state"] == "FINISHED"
            topic = f"{fleet.prefix}/transportOrders/{level}/status"
            await host.wait_for(topic, lambda each: b'"FINISHED"' in each.payload)
        await host.wait_for(f"{fleet.prefix}/peripherals/{DEVICE_LEVEL}/jobState")

        async def job_state() -> str:
            return str((await client.get("/v1/peripheralJobs/J.1")).json()["state"])

        await awaited(job_state, "FINISHED".__eq__, what="the end of the device's job")
        assert await connects(client) == 1
        missing = [LACKS[BrokerLack.RETAINED]] if isinstance(fleet.broker, RabbitMq) else []
        assert (await client.get("/readyz")).json()["problems"] == missing
        await end(opening)


async def test_an_order_to_a_robot_that_the_broker_refuses_fails_with_the_reason(
    rabbitmq: RabbitMq, interface_name: str, tmp_path: Path
) -> None:
    fleet = Fleet(rabbitmq, interface_name, tmp_path)
    with fleet.stack:
        async with running(fleet.settings(plant=plant(tmp_path))) as client:
            await listening(client)
            fleet.agent()
            fleet.agent(UNDELIVERABLE, x=1.0, y=7.0)  # out of the way, in the parking bay
            await vehicle_idle(client)
            await vehicle_idle(client, "Robot-02")
            for name, vehicle in (("refused", "Robot-02"), ("other", "Robot-01")):
                body = {"name": name, "intendedVehicle": vehicle, "destinations": TRIP}
                assert (await client.post("/v1/transportOrders", json=body)).status_code == 201

            refused = await order_in(client, "refused", "FAILED", "FINISHED")
            topic = f"{interface_name}/v2/NeNa/{UNDELIVERABLE}/order"
            assert refused["state"] == "FAILED"
            assert topic in refused["reason"]
            assert '"undeliverable"' in json.dumps(refused["codedReason"])
            assert (await order_in(client, "other", "FINISHED", "FAILED"))["state"] == "FINISHED"
            ready = await client.get("/readyz")
            assert ready.status_code == 200
            assert any(topic in each for each in ready.json()["problems"])
