"""The first plant of the order service's benchmarks: each robot has its own two-way lane of two points."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from bench.process import cpu_of, rss_mb_of
from bench.readiness import READY_SECONDS, wait_until_ready
from bench.robots import Start
from nena_demo.processes import Processes, console_script, free_port, start_broker
from nena_shared.plant import PlantModel, Point, Vehicle
from nena_shared.plant.track import BoundingBox
from support.plants import path
from support.waiting import wait_until

MAP_ID = "bench-lanes"
LENGTH_M = 5
APART_M = 2
ROBOT_MM = 800
LOOK_EVERY = 0.5
"""Seconds; many robots are a long answer."""
SHARE = 2500
"""Robots of one edge agent, where there are loopback robots."""


def robot(number: int) -> str:
    """Name a robot as a loopback fleet numbers it: its serial number, and its vehicle."""
    return f"lane{number // SHARE}-{number % SHARE + 1}"


def end_of(number: int, end: int) -> str:
    """Name an end, 0 or 1, of a robot's lane."""
    return f"{robot(number)}-{end}"


def start_of(number: int) -> Start:
    """Return the start position of a robot."""
    return Start(robot(number), end_of(number, 0), 0.0, float(number * APART_M), MAP_ID)


def write_lanes(folder: Path, robots: int) -> Path:
    """Write the plant model for so many robots."""
    return write_plant(folder, _lanes(robots))


def write_plant(folder: Path, plant: PlantModel) -> Path:
    """Write a plant model into a folder, which is created."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "plant.json"
    file.write_text(plant.to_json(), encoding="utf-8")
    return file


def _lanes(robots: int) -> PlantModel:
    ends = [(number, end) for number in range(robots) for end in (0, 1)]
    return PlantModel(
        name=f"{robots} lanes",
        points=tuple(
            Point(name=end_of(*each), x_mm=each[1] * LENGTH_M * 1000, y_mm=each[0] * APART_M * 1000)
            for each in ends
        ),
        paths=tuple(
            path(f"{end_of(number, end)} {end_of(number, 1 - end)}", LENGTH_M * 1000) for number, end in ends
        ),
        vehicles=tuple(map(vehicle, range(robots))),
    )


def vehicle(number: int) -> Vehicle:
    """Make the vehicle of a robot in the plant model."""
    return Vehicle(
        name=robot(number),
        bounding_box=BoundingBox(length_mm=ROBOT_MM, width_mm=ROBOT_MM),
        properties={
            "vda5050:manufacturer": "NeNa",
            "vda5050:serialNumber": robot(number),
            "vda5050:version": "2.1.0",
            "vda5050:mapId": MAP_ID,
        },
    )


def order_of(number: int, robots: int) -> dict[str, Any]:
    """Make the order of this number: each robot in turn to the other end of its lane, and back."""
    lane, turn = number % robots, number // robots
    return {
        "destinations": [{"locationName": end_of(lane, 1 - turn % 2)}],
        "intendedVehicle": robot(lane),
    }


WELL = {"IDLE", "EXECUTING"}
"""States of robots that are there, without an order and with one."""


@dataclass(frozen=True, slots=True)
class Hall:
    """A broker and an order service over a plant."""

    port: int
    """Of the broker."""
    url: str
    pid: int
    robots: int
    processes: Processes
    """All programs of the hall, the broker first."""

    def wait_for_robots(self) -> None:
        """Wait until every robot can accept an order, or has one that was stored."""

        def all_there() -> bool:
            vehicles = httpx.get(f"{self.url}/v1/vehicles", timeout=READY_SECONDS).json()["vehicles"]
            there = sum(each["state"] in WELL and each["currentPosition"] is not None for each in vehicles)
            return bool(there == self.robots)

        wait_until(all_there, timeout=READY_SECONDS, what="every robot is there", every=LOOK_EVERY)

    def cpu(self) -> float:
        """Return the CPU time of the order service, seconds."""
        return cpu_of(self.pid)

    def rss_mb(self) -> float:
        """Return its resident memory, MB."""
        return rss_mb_of(self.pid)


@asynccontextmanager
async def lanes(folder: Path, robots: int, store_url: str = "") -> AsyncIterator[Hall]:
    """Start a broker and an order service for so many robots, each on its lane."""
    async with serving(folder, _lanes(robots), robots, store_url) as hall:
        yield hall


@asynccontextmanager
async def serving(folder: Path, plant: PlantModel, robots: int, store_url: str = "") -> AsyncIterator[Hall]:
    """Start a broker and an order service for a plant with so many robots; by default its store is a file."""
    url_of_store = store_url or f"sqlite:///{folder / 'orders.db'}"
    async with Processes(folder) as processes:
        port, http_port = free_port(), free_port()
        await start_broker(processes, port, "mosquitto")
        child = await processes.start(
            "order-service",
            [
                console_script("nena-order-service"),
                *("--plant", str(write_plant(folder, plant)), "--store.url", url_of_store),
                *("--http.port", str(http_port), "--http.burst", "1000000", "--mqtt.port", str(port)),
            ],
        )
        url = f"http://127.0.0.1:{http_port}"
        await asyncio.to_thread(wait_until_ready, url)
        yield Hall(port, url, child.process.pid, robots, processes)
        processes.check()
