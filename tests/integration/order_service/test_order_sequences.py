"""Order sequences and dependencies with real robots, over both doors and both stores."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

from support.order_service_fleet import Fleet, actions_done, every_order_ended, order_in, vehicle_idle
from support.postgres import Postgres
from support.waiting import awaited

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

LOAD = {"locationName": "Goods in", "operation": "Load cargo"}
UNLOAD = {"locationName": "Storage", "operation": "Unload cargo"}
AWAY = {"locationName": "South 2"}

Start = Callable[..., Awaitable[httpx.AsyncClient]]


@pytest.fixture(params=[pytest.param("sqlite", marks=pytest.mark.long), "postgresql"])
def site(request: pytest.FixtureRequest, fleet: Fleet) -> Fleet:
    """Return a fleet with one kind of store."""
    if request.param == "postgresql":
        postgres: Postgres = request.getfixturevalue("postgres")
        fleet.store_url = postgres.url
    return fleet


async def created(client: httpx.AsyncClient, name: str, *stops: dict[str, str], **fields: Any) -> None:
    body = {"name": name, "destinations": list(stops), **fields}
    answer = await client.post("/v1/transportOrders", json=body)
    assert answer.status_code == 201, answer.text


async def sequence(client: httpx.AsyncClient, name: str) -> dict[str, Any]:
    found: dict[str, Any] = (await client.get(f"/v1/orderSequences/{name}")).json()
    return found


async def test_killed_during_a_sequence_the_same_robot_executes_the_rest_in_order(site: Fleet) -> None:
    wire = site.peer()
    program = site.order_service()
    client = await program.client()
    site.agent("robot-01", speed=20.0)
    site.agent("robot-02", x=15.0, y=2.0, speed=20.0)
    await vehicle_idle(client, "Robot-01")
    await vehicle_idle(client, "Robot-02")
    made = await client.post("/v1/orderSequences", json={"name": "S", "failureFatal": True})
    assert made.status_code == 201
    for number in range(2):
        await created(client, f"T-{number}", LOAD, UNLOAD, wrappingSequence="S")
    await created(client, "after", AWAY, dependencies=["T-1"])
    await order_in(client, "T-1", "BEING_PROCESSED")
    vehicle = (await sequence(client, "S"))["processingVehicle"]
    assert (await order_in(client, "after", "ACTIVE"))["reason"] == "waits until 'T-1' is finished"
    program.kill()

    client = await site.order_service(name="again").client()

    async def look() -> dict[str, Any]:
        return await sequence(client, "S")

    told = await awaited(look, lambda now: "name" in now, what="it is taken up")
    assert (told["processingVehicle"], told["finishedIndex"] >= 0, told["complete"]) == (vehicle, True, False)
    assert (await client.post("/v1/orderSequences/S/completion")).status_code == 200
    orders = {order["name"]: order for order in await every_order_ended(client, 120)}
    assert {name: order["state"] for name, order in orders.items()} == dict.fromkeys(orders, "FINISHED")
    assert len(orders) == 3
    assert {orders[f"T-{number}"]["processingVehicle"] for number in range(2)} == {vehicle}
    ends = [orders[name]["finished"] for name in ("T-0", "T-1", "after")]
    assert ends == sorted(ends)
    told = await awaited(look, lambda now: now["finished"], what="it is finished")
    assert (told["finishedIndex"], told["orders"]) == (1, ["T-0", "T-1"])
    assert (await client.get(f"/v1/vehicles/{vehicle}")).json()["orderSequence"] is None
    assert actions_done(wire, site) == {f"T-{order}-{leg}": 1 for order in range(2) for leg in range(2)}


async def test_a_sequence_created_over_mqtt_publishes_its_progress(fleet: Fleet, service: Start) -> None:
    client = await service()
    fleet.agent()
    await vehicle_idle(client)
    hosts = f"{fleet.prefix}/hosts/wms"
    peer = fleet.peer(f"{fleet.prefix}/#")
    peer.publish(f"{hosts}/commands/createOrderSequence", json.dumps({"name": "S"}))
    await peer.wait_for(f"{hosts}/commands/createOrderSequence/answer")
    body = {"name": "T-1", "destinations": [LOAD], "wrappingSequence": "S"}
    peer.publish(f"{hosts}/transportOrders/create", json.dumps(body))
    await order_in(client, "T-1", "FINISHED")
    vehicle = await awaited(
        lambda: vehicle_of(client), lambda now: now["orderSequence"] == "S", what="it is bound"
    )
    assert vehicle["processingState"] == "AWAITING_ORDER"
    peer.publish(f"{hosts}/commands/completeOrderSequence", json.dumps({"orderSequence": "S"}))
    topic = f"{fleet.prefix}/orderSequences/S/status"
    await peer.wait_for(topic, lambda message: message.payload == b"")
    told = [json.loads(each.payload) for each in peer.received(topic) if each.payload]
    assert [each["version"] for each in told] == sorted({each["version"] for each in told})
    assert (told[0]["orders"], told[-1]["finished"], told[-1]["finishedIndex"]) == ([], True, 0)
    assert (await vehicle_of(client))["processingState"] == "IDLE"


async def vehicle_of(client: httpx.AsyncClient) -> dict[str, Any]:
    found: dict[str, Any] = (await client.get("/v1/vehicles/Robot-01")).json()
    return found
