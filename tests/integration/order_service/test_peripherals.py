"""Doors over a real broker: a loopback robot stops before a door until it is open, also after a kill."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx
import pytest

from nena_demo.peripheral import SimulatedPeripheral
from nena_demo.plants import sample_plant_path
from nena_plant_formats.files import read
from nena_shared.fleet_api.topics import FleetTopics, PeripheralTopic
from nena_shared.tasks import end
from support.aggregator_process import AggregatorProcess
from support.broker import MqttPeer
from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

DOOR = "Door 1/east"
"""With a sign that topics must not have."""
BEFORE, BEHIND = "South 2", "South 3"
GATED = f"{BEFORE} --- {BEHIND}"
ENABLED = "--engine.peripherals.enabled"


def plant_with_door(folder: Path) -> Path:
    """Write the sample plant with a door on the path from `South 2` to `South 3`, as NeNa JSON."""
    plant = json.loads(read(sample_plant_path().read_bytes()).model.to_json())
    (path,) = [each for each in plant["paths"] if each["name"] == GATED]
    operations = [("open", "AFTER_ALLOCATION", True), ("close", "AFTER_MOVEMENT", False)]
    path["peripheralOperations"] = [
        {"name": name, "location": DOOR, "executionTrigger": trigger, "completionRequired": required}
        for name, trigger, required in operations
    ]
    plant["locationTypes"].append({"name": "Doors", "allowedPeripheralOperations": ["open", "close"]})
    plant["locations"].append({"name": DOOR, "xMm": 0, "yMm": 0, "type": "Doors"})
    file = folder / "with-door.json"
    file.write_text(json.dumps(plant))
    return file


@asynccontextmanager
async def door(fleet: Fleet, *, seconds: float) -> AsyncIterator[SimulatedPeripheral]:
    device = SimulatedPeripheral(DOOR, fleet.broker.settings, FleetTopics(fleet.prefix), seconds=seconds)
    running = asyncio.create_task(device.link.run(), name="door")
    try:
        yield device
    finally:
        await end(running)


def topic(fleet: Fleet, of: PeripheralTopic) -> str:
    return FleetTopics(fleet.prefix).peripheral(DOOR, of)


def bases(wire: MqttPeer) -> list[list[str]]:
    """Return the released nodes of each order message."""
    wire.catch_up()
    orders = map(json.loads, wire.payloads("+/v2/+/+/order"))
    return [[each["nodeId"] for each in order["nodes"] if each["released"]] for order in orders]


ORDER = {"name": "T-1", "destinations": [{"locationName": BEHIND, "operation": "MOVE"}]}


async def test_the_robot_gets_the_path_behind_a_door_once_it_is_open(fleet: Fleet) -> None:
    wire = fleet.peer()
    program = fleet.order_service("--plant", plant_with_door(fleet.folder), ENABLED)
    client = await program.client()
    fleet.agent(speed=8.0)
    await vehicle_idle(client)
    await client.post("/v1/transportOrders", json=ORDER)
    asked = json.loads((await wire.wait_for(topic(fleet, PeripheralTopic.JOB))).payload)
    assert (asked["operation"], asked["path"], asked["transportOrder"]) == ("open", GATED, "T-1")
    await order_in(client, "T-1", "BEING_PROCESSED")

    await until(
        lambda: any(f'"lastNodeId":"{BEFORE}"'.encode() in each for each in wire.payloads("+/v2/+/+/state"))
    )

    async def reason() -> str:
        return str((await client.get("/v1/transportOrders/T-1")).json()["reason"])

    asks = f"it waits for peripheral '{DOOR}' to acknowledge 'open'"
    await awaited(reason, lambda told: asks in told, what="it waits for the door")
    assert all(BEHIND not in base for base in bases(wire))

    async with door(fleet, seconds=0.5) as device:
        await order_in(client, "T-1", "FINISHED")
        await until(lambda: device.executed == ["open", "close"])

        async def jobs() -> list[tuple[str, str]]:
            found = (await client.get("/v1/peripheralJobs")).json()["peripheralJobs"]
            return [(each["operation"], each["state"]) for each in found]

        await awaited(jobs, [("close", "FINISHED"), ("open", "FINISHED")].__eq__, what="the last answer")


async def test_killed_while_the_door_opens_it_asks_again_and_the_door_opens_once(fleet: Fleet) -> None:
    wire = fleet.peer()
    arguments = ("--plant", plant_with_door(fleet.folder), ENABLED)
    program = fleet.order_service(*arguments)
    client = await program.client()
    fleet.agent(speed=8.0)
    await vehicle_idle(client)
    async with door(fleet, seconds=8.0) as device:
        await client.post("/v1/transportOrders", json=ORDER)
        await wire.wait_for(topic(fleet, PeripheralTopic.JOB_STATE))
        program.kill()
        assert device.executed == []

        client = await fleet.order_service(*arguments).client()
        await until(lambda: len(wire.payloads(topic(fleet, PeripheralTopic.JOB))) > 1)
        assert all(BEHIND not in base for base in bases(wire))
        await order_in(client, "T-1", "FINISHED")
        await until(lambda: device.executed == ["open", "close"])
    asked = [json.loads(each)["jobId"] for each in wire.payloads(topic(fleet, PeripheralTopic.JOB))]
    assert asked[0] == asked[1]


async def test_killed_while_the_door_opens_unheard_it_learns_of_it_by_asking_again(fleet: Fleet) -> None:
    wire = fleet.peer()
    arguments = ("--plant", plant_with_door(fleet.folder), ENABLED)
    program = fleet.order_service(*arguments)
    client = await program.client()
    fleet.agent(speed=8.0)
    await vehicle_idle(client)
    async with door(fleet, seconds=1.0) as device:
        await client.post("/v1/transportOrders", json=ORDER)
        await wire.wait_for(topic(fleet, PeripheralTopic.JOB_STATE))
        program.kill()
        await until(lambda: device.executed == ["open"])

        client = await fleet.order_service(*arguments).client()
        await order_in(client, "T-1", "FINISHED")
        await until(lambda: device.executed == ["open", "close"])


async def test_hosts_see_devices_and_create_jobs(fleet: Fleet) -> None:
    program = fleet.order_service("--plant", plant_with_door(fleet.folder), ENABLED)
    client = await program.client()
    unknown = {"location": "Nowhere", "operation": "open", "reservationToken": "host"}
    assert (await client.post("/v1/peripheralJobs", json=unknown)).status_code == 404
    impossible = {"location": DOOR, "operation": "fly", "reservationToken": "host"}
    assert (await client.post("/v1/peripheralJobs", json=impossible)).status_code == 422
    job = {"name": "J-1", "location": DOOR, "operation": "open", "reservationToken": "host"}
    assert (await client.post("/v1/peripheralJobs", json=job)).status_code == 201
    assert (await client.post("/v1/peripheralJobs", json=job)).status_code == 409
    (device,) = (await client.get("/v1/peripherals")).json()["peripherals"]
    assert (device["location"], device["job"]["name"]) == (DOOR, "J-1")
    shown = (await client.get("/opentcs/v1/peripheralJobs/J-1")).json()
    assert (shown["state"], shown["peripheralOperation"]["operation"]) == ("BEING_PROCESSED", "open")

    withdrawn = await client.post("/v1/peripheralJobs/J-1/withdrawal")
    assert (withdrawn.status_code, withdrawn.json()["state"]) == (200, "FAILED")
    assert (await client.post("/v1/peripheralJobs/J-1/withdrawal")).status_code == 409


async def test_an_aggregator_started_later_knows_why_the_last_job_failed(fleet: Fleet) -> None:
    wire = fleet.peer()
    client = await fleet.order_service("--plant", plant_with_door(fleet.folder), ENABLED).client()
    job = {"name": "J-1", "location": DOOR, "operation": "open", "reservationToken": "host"}
    await client.post("/v1/peripheralJobs", json=job)
    await wire.wait_for(topic(fleet, PeripheralTopic.JOB))
    answer = {"jobId": "J-1", "state": "FAILED", "reason": "light curtain interrupted"}
    wire.publish(topic(fleet, PeripheralTopic.JOB_STATE), json.dumps(answer))
    await until(lambda: b"interrupted" in wire.payloads(topic(fleet, PeripheralTopic.STATUS))[-1])

    options = ("--topic_prefix", fleet.prefix, "--interface_name", fleet.interface)
    addresses = ("--http.port", "0", "--mqtt.port", str(fleet.broker.port))
    with AggregatorProcess(*addresses, *options) as aggregator:
        async with httpx.AsyncClient(base_url=await aggregator.url(), timeout=PATIENCE) as panel:

            async def devices() -> list[tuple[str, str, str]]:
                found = (await panel.get("/api/v1/peripherals")).json()
                return [(each["id"], job["name"], job["reason"]) for each in found for job in each["jobs"]]

            await awaited(devices, [(DOOR, "J-1", "light curtain interrupted")].__eq__, what="the device")


async def test_the_retained_status_of_a_device_that_the_plant_no_longer_has_is_cleared(fleet: Fleet) -> None:
    topics = FleetTopics(fleet.prefix)
    wire = fleet.peer()
    removed = topics.peripheral("Removed/door", PeripheralTopic.STATUS)
    wire.publish(removed, "{}", retain=True)
    program = fleet.order_service("--plant", plant_with_door(fleet.folder), ENABLED)
    await program.client()

    await until(lambda: wire.payloads(removed)[-1:] == [b""])
    assert json.loads((await wire.wait_for(topic(fleet, PeripheralTopic.STATUS))).payload)["usedBy"] == []
