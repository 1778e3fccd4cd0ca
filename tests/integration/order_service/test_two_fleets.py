"""Two fleets on one broker and one PostgreSQL: with the same names, and without interference."""

from __future__ import annotations

import asyncio
import json
import os
import sys
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import NullPool, create_engine, text

from support.aggregator_process import AggregatorProcess
from support.broker import Broker, MqttPeer
from support.order_service_fleet import Fleet, listening, order_in, vehicle_idle
from support.postgres import Postgres
from support.programs import OrderServiceProgram
from support.published import problems_in
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

FOREIGN = "another program commands robots of this fleet"
SAME_NAME = "T"
GOALS = {"a": "South 2", "b": "Middle 1"}
"""Where each fleet's order of the same name leads."""
MINUTES = float(os.environ.get("NENA_TWO_FLEETS_MINUTES", "1"))
"""How long two fleets work side by side in the long test."""
PLACES = ("South 1", "South 2", "Middle 1")


@dataclass
class Half:
    """One fleet with its robot, order service, aggregator and recorded messages."""

    fleet: Fleet
    wire: MqttPeer
    order_service: OrderServiceProgram
    host: httpx.AsyncClient
    panel: httpx.AsyncClient

    async def create(self, name: str, goal: str) -> None:
        body = {"name": name, "destinations": [{"locationName": goal}]}
        (await self.host.post("/v1/transportOrders", json=body)).raise_for_status()

    def order_ids(self) -> set[str]:
        """Return the orders that its robots were sent, and the ones that they reported."""
        self.wire.catch_up()
        found = set()
        for kind in ("order", "state"):
            for payload in self.wire.payloads(f"{self.fleet.interface}/v2/+/+/{kind}"):
                found.add(json.loads(payload)["orderId"].split("-")[0])
        return found - {""}

    async def shown(self) -> dict[str, Any]:
        answer: dict[str, Any] = (await self.panel.get("/api/v1/fleet")).json()
        return answer


@pytest.fixture
def databases(own_postgres: Postgres) -> dict[str, str]:
    """Return the URLs of four databases on one server: a store and a history for each fleet."""
    names = ("a", "b", "history_a", "history_b")
    engine = create_engine(own_postgres.url, poolclass=NullPool, isolation_level="AUTOCOMMIT")
    with engine.connect() as server:
        for name in names:
            server.execute(text(f"CREATE DATABASE {name}"))
    return {name: own_postgres.url_of("nena", name) for name in names}


@pytest.fixture
async def halves(
    broker: Broker, interface_name: str, databases: dict[str, str], tmp_path: Path
) -> AsyncIterator[dict[str, Half]]:
    async with AsyncExitStack() as clients:
        with ExitStack() as programs:
            made = {}
            for name in "ab":
                folder = tmp_path / name
                folder.mkdir()
                fleet = Fleet(broker, f"{interface_name}-{name}", folder, databases[name], programs)
                made[name] = await _half(fleet, databases[f"history_{name}"], clients)
            yield made
        for half in made.values():
            assert problems_in(half.wire.history) == []


async def _half(fleet: Fleet, history: str, clients: AsyncExitStack) -> Half:
    fleet.agent()
    order_service = fleet.order_service()
    aggregator = fleet.stack.enter_context(
        AggregatorProcess(
            *("--interface_name", fleet.interface, "--interface_name_v3", fleet.interface),
            *("--topic_prefix", fleet.prefix, "--mqtt.port", str(fleet.broker.port)),
            *("--history.url", history, "--http.port", "0"),
        )
    )
    host = await clients.enter_async_context(await order_service.client())
    panel = httpx.AsyncClient(base_url=await aggregator.url(), timeout=PATIENCE)
    return Half(fleet, fleet.peer(), order_service, host, await clients.enter_async_context(panel))


async def test_two_fleets_with_the_same_names_do_not_interfere(halves: dict[str, Half]) -> None:
    for half in halves.values():
        await listening(half.host)
        await vehicle_idle(half.host)
    for name, half in halves.items():
        await half.create(SAME_NAME, GOALS[name])
        await half.create(f"only{name}", "South 1")
    for name, half in halves.items():
        same = await order_in(half.host, SAME_NAME, "FINISHED")
        await order_in(half.host, f"only{name}", "FINISHED")
        assert [each["destination"]["locationName"] for each in same["driveOrders"]] == [GOALS[name]]
        assert half.order_ids() == {SAME_NAME, f"only{name}"}
        listed = (await half.host.get("/v1/transportOrders")).json()["transportOrders"]
        assert {each["name"] for each in listed} == {SAME_NAME, f"only{name}"}
        assert FOREIGN not in half.order_service.log
        await panel_shows(half, {SAME_NAME, f"only{name}"})


@pytest.mark.long
@pytest.mark.timeout(MINUTES * 60 + 300)
async def test_two_fleets_work_side_by_side(halves: dict[str, Half]) -> None:
    end = time.monotonic() + MINUTES * 60
    done = await asyncio.gather(*(work_until(end, half, f"{name}T") for name, half in halves.items()))
    sys.stdout.write(f"orders finished: {done}\n")
    for (name, half), count in zip(halves.items(), done, strict=True):
        assert count > 10 * MINUTES
        names = {f"{name}T{number}" for number in range(count)}
        assert half.order_ids() == names
        assert FOREIGN not in half.order_service.log
        assert "Traceback" not in half.order_service.log
        shown = {each["id"] for each in (await half.shown())["orders"]}
        assert shown <= names
        assert f"{name}T{count - 1}" in shown


async def work_until(end: float, half: Half, prefix: str) -> int:
    """Create one order after another, all of names of this prefix; return how many have finished."""
    await listening(half.host)
    await vehicle_idle(half.host)
    count = 0
    while time.monotonic() < end:
        await half.create(f"{prefix}{count}", PLACES[count % len(PLACES)])
        await order_in(half.host, f"{prefix}{count}", "FINISHED")
        count += 1
    return count


async def test_one_fleet_works_on_while_the_order_service_of_the_other_is_down(
    halves: dict[str, Half],
) -> None:
    down, up = halves["a"], halves["b"]
    for half in halves.values():
        await listening(half.host)
        await vehicle_idle(half.host)
    down.order_service.process.kill()
    await asyncio.to_thread(down.order_service.process.wait)
    await up.create("alone", "South 2")
    await order_in(up.host, "alone", "FINISHED")

    again = await down.fleet.order_service(name="again").client()
    await listening(again)
    await vehicle_idle(again)
    assert (await again.get("/v1/transportOrders")).json()["transportOrders"] == []
    body = {"name": "later", "destinations": [{"locationName": "South 2"}]}
    (await again.post("/v1/transportOrders", json=body)).raise_for_status()
    await order_in(again, "later", "FINISHED")
    await again.aclose()
    assert down.order_ids() == {"later"}
    assert up.order_ids() == {"alone"}


async def panel_shows(half: Half, orders: set[str]) -> None:
    """Wait until an aggregator shows these orders, and check that it shows no others."""
    shown = await awaited(
        half.shown,
        lambda fleet: {each["id"] for each in fleet["orders"]} >= orders,
        seconds=PATIENCE,
        what=f"the orders {orders}",
    )
    assert {each["id"] for each in shown["orders"]} == orders
    reporting = [each["id"] for each in shown["robots"] if each["lastState"]]
    assert reporting == ["NeNa/robot-01"]
