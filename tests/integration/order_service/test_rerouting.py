"""Rerouting over a real broker: robots take the other route, and nothing violates the standard."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from datetime import datetime
from typing import Any
from urllib.parse import quote

import httpx
import pytest

from nena_conversations.checker import check
from nena_conversations.recording import Entry
from nena_conversations.rules import Severity
from support.broker import MqttPeer
from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.broker, pytest.mark.clause("6.1.2/fleet", "6.1.3/fleet")]

Start = Callable[..., Awaitable[httpx.AsyncClient]]


async def lock(client: httpx.AsyncClient, path: str, *, locked: bool) -> None:
    answer = await client.put(f"/v1/paths/{quote(path)}/lock", json={"locked": locked})
    assert answer.status_code == 200, answer.text


async def is_at(client: httpx.AsyncClient, point: str) -> None:
    async def look() -> Any:
        return (await client.get("/v1/vehicles/Robot-01")).json()["currentPosition"]

    await awaited(look, lambda at: at == point, seconds=PATIENCE, what=f"Robot-01 at {point}")


async def leads_over(client: httpx.AsyncClient, point: str) -> None:
    async def look() -> list[str]:
        order = (await client.get("/v1/transportOrders/T-1")).json()
        route: list[str] = order["driveOrders"][0]["route"]
        return route

    await awaited(look, lambda route: point in route, seconds=PATIENCE, what=f"a way over {point}")


async def waits(client: httpx.AsyncClient, reason: str) -> None:
    async def look() -> str:
        return str((await client.get("/v1/transportOrders/T-1")).json()["reason"])

    await awaited(look, lambda said: reason in said, seconds=PATIENCE, what=f"T-1 says {reason!r}")


def sent(wire: MqttPeer, fleet: Fleet) -> list[dict[str, Any]]:
    """Return the VDA 5050 orders sent to the robot, with their points."""
    wire.catch_up()
    messages = wire.received(f"{fleet.interface}/+/NeNa/robot-01/order")
    return [json.loads(each.payload) for each in messages]


def way(order: dict[str, Any]) -> list[str]:
    return [node["nodeId"] for node in order["nodes"]]


@pytest.mark.parametrize(
    "version", [*(pytest.param(each, marks=pytest.mark.long) for each in ("2.0.0", "2.1.0")), "3.0.0"]
)
async def test_replanned_routes_are_joined_to_the_base(fleet: Fleet, service: Start, version: str) -> None:
    wire = fleet.peer()
    client = await service(engine={"release_ahead": 1})
    fleet.agent("robot-01", version=version, x=3.0, y=12.0, speed=2.0)
    await vehicle_idle(client)
    body = {"name": "T-1", "destinations": [{"locationName": "Packing", "operation": "Load cargo"}]}
    assert (await client.post("/v1/transportOrders", json=body)).status_code == 201

    await wire.wait_for(f"{fleet.interface}/+/NeNa/robot-01/order")
    await lock(client, "Middle gate --- Middle 3", locked=True)
    await leads_over(client, "South 3")
    await is_at(client, "South 3")
    answer = await client.post("/v1/vehicles/Robot-01/rerouting", json={"type": "FORCED"})
    assert (answer.status_code, answer.json()["outcome"]) == (200, "STOPPING"), answer.text
    await waits(client, "travels")
    await lock(client, "Middle 4 --- Packing stand", locked=True)
    await waits(client, "waits until path")
    await lock(client, "Middle 4 --- Packing stand", locked=False)

    order = await order_in(client, "T-1", "FINISHED", "FAILED")
    assert order["state"] == "FINISHED", order["reason"]
    assert [each["eventCode"] for each in order["history"]].count("nena:rerouted") >= 2
    orders = sent(wire, fleet)
    assert any("South 3" in way(each) for each in orders if each["orderId"] == "T-1-0")
    assert {each["orderId"] for each in orders} >= {"T-1-0", "T-1-0~1"}
    entries = [
        Entry(datetime.fromisoformat(json.loads(each.payload)["timestamp"]), each.topic, each.payload)
        for each in wire.received(f"{fleet.interface}/+/NeNa/robot-01/+")
    ]
    assert [each for each in check(entries) if each.severity is Severity.ERROR] == []


async def test_commands_over_mqtt_and_a_vehicle_without_an_order(fleet: Fleet, service: Start) -> None:
    client = await service()
    answer = await client.post("/v1/vehicles/Robot-01/rerouting", json={})
    assert (answer.status_code, answer.json()["title"]) == (409, "Conflict")
    peer = fleet.peer(f"{fleet.prefix}/hosts/wms/commands/reroute/answer")
    peer.publish(f"{fleet.prefix}/hosts/wms/commands/reroute", b'{"vehicle": "Robot-01", "requestId": "7"}')

    message = await peer.wait_for()

    told = json.loads(message.payload)
    assert (told["status"], told["requestId"]) == (409, "7")
    assert "no transport order" in told["problem"]["detail"]
