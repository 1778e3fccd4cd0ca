"""Robots that fail on purpose, orders that are held or late, and restarts in the middle of all that."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

from support.broker import MqttPeer
from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.programs import Program
from support.waiting import awaited

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]

LOAD = {"locationName": "Goods in", "operation": "Load cargo"}
UNLOAD = {"locationName": "Storage", "operation": "Unload cargo"}
FAILING = {"action_types": {"Load cargo": "failOnce", "Unload cargo": "failAlways"}}
SLOW = 0.5
"""m/s"""


def rehearsing(fleet: Fleet, version: str = "2.1.0") -> Program:
    """Start a robot whose actions fail on purpose."""
    content = fleet.agent_file(version=version)
    return fleet.agent_of(content.replace("[loopback]", "[loopback]\nrehearsal = true"))


async def create(client: httpx.AsyncClient, *stops: dict[str, Any], **requests: object) -> None:
    answer = await client.post(
        "/v1/transportOrders", json={"name": "T", "destinations": list(stops), **requests}
    )
    assert answer.status_code == 201, answer.text


def order_ids(wire: MqttPeer) -> set[str]:
    wire.catch_up()
    return {json.loads(each)["orderId"] for each in wire.payloads("+/+/+/+/order")}


def instant_actions(wire: MqttPeer) -> list[str]:
    wire.catch_up()
    messages = [json.loads(each) for each in wire.payloads("+/+/+/+/instantActions")]
    return [action["actionType"] for message in messages for action in message["actions"]]


def codes(order: dict[str, Any]) -> list[str]:
    return [entry["eventCode"].removeprefix("nena:") for entry in order["history"]]


@pytest.mark.parametrize(
    ("version", "orders", "asked"),
    [("2.1.0", {"T-0", "T-0~1"}, set()), ("3.0.0", {"T-0"}, {"retry"})],
)
@pytest.mark.clause("6.2.3/retryAsked")
async def test_an_action_that_fails_once_is_retried(
    fleet: Fleet, service: Start, version: str, orders: set[str], asked: set[str]
) -> None:
    wire = fleet.peer()
    client = await service(engine=FAILING)
    rehearsing(fleet, version)
    await vehicle_idle(client)
    await create(client, LOAD, onFailure=[{"do": "RETRY", "times": 2}])

    done = await order_in(client, "T", "FINISHED", "FAILED")
    assert (done["state"], codes(done).count("retried")) == ("FINISHED", 1)
    assert order_ids(wire) == orders
    assert set(instant_actions(wire)) & {"retry", "skipRetry"} == asked


@pytest.mark.parametrize("version", ["2.1.0", "3.0.0"])
async def test_an_action_that_always_fails_is_skipped(fleet: Fleet, service: Start, version: str) -> None:
    client = await service(engine=FAILING)
    rehearsing(fleet, version)
    await vehicle_idle(client)
    skipping = {**UNLOAD, "onFailure": [{"do": "RETRY"}, {"do": "SKIP"}]}
    await create(client, skipping, {"locationName": "South 2"})

    done = await order_in(client, "T", "FINISHED", "FAILED")
    assert [each["state"] for each in done["driveOrders"]] == ["FAILED", "FINISHED"]
    assert [each for each in codes(done) if each in ("retried", "skipped")] == ["retried", "skipped"]


async def test_a_late_order_is_cancelled_at_the_robot(fleet: Fleet, service: Start) -> None:
    wire = fleet.peer()
    client = await service()
    fleet.agent(speed=SLOW)
    await vehicle_idle(client)
    await create(client, LOAD, processingTimeout=2)

    late = await order_in(client, "T", "FAILED")
    assert "timeout: not done within 2 s" in late["reason"]
    assert "the robot has released it" in late["reason"]
    assert "cancelOrder" in instant_actions(wire)
    await vehicle_idle(client)


@pytest.mark.e2e
async def test_a_held_order_survives_a_kill_and_continues_when_resumed(fleet: Fleet) -> None:
    program = fleet.order_service()
    client = await program.client()
    fleet.agent(speed=1.0)  # the hold comes while it drives, on a slow machine too
    await vehicle_idle(client)
    await create(client, LOAD)
    await order_in(client, "T", "BEING_PROCESSED")
    held = (await client.post("/v1/transportOrders/T/hold", json={"by": "Ann", "reason": "tea"})).json()
    assert (held["held"]["by"], held["state"]) == ("Ann", "BEING_PROCESSED")
    program.kill()

    client = await fleet.order_service().client()

    async def vehicle() -> dict[str, Any]:
        found: dict[str, Any] = (await client.get("/v1/vehicles/Robot-01")).json()
        return found

    standing = await awaited(vehicle, lambda told: told.get("state") == "IDLE", what="the robot stands")
    assert (standing["transportOrder"], standing["processingState"]) == ("T", "PROCESSING_ORDER")
    assert standing["reason"].startswith("held by Ann since")
    order = (await client.get("/v1/transportOrders/T")).json()
    assert order["held"] == held["held"]
    await client.post("/v1/transportOrders/T/resume", json={"by": "Ann"})
    assert "resumed" in codes(await order_in(client, "T", "FINISHED"))


@pytest.mark.e2e
async def test_killed_between_two_attempts_it_retries(fleet: Fleet) -> None:
    wire = fleet.peer()
    mapped = ("--engine.action_types", json.dumps(FAILING["action_types"]))
    program = fleet.order_service(*mapped)
    client = await program.client()
    rehearsing(fleet)
    await vehicle_idle(client)
    await create(client, LOAD, onFailure=[{"do": "RETRY", "after": 4}])

    async def order() -> dict[str, Any]:
        found: dict[str, Any] = (await client.get("/v1/transportOrders/T")).json()
        return found

    waiting = await awaited(order, lambda told: bool(told.get("nextTry")), what="it waits")
    assert "it retries at" in waiting["reason"]
    program.kill()

    client = await fleet.order_service(*mapped).client()
    done = await order_in(client, "T", "FINISHED")
    assert codes(done).count("retried") == 1
    assert order_ids(wire) == {"T-0", "T-0~1"}
