"""The order service is killed in mid-work: nothing is lost, nothing is done twice."""

from __future__ import annotations

import json
import sqlite3

import httpx
import pytest

from support.broker import MqttPeer
from support.order_service_fleet import Fleet, actions_done, every_order_ended, order_in, vehicle_idle
from support.programs import ENDED_WITHIN
from support.waiting import until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

LOAD = {"locationName": "Goods in", "operation": "Load cargo"}
UNLOAD = {"locationName": "Storage", "operation": "Unload cargo"}


@pytest.mark.clause("6.6/restart")
async def test_killed_during_an_order_it_continues_from_the_robots_position(fleet: Fleet) -> None:
    wire = fleet.peer()
    program = fleet.order_service()
    client = await program.client()
    fleet.agent(speed=8.0)
    await vehicle_idle(client)
    for number in range(2):
        body = {"name": f"T-{number}", "idempotencyKey": f"k-{number}", "destinations": [LOAD, UNLOAD]}
        assert (await client.post("/v1/transportOrders", json=body)).status_code == 201
    await order_in(client, "T-0", "BEING_PROCESSED")
    await until(lambda: any(b'"driving":true' in state for state in wire.payloads("+/v2/+/+/state")))
    program.kill()

    client = await fleet.order_service().client()
    again = {"name": "T-0", "idempotencyKey": "k-0", "destinations": [LOAD, UNLOAD]}
    answer = await client.post("/v1/transportOrders", json=again)
    assert (answer.status_code, answer.json()["name"]) == (200, "T-0")

    orders = await every_order_ended(client)
    assert {order["name"]: order["state"] for order in orders} == {f"T-{n}": "FINISHED" for n in range(2)}
    adopted = next(order for order in orders if order["name"] == "T-0")
    assert "nena:adoptedAfterRestart" in [entry["eventCode"] for entry in adopted["history"]]
    assert actions_done(wire, fleet) == {f"T-{order}-{leg}": 1 for order in range(2) for leg in range(2)}


@pytest.mark.long
@pytest.mark.clause("6.6/restart")
async def test_killed_again_and_again_under_load_every_order_is_done_once(fleet: Fleet) -> None:
    wire = fleet.peer()
    fleet.agent("robot-01")
    fleet.agent("robot-02", x=15.0, y=2.0)
    answered: set[str] = set()
    for turn in range(4):
        program = fleet.order_service()
        client = await program.client()
        seen = len(wire.received("+/v2/+/+/order"))
        for number in range(4):
            name = f"T-{turn}-{number}"
            body = {"name": name, "idempotencyKey": name, "destinations": [LOAD, UNLOAD]}
            assert (await client.post("/v1/transportOrders", json=body)).status_code == 201
            answered.add(name)
        await until(lambda seen=seen: len(wire.received("+/v2/+/+/order")) > seen + 1)  # type: ignore[misc] # bound at once
        program.kill()

    client = await fleet.order_service().client()
    orders = await every_order_ended(client)
    assert {order["name"] for order in orders} == answered
    assert {order["state"] for order in orders} == {"FINISHED"}, [order["reason"] for order in orders]
    done = actions_done(wire, fleet)
    assert done == {f"{name}-{leg}": 1 for name in answered for leg in range(2)}


async def test_withdrawn_order_stays_withdrawn_after_a_restart(fleet: Fleet) -> None:
    wire = fleet.peer()
    program = fleet.order_service()
    client = await program.client()
    agent = fleet.agent(speed=0.5)
    await vehicle_idle(client)
    await client.post("/v1/transportOrders", json={"name": "T-1", "destinations": [LOAD]})
    await wire.wait_for(f"{fleet.interface}/v2/+/+/order")
    agent.process.send_signal(19)
    try:
        answer = await client.post("/v1/transportOrders/T-1/withdrawal")
        assert answer.json()["state"] == "WITHDRAWN"
        program.kill()
    finally:
        agent.process.send_signal(18)
    client = await fleet.order_service().client()
    assert "withdrawn" in (await order_in(client, "T-1", "FAILED"))["reason"]
    await vehicle_idle(client)


async def test_unpublished_end_is_published_after_the_restart(fleet: Fleet) -> None:
    program = fleet.order_service()
    client = await program.client()
    await client.post("/v1/transportOrders", json={"name": "T-1", "destinations": [LOAD]})
    topic = f"{fleet.prefix}/transportOrders/T-1/status"
    with MqttPeer(fleet.broker, topic) as host:
        stale = await host.wait_for(topic)
    await client.post("/v1/transportOrders/T-1/withdrawal")
    program.kill()
    host = fleet.peer(topic)
    host.publish(topic, stale.payload, retain=True)  # as if the kill had come before the end was told
    await host.wait_for(topic, lambda message: message.payload == stale.payload and not message.retained)
    host.clear()

    fleet.order_service()
    await host.wait_for(topic, lambda message: message.payload == b"")
    assert json.loads(host.payloads(topic)[0])["state"] == "FAILED"


async def test_a_status_under_the_topic_of_an_older_version_is_cleared(fleet: Fleet) -> None:
    """It did not encode the name."""
    program = fleet.order_service()
    client = await program.client()
    await client.post("/v1/transportOrders", json={"name": "T-1.5", "destinations": [LOAD]})
    topic, old = (f"{fleet.prefix}/transportOrders/{level}/status" for level in ("T-1%2E5", "T-1.5"))
    host = fleet.peer(topic, old)
    status = await host.wait_for(topic)
    host.publish(old, status.payload, retain=True)
    program.kill()
    host.clear()

    fleet.order_service()
    await host.wait_for(old, lambda message: message.payload == b"")
    assert json.loads((await host.wait_for(topic)).payload)["name"] == "T-1.5"


@pytest.mark.long
async def test_unpublished_end_of_a_sequence_is_published_after_the_restart(fleet: Fleet) -> None:
    program = fleet.order_service()
    client = await program.client()
    await client.post("/v1/orderSequences", json={"name": "S"})
    topic, lost = (f"{fleet.prefix}/orderSequences/{name}/status" for name in ("S", "lost"))
    with MqttPeer(fleet.broker, topic) as host:
        stale = await host.wait_for(topic)
    await client.post("/v1/orderSequences/S/completion")
    program.kill()
    host = fleet.peer(topic, lost)
    for each in (topic, lost):
        host.publish(each, stale.payload, retain=True)  # as if the kill had come before the end was told
        await host.wait_for(each, lambda message: message.payload == stale.payload and not message.retained)
    host.clear()

    fleet.order_service()
    for each in (topic, lost):
        await host.wait_for(each, lambda message: message.payload == b"")
    assert json.loads(host.payloads(topic)[0])["finished"] is True


async def test_second_order_service_cannot_use_the_store(fleet: Fleet) -> None:
    """Its files alone keep the second one away: a lock beside them could be deleted."""
    await fleet.order_service().client()
    for file in fleet.folder.glob("*orders*"):
        if file.name not in ("orders.db", "orders.db-wal", "orders.db-shm"):
            file.unlink()
    second = fleet.order_service()
    await until(lambda: second.process.poll() is not None)
    assert second.process.returncode == 1
    assert "another order service uses" in second.log


async def test_answered_requests_are_in_the_file(fleet: Fleet) -> None:
    program = fleet.order_service()
    client = await program.client()
    answer: httpx.Response = await client.post("/v1/transportOrders", json={"destinations": [LOAD]})
    program.kill()
    with sqlite3.connect(fleet.folder / "orders.db") as store:
        assert store.execute("SELECT name FROM transport_orders").fetchall() == [(answer.json()["name"],)]


async def test_a_store_that_is_deleted_takes_no_orders_and_ends_the_program(fleet: Fleet) -> None:
    program = fleet.order_service()
    async with await program.client() as client:
        assert (await client.post("/v1/transportOrders", json={"destinations": [LOAD]})).status_code == 201
        for file in fleet.folder.glob("orders.db*"):
            file.unlink()
        refused = await client.post("/v1/transportOrders", json={"destinations": [LOAD]})
        assert (refused.status_code, "was deleted while in use" in refused.json()["detail"]) == (503, True)
        ready = await client.get("/readyz")
        assert (ready.status_code, ready.json()["storeReady"]) == (503, False)
    assert program.process.wait(ENDED_WITHIN) == 1, program.log
    assert "was deleted while in use, so orders could not be saved" in program.log.splitlines()[-1]
