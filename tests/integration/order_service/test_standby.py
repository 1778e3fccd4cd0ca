"""Two order services on one PostgreSQL: one is active, the other one stands by and takes over."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Mapping

import httpx
import pytest

from support.order_service_fleet import Fleet, actions_done, every_order_ended, order_in, role, vehicle_idle
from support.postgres import Postgres
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

LOAD = {"locationName": "Goods in", "operation": "Load cargo"}
UNLOAD = {"locationName": "Storage", "operation": "Unload cargo"}
AWAY = {"locationName": "South 2"}
TAKEOVER_SECONDS = 5.0
"""What is promised; on a machine that is so busy that a start takes longer than usual, as much longer."""
USUAL_START_SECONDS = 2.5
ROOM = 2.0
"""For a machine that has less time left for the takeover than it had for the start."""


async def ready(client: httpx.AsyncClient) -> bool:
    answer = await client.get("/readyz")
    assert (answer.status_code == 200) == answer.json()["ready"] == answer.json()["storeReady"]
    return bool(answer.json()["ready"])


async def active(client: httpx.AsyncClient) -> httpx.AsyncClient:
    await awaited(lambda: role(client), lambda told: told == "active", seconds=PATIENCE, what="it is active")
    return client


async def taken(client: httpx.AsyncClient, body: Mapping[str, object]) -> float:
    """Repeat the request until the order is accepted; return the seconds that it took."""
    start = time.monotonic()

    async def ask() -> int:
        return (await client.post("/v1/transportOrders", json=body)).status_code

    await awaited(ask, lambda status: status in (200, 201), seconds=PATIENCE, what="the order is taken")
    return time.monotonic() - start


async def heard(client: httpx.AsyncClient, event: str, *, last_id: int | None = None) -> int:
    """Follow the events to the first one of a kind; return its ID."""
    headers = {} if last_id is None else {"Last-Event-ID": str(last_id)}
    fields: dict[str, str] = {}
    async with asyncio.timeout(PATIENCE), client.stream("GET", "/v1/events", headers=headers) as answer:
        async for line in answer.aiter_lines():
            if line:
                name, _, value = line.partition(": ")
                fields[name] = value
            elif fields.get("event") == event:
                return int(fields["id"])
            else:
                fields.clear()
    raise AssertionError(event)


async def test_a_standby_is_healthy_and_redirects_hosts_to_the_active_one(shared: Fleet) -> None:
    first = await active(await shared.order_service(name="first").client())
    second = await shared.order_service(name="second").client()
    assert (await second.get("/healthz")).status_code == 200

    async def readiness() -> str:
        return (await second.get("/readyz")).text

    await awaited(
        readiness, lambda text: str(first.base_url) in text, seconds=PATIENCE, what="it knows the active one"
    )
    ready = await second.get("/readyz")
    assert (ready.status_code, ready.json()["role"], ready.json()["storeReady"]) == (503, "standby", True)
    for answer in (
        await second.post("/v1/transportOrders", json={"destinations": [LOAD]}),
        await second.get("/v1/vehicles"),
    ):
        assert answer.status_code == 503
        assert answer.headers["content-type"] == "application/problem+json"
        assert f"{first.base_url}{answer.request.url.path}" in answer.json()["detail"]
    assert (await first.get("/v1/vehicles")).status_code == 200


async def test_a_standby_takes_over_when_the_active_one_is_killed(shared: Fleet) -> None:
    start = time.monotonic()
    first = shared.order_service(name="first")
    client = await active(await first.client())
    busy = max(1.0, (time.monotonic() - start) / USUAL_START_SECONDS)
    standby = await shared.order_service(name="second").client()
    shared.agent(speed=20.0)
    await vehicle_idle(client)
    assert (await client.post("/v1/orderSequences", json={"name": "S"})).status_code == 201
    for number, stops in enumerate(([LOAD, UNLOAD], [AWAY])):
        body = {"name": f"T-{number}", "destinations": stops, "wrappingSequence": "S"}
        assert (await client.post("/v1/transportOrders", json=body)).status_code == 201
    await order_in(client, "T-0", "BEING_PROCESSED")
    assert await role(standby) == "standby"

    last_id = await heard(client, "synced")

    first.kill()
    last = {"name": "T-2", "destinations": [AWAY], "wrappingSequence": "S", "dependencies": ["T-1"]}
    assert await taken(standby, last) < ROOM * TAKEOVER_SECONDS * busy
    assert await heard(standby, "synced", last_id=last_id) > last_id

    orders = await every_order_ended(standby)
    assert {order["name"]: order["state"] for order in orders} == {f"T-{n}": "FINISHED" for n in range(3)}
    sequence = (await standby.get("/v1/orderSequences/S")).json()
    assert (sequence["finishedIndex"], sequence["processingVehicle"]) == (2, "Robot-01")
    codes = [entry["eventCode"] for entry in next(o for o in orders if o["name"] == "T-0")["history"]]
    assert codes.count("nena:adoptedAfterRestart") == 1
    assert await role(standby) == "active"


async def test_a_hanging_active_service_is_replaced_and_writes_nothing_afterwards(shared: Fleet) -> None:
    start = time.monotonic()
    first = shared.order_service(name="first")
    await active(await first.client())
    busy = max(1.0, (time.monotonic() - start) / USUAL_START_SECONDS)
    standby = await shared.order_service(name="second").client()
    first.process.send_signal(signal.SIGSTOP)
    try:
        seconds = await taken(standby, {"name": "T-1", "destinations": [LOAD]})
    finally:
        first.process.send_signal(signal.SIGCONT)
    assert seconds < 2 * ROOM * TAKEOVER_SECONDS * busy
    await until(lambda: first.process.poll() is not None, what="the old one has ended")
    assert first.process.returncode == 1
    assert "another order service is now active on this store" in first.log
    assert (await standby.get("/v1/transportOrders/T-1")).json()["state"] == "DISPATCHABLE"


async def test_nothing_acknowledged_is_lost_during_a_database_outage(
    shared: Fleet, postgres: Postgres
) -> None:
    program = shared.order_service("--engine.commit_timeout", 3, name="first")
    client = await active(await program.client())
    shared.agent(speed=40.0)
    await vehicle_idle(client)
    assert (
        await client.post("/v1/transportOrders", json={"name": "before", "destinations": [LOAD]})
    ).status_code == 201
    await order_in(client, "before", "FINISHED")

    postgres.stop()
    try:
        asked = {"name": "meanwhile", "idempotencyKey": "k", "destinations": [AWAY]}
        refused = await client.post("/v1/transportOrders", json=asked)
        assert refused.status_code == 503
        assert refused.headers["content-type"] == "application/problem+json"
        assert (await client.get("/v1/transportOrders/elsewhere")).status_code == 503
        assert (await client.get("/v1/transportOrders/before")).json()["state"] == "FINISHED"
        await awaited(lambda: ready(client), lambda told: not told, seconds=PATIENCE, what="it is not ready")
        assert (await client.get("/healthz")).status_code == 200
    finally:
        postgres.start()

    await taken(client, asked)
    assert (await order_in(client, "meanwhile", "FINISHED", "FAILED"))["state"] == "FINISHED"
    names = [order["name"] for order in await every_order_ended(client)]
    assert names == ["meanwhile", "before"]
    assert (await client.get("/readyz")).json()["role"] == "active"
    assert program.process.poll() is None


async def test_the_active_service_keeps_the_lead_over_a_database_restart(
    shared: Fleet, postgres: Postgres
) -> None:
    first = shared.order_service(name="first")
    client = await active(await first.client())
    standby = await shared.order_service(name="second").client()
    postgres.stop()
    postgres.start()
    await taken(client, {"name": "T-1", "destinations": [LOAD]})
    await asyncio.gather(*(taken(client, {"name": f"T-{n}", "destinations": [LOAD]}) for n in range(2, 12)))
    assert await role(standby) == "standby"
    assert len((await client.get("/v1/transportOrders")).json()["transportOrders"]) == 11


@pytest.mark.long
async def test_orders_are_executed_once_while_the_database_keeps_crashing(
    shared: Fleet, postgres: Postgres
) -> None:
    wire = shared.peer()
    client = await active(await shared.order_service().client())
    shared.agent(speed=20.0)
    await vehicle_idle(client)
    names = [f"T-{number}" for number in range(4)]
    for name in names:
        await taken(client, {"name": name, "idempotencyKey": name, "destinations": [LOAD, UNLOAD]})
        postgres.stop()
        postgres.start()
    orders = await every_order_ended(client)
    assert {order["name"]: order["state"] for order in orders} == dict.fromkeys(names, "FINISHED")
    assert actions_done(wire, shared) == {f"{name}-{leg}": 1 for name in names for leg in range(2)}
