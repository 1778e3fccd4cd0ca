"""Programs that are stopped during work: answered requests are kept, and no answer is false."""

from __future__ import annotations

import asyncio
import json
import signal
from itertools import count
from typing import Any

import httpx
import pytest

from nena_shared import tasks
from support.aggregator_process import AggregatorProcess
from support.order_service_fleet import (
    Fleet,
    actions_done,
    every_order_ended,
    listening,
    vehicle_idle,
)
from support.order_service_work import ended
from support.programs import ENDED_WITHIN, Program
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

LOAD = {"locationName": "Goods in", "operation": "Load cargo"}
UNLOAD = {"locationName": "Storage", "operation": "Unload cargo"}
HOSTS = 8


class Host:
    """Creates orders without a pause, until the service does not answer."""

    def __init__(self, client: httpx.AsyncClient) -> None:
        self._client = client
        self.asked: list[str] = []
        self.answered: list[str] = []
        self.refused: list[str] = []

    async def order_on(self, name: str) -> None:
        number = 0
        while True:
            number += 1
            order = f"{name}-{number}"
            self.asked.append(order)
            try:
                answer = await order_from(self._client, order)
            except httpx.TransportError:
                return
            (self.answered if answer.is_success else self.refused).append(answer.json().get("name", order))


async def order_from(client: httpx.AsyncClient, name: str, *stops: dict[str, str]) -> httpx.Response:
    body = {"name": name, "idempotencyKey": name, "destinations": list(stops or (LOAD,))}
    return await client.post("/v1/transportOrders", json=body)


async def test_an_order_service_stopped_under_load_keeps_all_answered_requests(fleet: Fleet) -> None:
    program = fleet.order_service()
    client = await program.client()
    host = Host(client)
    asking = [asyncio.create_task(host.order_on(f"H-{number}")) for number in range(HOSTS)]
    await until(lambda: len(host.answered) > 5 * HOSTS)

    program.process.send_signal(signal.SIGTERM)
    await asyncio.wait_for(asyncio.gather(*asking), PATIENCE)

    assert program.process.wait(ENDED_WITHIN) == 0
    assert host.refused == []
    again = await fleet.order_service().client()
    known = [await order_from(again, name) for name in host.answered]
    assert {answer.status_code for answer in known} == {200}, "what was answered is there"
    unanswered = set(host.asked) - set(host.answered)
    assert len(unanswered) <= HOSTS
    assert all([(await order_from(again, name)).is_success for name in unanswered])


class MqttHosts:
    """Order over MQTT without a pause, each the next one when the last one is answered."""

    def __init__(self, fleet: Fleet) -> None:
        self._prefix = f"{fleet.prefix}/hosts"
        self.peer = fleet.peer(f"{self._prefix}/+/transportOrders/answer")
        self.asked: list[str] = []
        self.taken: dict[str, str] = {}
        """The name of the order for each key that was answered."""

    async def order_on(self, host: str) -> None:
        for number in count():
            key = f"{host}-{number}"
            self.asked.append(key)
            status, self.taken[key] = await self.order(key)
            assert status == 201

    async def order(self, key: str) -> tuple[int, str]:
        topic = f"{self._prefix}/{key.split('-', 1)[0]}/transportOrders"
        self.peer.publish(f"{topic}/create", json.dumps({"idempotencyKey": key, "destinations": [LOAD]}))
        sign = f'"idempotencyKey":"{key}"'.encode()
        message = await self.peer.wait_for(f"{topic}/answer", lambda each: sign in each.payload)
        answer = json.loads(message.payload)
        assert "problem" not in answer, answer["problem"]
        return answer["status"], answer["name"]


async def end_while_asked(program: Program, hosts: MqttHosts) -> list[str]:
    """Stop the program while hosts continue; return the keys of unanswered requests."""
    asking = [asyncio.create_task(hosts.order_on(f"h{number}")) for number in range(HOSTS)]
    await until(lambda: len(hosts.taken) > 5 * HOSTS)
    program.process.send_signal(signal.SIGTERM)
    await until(lambda: program.process.poll() is not None, what="it ends while hosts go on")
    assert program.process.returncode == 0, program.log
    assert [each for each in asking if each.done()] == [], "nobody was refused"
    await tasks.end(*asking)
    hosts.peer.clear()
    return [key for key in hosts.asked if key not in hosts.taken]


async def test_mqtt_orders_during_shutdown_are_saved_or_accepted_when_resent(
    fleet: Fleet,
) -> None:
    program, hosts = fleet.order_service(), MqttHosts(fleet)
    await listening(await program.client())

    unanswered = await end_while_asked(program, hosts)
    assert len(unanswered) == HOSTS, "each has asked on"
    client = await fleet.order_service().client()
    await listening(client)

    known = {key: await hosts.order(key) for key in hosts.taken}
    assert known == {key: (200, name) for key, name in hosts.taken.items()}, "what was answered is there"
    again = [await hosts.order(key) for key in unanswered]
    listed = (await client.get("/v1/transportOrders", params={"limit": 1000})).json()["transportOrders"]
    names = sorted(each["name"] for each in listed)
    assert names == sorted([*hosts.taken.values(), *(name for _, name in again)]), "none is lost or twice"


async def test_an_agent_stopped_during_an_order_continues_it_later(fleet: Fleet) -> None:
    wire = fleet.peer()
    client = await fleet.order_service().client()
    agent = fleet.agent(speed=1.0)
    await vehicle_idle(client)
    await order_from(client, "T-1", LOAD, UNLOAD)
    await until(lambda: any(b'"driving":true' in state for state in wire.payloads("+/v2/+/+/state")))

    ended(agent)
    await until(lambda: b"OFFLINE" in wire.payloads("+/v2/+/+/connection")[-1])
    assert (await client.get("/v1/transportOrders/T-1")).json()["state"] == "BEING_PROCESSED"
    fleet.agent(speed=40.0)

    (order,) = await every_order_ended(client)
    assert order["state"] == "FINISHED", order["reason"]
    assert actions_done(wire, fleet) == {"T-1-0": 1, "T-1-1": 1}
    assert not any(b'"actionStatus":"FAILED"' in state for state in wire.payloads("+/v2/+/+/state"))


async def test_a_stopped_aggregator_has_written_everything_it_received(fleet: Fleet) -> None:
    options = (
        *("--mqtt.port", str(fleet.broker.port), "--http.port", "0", "--topic_prefix", fleet.prefix),
        *("--interface_name", fleet.interface, "--interface_name_v3", fleet.interface),
        *("--history.url", f"sqlite:///{fleet.folder}/history.db"),
    )
    client = await fleet.order_service().client()
    with AggregatorProcess(*options, "--history.interval", "30") as aggregator:
        async with httpx.AsyncClient(base_url=await aggregator.url(), timeout=PATIENCE) as panel:
            await order_from(client, "T-1")
            await client.post("/v1/transportOrders/T-1/withdrawal", json={})
            await wait_for_end(panel, "T-1")
        assert aggregator.end() == 0
    with AggregatorProcess(*options) as aggregator:
        async with httpx.AsyncClient(base_url=await aggregator.url(), timeout=PATIENCE) as panel:
            kept = (await panel.get("/api/v1/history", params={"order": "T-1"})).json()["entries"]
    assert "FAILED" in json.dumps(kept)


async def wait_for_end(panel: httpx.AsyncClient, name: str) -> None:
    async def orders() -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = (await panel.get("/api/v1/orders")).json()
        return found

    def ended(found: list[dict[str, Any]]) -> bool:
        return any(each["name"] == name and each["final"] for each in found)

    await awaited(orders, ended, seconds=PATIENCE, what=f"the end of {name} is known")
