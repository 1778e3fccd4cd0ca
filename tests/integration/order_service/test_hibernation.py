"""A host hibernates, wakes and shuts down a robot, over REST and MQTT: no order is lost meanwhile."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

from nena_shared.vda5050.versions import CODECS
from support.broker import MqttPeer
from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.programs import Program
from support.waiting import PATIENCE, awaited

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]
IN_3 = tuple(each for each in CODECS if each >= "3")
WAKE_UP = {"key": "wakeUpTime", "value": "2100-01-01T00:00:00.000Z"}
SLEEP = {"actionType": "startHibernation", "parameters": [WAKE_UP]}
PATIENT = {"instant_action_timeout": PATIENCE}
WAKE = {"actionType": "stopHibernation"}
SHUTDOWN = {"actionType": "shutdown"}


def sleepy(fleet: Fleet, version: str, *, power: bool = True, speed: float = 40.0) -> Program:
    """Start a robot that offers hibernation and shutdown."""
    content = fleet.agent_file(version=version, speed=speed)
    return fleet.agent_of(content.replace("[loopback]", f"[loopback]\npower = {str(power).lower()}"))


async def act(client: httpx.AsyncClient, request: dict[str, Any]) -> httpx.Response:
    return await client.post("/v1/vehicles/Robot-01/instantActions", json=request)


async def vehicle(client: httpx.AsyncClient, **fields: str) -> dict[str, Any]:
    """Wait until the vehicle has these fields, and return it."""

    async def look() -> dict[str, Any]:
        found: dict[str, Any] = (await client.get("/v1/vehicles/Robot-01")).json()
        return found

    return await awaited(
        look,
        lambda told: {key: told.get(key) for key in fields} == fields,
        seconds=PATIENCE,
        what=f"Robot-01 with {fields}",
    )


async def create(client: httpx.AsyncClient, name: str) -> None:
    request = {"name": name, "destinations": [{"locationName": "South 2"}], "intendedVehicle": "Robot-01"}
    answer = await client.post("/v1/transportOrders", json=request)
    assert answer.status_code == 201, answer.text


def orders_sent(wire: MqttPeer) -> set[str]:
    wire.catch_up()
    return {json.loads(each)["orderId"] for each in wire.payloads("+/+/+/+/order")}


@pytest.mark.clause("6.2.3/hibernationAsked", "6.5/fleet")
@pytest.mark.parametrize("version", IN_3)
async def test_an_order_waits_until_its_robot_is_awake(fleet: Fleet, service: Start, version: str) -> None:
    wire = fleet.peer()
    client = await service(engine=PATIENT)
    sleepy(fleet, version)
    await vehicle_idle(client)

    slept = await act(client, SLEEP)
    assert (slept.status_code, slept.json()["status"]) == (200, "FINISHED"), slept.text
    before = await vehicle(client, connection="HIBERNATING")
    await create(client, "T")
    waiting = await order_in(client, "T", "DISPATCHABLE")
    assert "is hibernating" in json.dumps((await client.get("/v1/transportOrders/T/assignment")).json())
    other = await act(client, {"actionType": "pause"})
    assert other.status_code == 409
    assert "HIBERNATING until stopHibernation" in other.json()["detail"]
    during = await vehicle(client, connection="HIBERNATING")
    assert (during["currentPosition"], during["connection"]) == (before["currentPosition"], "HIBERNATING")
    assert (waiting["state"], orders_sent(wire)) == ("DISPATCHABLE", set())

    woken = await act(client, WAKE)
    assert (woken.status_code, woken.json()["status"]) == (200, "FINISHED"), woken.text
    done = await order_in(client, "T", "FINISHED", "FAILED")
    assert done["state"] == "FINISHED", done["reason"]


@pytest.mark.clause("6.2.3/hibernationAsked")
@pytest.mark.parametrize("request_", [SLEEP, SHUTDOWN], ids=lambda each: each["actionType"])
async def test_a_robot_with_an_order_is_neither_hibernated_nor_shut_down(
    fleet: Fleet, service: Start, request_: dict[str, Any]
) -> None:
    client = await service(engine=PATIENT)
    sleepy(fleet, "3.0.1", speed=0.5)
    await vehicle_idle(client)
    await create(client, "T")
    await order_in(client, "T", "BEING_PROCESSED")

    refused = await act(client, request_)

    assert refused.status_code == 409
    assert "'Robot-01' works on order 'T'" in refused.json()["detail"]


@pytest.mark.clause("6.2.3/hibernationAsked")
@pytest.mark.parametrize(("version", "request_"), [("2.1.0", SLEEP), ("3.0.1", SHUTDOWN)])
async def test_a_robot_that_does_not_list_it_is_not_sent_it(
    fleet: Fleet, service: Start, version: str, request_: dict[str, Any]
) -> None:
    wire = fleet.peer()
    client = await service(engine=PATIENT)
    sleepy(fleet, version, power=version == "2.1.0")
    await vehicle_idle(client)

    refused = (await act(client, request_)).json()

    assert refused["status"] == "FAILED"
    assert refused["reason"].startswith("not sent: the robot cannot execute it")
    wire.catch_up()
    assert request_["actionType"] not in str(wire.payloads("+/+/+/+/instantActions"))


@pytest.mark.clause("6.2.3/hibernationAsked")
async def test_a_host_does_the_same_over_mqtt(fleet: Fleet, service: Start) -> None:
    host = fleet.peer(f"{fleet.prefix}/#")
    client = await service(engine=PATIENT)
    sleepy(fleet, "3.0.1")
    await vehicle_idle(client)

    async def command(body: dict[str, Any]) -> dict[str, Any]:
        topic = f"{fleet.prefix}/hosts/wms/commands/instantAction"
        host.clear()
        host.publish(topic, json.dumps({"requestId": "r", "vehicle": "Robot-01", **body}))
        answer: dict[str, Any] = json.loads((await host.wait_for(f"{topic}/answer")).payload)
        return answer

    assert (await command(SLEEP))["instantAction"]["status"] == "FINISHED"
    await vehicle(client, connection="HIBERNATING")
    assert (await command(WAKE))["instantAction"]["status"] == "FINISHED"
    await vehicle_idle(client)


@pytest.mark.clause("6.2.3/hibernationAsked", "6.2.3/shutdown")
async def test_a_robot_is_shut_down_and_started_again(fleet: Fleet, service: Start) -> None:
    client = await service(engine=PATIENT)
    robot = sleepy(fleet, "3.0.0")
    await vehicle_idle(client)

    gone = await act(client, SHUTDOWN)
    assert (gone.status_code, gone.json()["status"]) == (200, "FINISHED"), gone.text
    await vehicle(client, connection="OFFLINE")
    assert robot.process.wait(PATIENCE) == 0
    await create(client, "T")
    sleepy(fleet, "3.0.0")

    done = await order_in(client, "T", "FINISHED", "FAILED")
    assert done["state"] == "FINISHED", done["reason"]
