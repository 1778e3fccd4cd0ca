"""*Stop all* while the order service hangs, is dead, or is replaced by its standby: real programs."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

import httpx
import pytest

from support.aggregator_process import AggregatorProcess
from support.broker import Broker, MqttPeer, free_port
from support.order_service_fleet import Fleet, role, vehicle_idle
from support.postgres import Postgres
from support.programs import OrderServiceProgram
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

ROBOTS = 2
PAUSED_WITHIN = 5.0
"""Seconds from the click to the last robot that reports the pause: 2 of waiting for the order service, the
rest for the work; on a machine that is so busy that a start takes longer than usual, as much longer."""
USUAL_START_SECONDS = 2.5
DRILL = {"by": "Anna", "reason": "fire drill"}
OVER = {"by": "Ben", "reason": "over"}


@dataclass
class Site:
    """A fleet with two robots, its order service, and an aggregator in front of it."""

    fleet: Fleet
    service: OrderServiceProgram
    orders: httpx.AsyncClient
    panel: httpx.AsyncClient
    robots: MqttPeer
    busy: float
    """How much longer than usual a start takes on this machine, at least 1."""

    def paused(self) -> int:
        """Return how many robots report that they are paused."""
        last: dict[str, bool] = {}
        for message in self.robots.received(f"{self.fleet.interface}/v2/+/+/state"):
            last[message.topic] = json.loads(message.payload)["paused"]
        return sum(last.values())

    async def stop_all(self) -> tuple[dict[str, Any], float]:
        """Stop all robots; return the answer, and the seconds until all of them report the pause."""
        begun = time.monotonic()
        answer = await self.panel.post("/api/v1/control/stops", json=DRILL)
        assert answer.status_code == 200, answer.text
        await until(lambda: self.paused() == ROBOTS, what="all robots are paused")
        return answer.json(), time.monotonic() - begun

    async def stops(self) -> list[dict[str, Any]]:
        """Return the stops that the panel shows."""
        shown: list[dict[str, Any]] = (await self.panel.get("/api/v1/fleet")).json()["orderService"]["stops"]
        return shown

    async def shows(self, *, direct: bool, paused: int = ROBOTS) -> dict[str, Any]:
        """Wait until the panel shows one stop."""

        def is_it(stops: list[dict[str, Any]]) -> bool:
            return [(each["direct"], each["paused"]) for each in stops] == [(direct, paused)]

        shown = await awaited(self.stops, is_it, seconds=PATIENCE, what=f"a stop, direct: {direct}")
        return shown[0]

    async def end_stop(self, name: str) -> None:
        """End a stop in the panel, and wait until all robots continue."""
        answer = await self.panel.post(f"/api/v1/control/stops/{name}/end", json=OVER)
        assert answer.status_code == 200, answer.text
        await until(lambda: self.paused() == 0, what="all robots continue")
        await awaited(self.stops, lambda shown: not shown, seconds=PATIENCE, what="no stop is shown")


async def trail(orders: httpx.AsyncClient) -> list[tuple[str, ...]]:
    """Return the audit trail, the oldest first."""
    entries = (await orders.get("/v1/audit")).json()["entries"]
    return [(each["operation"], each["user"], each["result"], each["client"]) for each in entries[::-1]]


@asynccontextmanager
async def running(fleet: Fleet) -> AsyncIterator[Site]:
    with fleet.stack:
        robots = fleet.peer(f"{fleet.interface}/#")
        fleet.agent()
        fleet.agent("robot-02", x=9.0)
        begun = time.monotonic()
        service = fleet.order_service(name="first")
        orders, port = await service.client(), free_port()
        busy = max(1.0, (time.monotonic() - begun) / USUAL_START_SECONDS)
        await vehicle_idle(orders)
        options = ("--interface_name", fleet.interface, "--topic_prefix", fleet.prefix)
        addresses = ("--http.port", str(port), "--mqtt.port", str(fleet.broker.port))
        reached = ("--order_service.url", str(orders.base_url), "--history.url", "none")
        with AggregatorProcess(*addresses, *options, *reached) as aggregator:
            url = await aggregator.url()
            async with httpx.AsyncClient(base_url=url, timeout=PATIENCE) as panel:
                await awaited(
                    lambda: panel.get("/api/v1/fleet"),
                    lambda answer: (
                        len(answer.json()["robots"]) == ROBOTS and answer.json()["orderService"]["up"]
                    ),
                    seconds=PATIENCE,
                    what="the aggregator sees all robots",
                )
                yield Site(fleet, service, orders, panel, robots, busy)


@pytest.fixture
async def site(broker: Broker, interface_name: str, tmp_path: Any) -> AsyncIterator[Site]:
    async with running(Fleet(broker, interface_name, tmp_path)) as made:
        yield made


async def test_hung_order_service_continues_the_stop_and_records_it_once(site: Site) -> None:
    site.service.process.send_signal(signal.SIGSTOP)
    try:
        answer, seconds = await site.stop_all()
    finally:
        await site.shows(direct=True)
        site.service.process.send_signal(signal.SIGCONT)
    assert seconds < PAUSED_WITHIN * site.busy
    assert (answer["by"], answer["reason"]) == ("Anna", "fire drill")

    await awaited(lambda: trail(site.orders), lambda rows: len(rows) > 1, what="the stop is taken over")
    stop = await site.shows(direct=False)
    (kept,) = (await site.orders.get("/v1/stops")).json()["stops"]
    assert stop["name"] == answer["name"], "the name that people know"
    assert (kept["name"], kept["by"], kept["paused"]) == (stop["name"], "Anna", ROBOTS)
    assert ("stop", "anonymous", "DONE", "nena-panel, without the order service") in await trail(site.orders)
    await site.end_stop(stop["name"])


async def test_stop_of_a_dead_order_service_is_ended_and_recorded_when_it_is_back(site: Site) -> None:
    site.service.process.kill()
    site.service.process.wait(PATIENCE)
    answer, seconds = await site.stop_all()
    assert seconds < PAUSED_WITHIN * site.busy
    assert (await site.shows(direct=True))["name"] == answer["name"]
    again = (await site.panel.post("/api/v1/control/stops", json=DRILL)).json()
    assert again["name"] == answer["name"], "a second click begins no second stop"
    await site.end_stop(answer["name"])

    orders = await site.fleet.order_service(name="second").client()
    recorded = await awaited(
        lambda: trail(orders), lambda rows: len(rows) == 2, seconds=PATIENCE, what="rows"
    )
    assert [row[:3] for row in recorded] == [("stop", "anonymous", "DONE"), ("endStop", "anonymous", "DONE")]
    assert (await orders.get("/v1/stops")).json()["stops"] == []
    assert site.paused() == 0


async def test_standby_that_takes_over_continues_the_stop(
    broker: Broker, interface_name: str, tmp_path: Any, postgres: Postgres
) -> None:
    fleet = Fleet(broker, interface_name, tmp_path, store_url=postgres.url)
    async with running(fleet) as site:
        standby = await fleet.order_service(name="second").client()
        site.service.process.send_signal(signal.SIGSTOP)  # it keeps its port: requests get no answer
        try:
            await awaited(
                lambda: role(standby), lambda told: told == "active", seconds=PATIENCE, what="a takeover"
            )
            answer, seconds = await site.stop_all()
            assert seconds < PAUSED_WITHIN * site.busy
            stop = await site.shows(direct=False)
            assert stop["name"] == answer["name"]
            assert [row[:3] for row in await trail(standby)] == [("stop", "anonymous", "DONE")]
            ended = await standby.post(f"/v1/stops/{stop['name']}/end", json=OVER)
            assert ended.status_code == 200
            await until(lambda: site.paused() == 0, what="all robots continue")
        finally:
            site.service.process.kill()
