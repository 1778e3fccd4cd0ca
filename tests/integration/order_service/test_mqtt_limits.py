"""Hosts that send too many requests to a real order service over MQTT: they are told so, and the others are
served.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from functools import wraps
from typing import Any

import httpx
import pytest

from nena_order_service.api import mqtt as mqtt_limits
from nena_order_service.api.orders import OrderOperations
from support.broker import MqttPeer
from support.order_service_fleet import Fleet, listening

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]
STOP = {"locationName": "Goods in", "operation": "Load cargo"}


class Hosts:
    """Sends requests under any host's name."""

    def __init__(self, fleet: Fleet) -> None:
        self._prefix = f"{fleet.prefix}/hosts"
        self._peer: MqttPeer = fleet.peer(f"{self._prefix}/#")

    def ask_for(self, name: str, *, host: str = "wms") -> None:
        body = {"name": name, "destinations": [STOP]}
        self._peer.publish(f"{self._prefix}/{host}/transportOrders/create", json.dumps(body))

    async def answer_to(self, name: str, *, host: str = "wms") -> dict[str, Any]:
        return await self._answer(f"{host}/transportOrders/answer", "name", name)

    async def order(self, name: str, *, host: str = "wms") -> dict[str, Any]:
        self._peer.clear()
        self.ask_for(name, host=host)
        return await self.answer_to(name, host=host)

    def ask_after(self, name: str, *, host: str = "wms") -> None:
        body = {"requestId": name, "transportOrder": name}
        self._peer.publish(f"{self._prefix}/{host}/commands/delivery", json.dumps(body))

    async def told_of(self, name: str, *, host: str = "wms") -> dict[str, Any]:
        return await self._answer(f"{host}/commands/delivery/answer", "requestId", name)

    async def _answer(self, topic: str, key: str, value: str) -> dict[str, Any]:
        message = await self._peer.wait_for(
            f"{self._prefix}/{topic}", lambda each: json.loads(each.payload).get(key) == value
        )
        answer: dict[str, Any] = json.loads(message.payload)
        return answer


class Gate:
    """Delays requests before they are executed, as a slow store does."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, method: str) -> None:
        self.opened = asyncio.Event()
        original = getattr(OrderOperations, method)

        @wraps(original)
        async def waiting(*arguments: object, **named: object) -> object:
            await self.opened.wait()
            return await original(*arguments, **named)

        monkeypatch.setattr(OrderOperations, method, waiting)


async def names(client: httpx.AsyncClient) -> set[str]:
    return {each["name"] for each in (await client.get("/v1/transportOrders")).json()["transportOrders"]}


async def test_orders_beyond_the_limit_are_refused_and_others_continue(
    fleet: Fleet, service: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mqtt_limits, "REQUESTS_LIMIT", 2)
    gate, hosts = Gate(monkeypatch, "create_order"), Hosts(fleet)
    client = await service()
    await listening(client)

    for name in ("T-1", "T-2", "T-3"):
        hosts.ask_for(name)
    refused = await hosts.answer_to("T-3")
    assert (refused["status"], refused["problem"]["title"]) == (503, "Too many requests")
    assert "2 requests are in progress" in refused["problem"]["detail"]
    assert await names(client) == set()

    gate.opened.set()
    assert [(await hosts.answer_to(name))["status"] for name in ("T-1", "T-2")] == [201, 201]
    assert await names(client) == {"T-1", "T-2"}
    assert (await hosts.order("T-3"))["status"] == 201, "there is room again"


async def test_commands_beyond_the_limit_are_refused_and_others_continue(
    fleet: Fleet, service: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mqtt_limits, "REQUESTS_LIMIT", 2)
    gate, hosts = Gate(monkeypatch, "find_delivery"), Hosts(fleet)
    await listening(await service())

    for name in ("T-1", "T-2", "T-3"):
        hosts.ask_after(name)
    assert (await hosts.told_of("T-3"))["status"] == 503
    assert (await hosts.order("T-1", host="mes"))["status"] == 201, "orders are counted by themselves"

    gate.opened.set()
    assert (await hosts.told_of("T-1"))["status"] == 200
    assert (await hosts.told_of("T-2"))["status"] == 404, "there is none"
    hosts.ask_after("T-4")
    assert (await hosts.told_of("T-4"))["status"] == 404, "there is room again"


async def test_only_a_host_over_its_rate_limit_is_refused(fleet: Fleet, service: Start) -> None:
    hosts = Hosts(fleet)
    client = await service(hosts={"requests_per_second": 0.001, "burst": 2})
    await listening(client)

    assert (await hosts.order("T-1"))["status"] == 201
    hosts.ask_after("T-1")
    assert (await hosts.told_of("T-1"))["status"] == 200
    refused = await hosts.order("T-2")
    hosts.ask_after("T-2")
    assert (await hosts.told_of("T-2"))["status"] == 429, "orders and commands are counted together"

    assert (refused["status"], refused["problem"]["status"]) == (429, 429)
    assert "Retry in" in refused["problem"]["detail"]
    assert (await hosts.order("T-3", host="mes"))["status"] == 201
    assert (await client.get("/v1/transportOrders/T-1")).status_code == 200
    assert await names(client) == {"T-1", "T-3"}


async def test_requests_of_a_host_are_executed_in_their_order(
    fleet: Fleet, service: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate = Gate(monkeypatch, "create_order")
    client = await service()
    await listening(client)
    hosts = Hosts(fleet)
    hosts.ask_for("T-1")
    hosts.ask_after("T-1")
    hosts.ask_after("T-1", host="mes")
    assert (await hosts.told_of("T-1", host="mes"))["status"] == 404, "other hosts do not wait"
    gate.opened.set()
    assert (await hosts.told_of("T-1"))["status"] == 200
