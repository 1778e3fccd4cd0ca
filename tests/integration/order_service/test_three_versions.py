"""Agents of all versions side by side under one order service: each does its order in its own version."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from datetime import datetime

import httpx
import pytest

from nena_conversations.checker import check
from nena_conversations.recording import Entry
from nena_conversations.rules import Severity
from nena_shared.vda5050.topics import Topic
from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.schemas import schema_problems

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]

FLEETS = (
    {"robot-01": "2.0.0", "robot-02": "2.1.0", "robot-03": "3.0.0"},
    {"robot-01": "3.0.0", "robot-02": "3.0.1"},
)
VEHICLES = {"robot-01": "Robot-01", "robot-02": "Robot-02", "robot-03": "robot-03"}
PLACES = {"robot-01": (3.0, 2.0), "robot-02": (3.0, 12.0), "robot-03": (21.0, 12.0)}
TARGETS = {"robot-01": "South 4", "robot-02": "North 3", "robot-03": "Packing stand"}


@pytest.mark.clause("4.2", "6.1.1", "7.2")
@pytest.mark.parametrize("versions", FLEETS, ids=["three", "both of 3.0"])
async def test_each_robot_executes_its_order_in_its_version(
    fleet: Fleet, service: Start, versions: dict[str, str]
) -> None:
    wire = fleet.peer()
    client = await service(engine={"adopt_unknown": True})
    for serial, version in versions.items():
        x, y = PLACES[serial]
        fleet.agent(serial, x=x, y=y, version=version)
    for serial in versions:
        vehicle = VEHICLES[serial]
        await vehicle_idle(client, vehicle)
        order = {
            "name": f"T-{serial}",
            "intendedVehicle": vehicle,
            "destinations": [
                {"locationName": "Goods in", "operation": "Load cargo"},
                {"locationName": TARGETS[serial], "operation": "MOVE"},
            ],
        }
        assert (await client.post("/v1/transportOrders", json=order)).status_code == 201

    for serial in versions:
        order = await order_in(client, f"T-{serial}", "FINISHED", "FAILED")
        assert order["state"] == "FINISHED", order["reason"]

    wire.catch_up()
    for serial, version in versions.items():
        level = f"{fleet.interface}/v{version[0]}/NeNa/{serial}"
        messages = [each for each in wire.received() if each.topic.startswith(f"{level}/")]
        while not messages[0].topic.endswith("/connection"):
            messages.pop(0)  # before it connects, it is asked for its state in the oldest minor version
        kinds = {each.topic.rsplit("/", 1)[1] for each in messages}
        assert kinds >= {Topic.ORDER, Topic.STATE, Topic.CONNECTION, Topic.FACTSHEET}
        for each in messages:
            assert json.loads(each.payload)["version"] == version
            assert schema_problems(version, each.topic.rsplit("/", 1)[1], each.payload) == []


@pytest.mark.clause("6.1.2/fleet", "6.6.3/fleet")
@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0", "3.0.1"])
async def test_a_route_is_released_stepwise_and_conforms_to_the_standard(
    fleet: Fleet, service: Start, version: str
) -> None:
    wire = fleet.peer()
    client = await service(engine={"release_ahead": 1})
    fleet.agent("robot-01", version=version)
    await vehicle_idle(client)
    body = {"name": "T-1", "destinations": [{"locationName": "North 3", "operation": "MOVE"}]}
    assert (await client.post("/v1/transportOrders", json=body)).status_code == 201

    order = await order_in(client, "T-1", "FINISHED", "FAILED")
    assert order["state"] == "FINISHED", order["reason"]

    wire.catch_up()
    entries = [
        Entry(datetime.fromisoformat(json.loads(each.payload)["timestamp"]), each.topic, each.payload)
        for each in wire.received(f"{fleet.interface}/+/NeNa/robot-01/+")
    ]
    sent = [json.loads(each.payload) for each in entries if each.topic.endswith("/order")]
    assert max(each["orderUpdateId"] for each in sent) >= 2
    assert [each for each in check(entries) if each.severity is Severity.ERROR] == []
