"""The product on each broker; ``make brokers-test`` makes docs/brokers.md of the figures.

With ``NENA_BROKER`` (``host:port``, or ``user:password@host:port``) the tests use that broker instead, which
they cannot restart.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import httpx
import pytest

from brokers.figures import Figures
from nena_demo.plants import sample_plant_path
from nena_plant_formats.files import read
from nena_shared.mqtt.broker_check import LACKS, BrokerLack
from support.aggregator_process import AggregatorProcess
from support.broker import BrokerAddress
from support.brokers import BROKERS, RealBroker
from support.mqtt_line import Way, mqtt_line
from support.order_service_fleet import Fleet, RobotOptions, order_in, vehicle_idle
from support.pausing import time_passes
from support.programs import Program
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.broker, pytest.mark.long]

ADDRESS = os.environ.get("NENA_BROKER")
ROBOTS = {
    "Robot-01": RobotOptions(x=9.0, y=7.0, speed=3.0, version="2.1.0"),
    "Robot-02": RobotOptions(x=1.0, y=7.0, speed=3.0, version="2.0.0"),
    "Robot-03": RobotOptions(x=23.0, y=7.0, speed=3.0, version="3.0.0"),
}
TRIP = [
    {"locationName": "Goods in", "operation": "Load cargo"},
    {"locationName": "Storage", "operation": "Unload cargo"},
]
STOPPED_KEEP_ALIVE = "--mqtt.keep_alive=4"
CUT = 4.0
"""Seconds."""
LIMIT = 60.0
"""Timeout of each step, seconds."""


class Address(BrokerAddress):
    """The broker of ``NENA_BROKER``."""

    def __init__(self, text: str) -> None:
        parts = urlsplit(f"//{text}")
        super().__init__(parts.port or 1883)
        self.host = parts.hostname or self.host
        self.username = unquote(parts.username) if parts.username else None
        self.password = unquote(parts.password) if parts.password else None


@pytest.fixture(scope="module", params=[ADDRESS] if ADDRESS else BROKERS)
def named(request: pytest.FixtureRequest) -> Iterator[tuple[str, BrokerAddress]]:
    """Yield the name and the broker."""
    if ADDRESS:
        yield f"at {ADDRESS.rpartition('@')[2]}", Address(ADDRESS)
        return
    with BROKERS[request.param]() as server:
        Figures(request.param).record("version", server.version)
        yield request.param, server


@pytest.fixture
def broker(named: tuple[str, BrokerAddress]) -> BrokerAddress:
    return named[1]


@pytest.fixture
def figures(named: tuple[str, BrokerAddress]) -> Iterator[Figures]:
    made = Figures(named[0])
    yield made
    assert not made.failed


@pytest.fixture
def fleet(broker: BrokerAddress, interface_name: str, tmp_path: Path) -> Iterator[Fleet]:
    made = Fleet(broker, interface_name, tmp_path)
    with made.stack:
        yield made


def plant(fleet: Fleet, *serials: str) -> str:
    """Write the sample plant with these robots, and return the option."""
    found = json.loads(read(sample_plant_path().read_bytes()).model.to_json())
    like = found["vehicles"][0]
    found["vehicles"] = []
    for serial in serials:
        own = {**like["properties"], "vda5050:serialNumber": serial}
        if serial.capitalize() in ROBOTS:
            own["vda5050:version"] = ROBOTS[serial.capitalize()]["version"]
        found["vehicles"].append({**like, "name": serial.capitalize(), "properties": own})
    file = fleet.folder / "plant.json"
    file.write_text(json.dumps(found))
    return f"--plant={file}"


def start_robot(fleet: Fleet, name: str, *options: str) -> Program:
    serial = name.lower()
    return fleet.agent_of(fleet.agent_file(serial, **ROBOTS[name]), serial, *options)


@contextmanager
def aggregator(fleet: Fleet) -> Iterator[AggregatorProcess]:
    options = [f"--interface_name={fleet.interface}", f"--interface_name_v3={fleet.interface}"]
    options += [f"--topic_prefix={fleet.prefix}", "--http.port=0", *fleet.broker.options]
    with AggregatorProcess(*options) as process:
        yield process


async def panel_of(process: AggregatorProcess) -> httpx.AsyncClient:
    return httpx.AsyncClient(base_url=await process.url(), timeout=PATIENCE)


async def in_aggregator(panel: httpx.AsyncClient) -> Any:
    return (await panel.get("/api/v1/fleet")).json()


async def in_order_service(client: httpx.AsyncClient) -> dict[str, str]:
    found = (await client.get("/v1/vehicles")).json()["vehicles"]
    return {each["name"]: each["connection"] for each in found}


def connections(view: Any) -> dict[str, str]:
    return {robot["name"]: robot["connection"] for robot in view["robots"]}


async def shown(client: httpx.AsyncClient, panel: httpx.AsyncClient, expected: dict[str, str]) -> None:
    """Wait until both show these connections."""
    await awaited(lambda: in_order_service(client), expected.__eq__, seconds=LIMIT, what=f"{expected}")
    await awaited(
        lambda: in_aggregator(panel),
        lambda view: connections(view) == expected,
        seconds=LIMIT,
        what=f"{expected} in the aggregator",
    )


async def all_online(
    figures: Figures, step: str, client: httpx.AsyncClient, panel: httpx.AsyncClient
) -> None:
    """Record the time until each shows all robots as ONLINE."""
    expected = dict.fromkeys(ROBOTS, "ONLINE")

    async def until_shown(name: str, look: Callable[[], Any], read_it: Callable[[Any], Any]) -> None:
        with figures.timed(name):
            await awaited(look, lambda view: read_it(view) == expected, seconds=LIMIT, what=name)

    await asyncio.gather(
        until_shown(step, lambda: in_order_service(client), lambda view: view),
        until_shown(f"{step}, aggregator", lambda: in_aggregator(panel), connections),
    )


async def create(client: httpx.AsyncClient, name: str, **more: Any) -> None:
    answer = await client.post("/v1/transportOrders", json={"name": name, "destinations": TRIP, **more})
    assert answer.status_code == 201, answer.text


async def finished(client: httpx.AsyncClient, name: str) -> None:
    order = await order_in(client, name, "FINISHED", "FAILED", seconds=LIMIT)
    assert order["state"] == "FINISHED", order["reason"]


async def test_robots_and_order_service_start_in_either_order(fleet: Fleet, figures: Figures) -> None:
    option = plant(fleet, *map(str.lower, ROBOTS))
    service = fleet.order_service(option)
    with aggregator(fleet) as process:
        async with await service.client() as client, await panel_of(process) as panel:
            for name in ROBOTS:
                start_robot(fleet, name, "--loopback.speed=8")
            await all_online(figures, "service first", client, panel)
            with figures.timed("five orders"):
                for number in range(5):
                    await create(client, f"T{number}")
                for number in range(5):
                    await finished(client, f"T{number}")
    service.process.terminate()
    await asyncio.to_thread(service.process.wait, LIMIT)

    fleet.store_url = f"sqlite:///{fleet.folder}/empty.db"
    service = fleet.order_service(option)
    with aggregator(fleet) as process:
        async with await service.client() as client, await panel_of(process) as panel:
            await all_online(figures, "robots first", client, panel)


async def test_robot_that_is_lost_is_told(fleet: Fleet, figures: Figures) -> None:
    service = fleet.order_service(plant(fleet, "robot-01"))
    online, broken = {"Robot-01": "ONLINE"}, {"Robot-01": "CONNECTION_BROKEN"}
    robot = start_robot(fleet, "Robot-01", STOPPED_KEEP_ALIVE)
    with aggregator(fleet) as process:
        async with await service.client() as client, await panel_of(process) as panel:
            await shown(client, panel, online)
            robot.process.send_signal(signal.SIGSTOP)
            with figures.timed("stopped"):
                await shown(client, panel, broken)
            robot.process.send_signal(signal.SIGCONT)
            await shown(client, panel, online)
            robot.kill()
            with figures.timed("killed"):
                await shown(client, panel, broken)


async def test_orders_survive_restarts_and_cut_links(fleet: Fleet, figures: Figures) -> None:
    """One order in each step, of the same way; robot 2 is gone."""
    option = plant(fleet, "robot-01", "robot-02")
    service = fleet.order_service(option)
    client = await service.client()
    line = fleet.stack.enter_context(mqtt_line(fleet.broker))
    start_robot(fleet, "Robot-01", *line.options)
    gone = start_robot(fleet, "Robot-02")
    process = fleet.stack.enter_context(aggregator(fleet))
    panel = await panel_of(process)
    await shown(client, panel, dict.fromkeys(("Robot-01", "Robot-02"), "ONLINE"))
    gone.process.terminate()
    expected = {"Robot-01": "ONLINE", "Robot-02": "OFFLINE"}
    await shown(client, panel, expected)
    await create(client, "waits", intendedVehicle="Robot-02")

    @asynccontextmanager
    async def order(name: str) -> AsyncIterator[None]:
        """Create an order, run the block once it has picked up its load, and wait for its end."""
        order_name = name.replace(" ", "-")
        await create(client, order_name, intendedVehicle="Robot-01")

        async def states() -> list[str]:
            found = (await client.get(f"/v1/transportOrders/{order_name}")).json()
            return [each["state"] for each in found["driveOrders"]]

        await awaited(states, lambda found: "FINISHED" in found, seconds=LIMIT, what=f"the pick of {name}")
        with figures.timed(name):
            yield
            await finished(client, order_name)

    async with order("undisturbed"):
        pass

    async with order("cut"):
        line.conduct.held = set(Way)
        await time_passes(CUT)
        line.conduct.held = set()

    async with order("aggregator"):
        await panel.aclose()
        await asyncio.to_thread(process.end)
        process = fleet.stack.enter_context(aggregator(fleet))
        panel = await panel_of(process)
        with figures.timed("aggregator shows"):
            await awaited(
                lambda: in_aggregator(panel),
                lambda view: connections(view) == expected and len(view["orders"]) > 0,
                seconds=LIMIT,
                what="the whole fleet",
            )

    async with order("order service"):
        await client.aclose()
        service.process.terminate()
        await asyncio.to_thread(service.process.wait, LIMIT)
        with figures.timed("order service again"):
            service = fleet.order_service(option)
            client = await service.client()

    if isinstance(fleet.broker, RealBroker):
        async with order("broker restart"):
            with figures.timed("broker again"):
                await asyncio.to_thread(fleet.broker.restart)
    await client.aclose()
    await panel.aclose()


async def test_names_with_dots_work_or_are_told(fleet: Fleet, figures: Figures) -> None:
    service = fleet.order_service(plant(fleet, "robot-01", "robot.2"))
    async with await service.client() as client:
        start_robot(fleet, "Robot-01")
        fleet.agent("robot.2", **ROBOTS["Robot-02"])

        async def told() -> str:
            if (await in_order_service(client))["Robot.2"] == "ONLINE":
                return "works"
            problems = (await client.get("/readyz")).json()["problems"]
            return "does not work; `/readyz` says so" if LACKS[BrokerLack.NAMES] in problems else ""

        await vehicle_idle(client)
        await create(client, "WMS-2.1", intendedVehicle="Robot-01")
        with figures.timed("names of orders"):
            await finished(client, "WMS-2.1")
        figures.record("names of robots", await awaited(told, bool, seconds=LIMIT, what="robot.2 or why not"))
