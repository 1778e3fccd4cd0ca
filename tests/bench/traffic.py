"""Orders per minute of a backlog that never empties, by the real programs with loopback robots.

Beside it PIBT in lock-step with the same robots, places and orders, and robots that never meet. Long cases,
and those with faults, are simulated by the same programs under accelerated time; cases that are both measured
and simulated show how far these agree.
"""

from __future__ import annotations

import asyncio
import json
import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from random import Random
from typing import Any

import httpx

from bench.figures import at_least
from bench.lanes import WELL
from bench.pibt import WORK_SECONDS, bound, orders_per_minute
from bench.readiness import READY_SECONDS, wait_until_ready
from bench.traffic_halls import (
    COLUMNS,
    DROP,
    HALLS,
    MANUFACTURER,
    MAP_ID,
    PICK,
    ROWS,
    SPEED_MM_S,
    TWO_WAY_EACH,
    Hall,
    demo_is_there,
    grid_point,
    orders_by_lot,
)
from bench.wire import Wire
from nena_demo.processes import Processes, console_script, free_port, start_broker
from nena_shared.fleet_api.transport_order import Destination, TransportOrderRequest
from nena_simulate.demand import Demand, Relation, every_relation
from nena_simulate.report import Figures
from nena_simulate.simulation import simulate_all
from nena_simulate.site import Case, Disturbances
from support.pausing import time_passes
from support.waiting import awaited

SIZES: Mapping[str, tuple[int, ...]] = {
    "aisles": (5, 10, 20, 30, 50, 80),
    "spurs": (5, 10, 20, 30, 50, 80),
    "two_halls": (5, 10, 20),
    "demo_01": (4, 8),
    "road_map": (10, 30, 50),
}
TARGETS = {5: 0.8, 20: 0.75, 50: 0.6}
"""Of PIBT's orders per minute, in the hall with stations on its aisles."""
DISTURBED = 30
"""Robots where something goes wrong."""
LOOK_SECONDS = 0.1
DEAD_FROM, DEAD_FOR, HALF_A_MINUTE = 120.0, 60.0, 30.0
SPREAD, LOSS = 0.3, 0.01


def _chosen(name: str, default: str) -> str:
    return os.environ.get(f"NENA_TRAFFIC_{name}", default)


@dataclass(frozen=True)
class Extent:
    """What is measured, and for how long."""

    minutes: float = float(_chosen("MINUTES", "5"))
    warm_up: float = float(_chosen("WARM_UP", "1"))
    halls: tuple[str, ...] = tuple(_chosen("HALLS", ",".join(SIZES)).split(","))
    sizes: tuple[int, ...] = tuple(int(each) for each in _chosen("ROBOTS", "").split(",") if each)
    """Of each hall; none: those that belong to it."""
    processes: bool = _chosen("PROCESSES", "1") == "1"
    simulated: bool = _chosen("SIMULATED", "1") == "1"
    disturbed: bool = _chosen("DISTURBED", "1") == "1"

    def cases(self) -> Iterable[tuple[str, int]]:
        """Yield halls and numbers of robots; Demo-01 only where it is at hand."""
        for name in self.halls:
            if name != "demo_01" or demo_is_there():
                yield from ((name, robots) for robots in self.sizes or SIZES[name])


async def measure(folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    """Return orders per minute of each hall and number of robots beside the yardsticks."""
    extent, found = Extent(), dict[str, Any]()
    for name, robots in extent.cases():
        hall = HALLS[name]()
        figures: dict[str, Any] = {**yardsticks(hall, robots)}
        found.setdefault(name, {})[str(robots)] = figures
        if extent.simulated:
            (simulated,) = simulate_all([case_of(hall, robots, extent)], jobs=1)
            figures["simulated"] = _rate(simulated)
            figures["simulated_waits"] = round(simulated.doing["waits"], 3)
        if extent.processes:
            measured = await _measured(folder / f"{name}-{robots}", hall, robots, extent)
            figures |= measured
        best = figures.get("orders_per_minute", figures.get("simulated", 0.0))
        figures["of_pibt"] = round(best / figures["pibt"], 3)
        if name == "aisles" and robots in TARGETS:
            figures["target"] = at_least(figures["of_pibt"], TARGETS[robots])
        print(name, robots, figures, flush=True)  # noqa: T201 - it takes an hour, and somebody looks on
    if not demo_is_there() and "demo_01" in extent.halls:
        found["demo_01"] = "skipped: openTCS's plant models are not at hand (NENA_REFERENCE)"
    if extent.disturbed:
        found["disturbed"] = disturbed(extent)
    return {"minutes": extent.minutes, "warm_up": extent.warm_up, **found}


def yardsticks(hall: Hall, robots: int) -> dict[str, float]:
    """Return orders per minute of PIBT and of robots that never meet, without and with time to turn."""
    return {
        "pibt": round(orders_per_minute(hall, robots), 1),
        "pibt_turning": round(orders_per_minute(hall, robots, turns=True), 1),
        "never_meet": round(bound(hall, robots), 1),
        "never_meet_turning": round(bound(hall, robots, turns=True), 1),
    }


def backlog_of(robots: int) -> int:
    """Return how many orders wait all the time."""
    return max(5, robots // 2)


def case_of(hall: Hall, robots: int, extent: Extent) -> Case:
    """Return the case for a simulation."""
    return Case(
        plant=hall.with_robots(robots),
        demand=Demand(relations=_relations(hall), backlog=backlog_of(robots)),
        robots=robots,
        hours=extent.minutes / 60,
        warm_up=extent.warm_up * 60,
        speed=SPEED_MM_S / 1000,
        work_seconds=WORK_SECONDS,
        starts=tuple(each.name for each in hall.starts(robots)),
    )


def _relations(hall: Hall) -> tuple[Relation, ...]:
    stations = set(hall.stations)
    return tuple(each for each in every_relation(hall.plant) if {each.source, each.destination} <= stations)


def _rate(figures: Figures) -> float:
    return round(figures.orders_per_hour / 60, 2)


def disturbed(extent: Extent) -> dict[str, Any]:
    """Simulate a robot that is dead for a minute in a main aisle; robots of all speeds; messages lost."""
    hall = HALLS["aisles"]()
    calm = case_of(hall, DISTURBED, replace(extent, minutes=max(extent.minutes, 5.0)))
    begin = calm.warm_up + DEAD_FROM
    columns = [each for each in range(COLUMNS) if each % TWO_WAY_EACH == 0 or each == COLUMNS - 1]
    aisle = tuple(grid_point(column, row) for column in columns for row in range(1, ROWS - 1))
    dead = Disturbances(dead=(begin, DEAD_FOR), dead_at=aisle)
    # Orders are counted by minutes: of a robot that dies half a minute later, the rate 30 s after its return.
    later = Disturbances(dead=(begin + HALF_A_MINUTE, DEAD_FOR), dead_at=aisle)
    rough = Disturbances(loss=LOSS, speed_spread=SPREAD)
    undisturbed, with_dead, with_later, with_rough = simulate_all(
        [calm, *(replace(calm, disturbances=each) for each in (dead, later, rough))], jobs=2
    )
    usual = _rate(undisturbed)
    first = int(DEAD_FROM // 60)
    by_minute, after = with_dead.finished_by_minute, with_later.finished_by_minute[first + 2 :]
    return {
        "robots": DISTURBED,
        "undisturbed": usual,
        "one_dead": by_minute,
        "one_dead_in_its_minute": at_least(round(by_minute[first] / usual, 2), 0.7),
        "one_dead_half_a_minute_later": with_later.finished_by_minute,
        "one_dead_from_30_s_after": round(sum(after) / len(after) / usual, 2),
        "speeds_and_losses": at_least(round(_rate(with_rough) / usual, 2), 0.85),
        "failed": with_dead.failed + with_later.failed + with_rough.failed,
    }


async def _measured(folder: Path, hall: Hall, robots: int, extent: Extent) -> dict[str, Any]:
    """Run the processes of a case, and count the orders that end."""
    async with Processes(folder) as processes:
        port, http_port = free_port(), free_port()
        plant, agent = folder / "plant.json", folder / "agent.toml"
        plant.write_text(hall.with_robots(robots).to_json(), encoding="utf-8")
        agent.write_text(_agent_settings(hall, robots, port), encoding="utf-8")
        await start_broker(processes, port, "mosquitto")
        order_service = [
            console_script("nena-order-service"),
            *("--plant", str(plant), "--store.url", f"sqlite:///{folder / 'orders.db'}"),
            *("--http.port", str(http_port), "--http.burst", "1000000", "--mqtt.port", str(port)),
            *("--log.level", "warning"),
        ]
        await processes.start("order-service", order_service)
        url = f"http://127.0.0.1:{http_port}"
        await asyncio.to_thread(wait_until_ready, url)
        await processes.start("edge-agent", [console_script("nena-edge-agent"), "--config", str(agent)])
        async with httpx.AsyncClient(base_url=url, timeout=READY_SECONDS) as client:
            await awaited(lambda: _there(client), robots.__eq__, what="every robot is there", every=0.5)
            host = _Host(client, port, hall, backlog_of(robots))
            load = os.getloadavg()[0]
            try:
                await host.keep_waiting(extent.warm_up * 60)
                before = len(host.finished)
                await host.keep_waiting(extent.minutes * 60)
            finally:
                host.close()
        processes.check()
        finished = len(host.finished) - before
        return {
            "orders_per_minute": round(finished / extent.minutes, 2),
            "failed": len(host.failed),
            "load": round((load + os.getloadavg()[0]) / 2, 1),
        }


async def _there(client: httpx.AsyncClient) -> int:
    vehicles = (await client.get("/v1/vehicles")).json()["vehicles"]
    return sum(each["state"] in WELL and each["currentPosition"] is not None for each in vehicles)


def _agent_settings(hall: Hall, robots: int, port: int) -> str:
    starts = "\n".join(f"[[loopback.starts]]\nx = {each.x_m}\ny = {each.y_m}" for each in hall.starts(robots))
    work = "\n".join(
        f'[[operations]]\nkind = "time"\naction_type = "{action}"\nseconds = {WORK_SECONDS}\nload = "{load}"'
        for action, load in (("pick", "take"), ("drop", "give"))
    )
    return f"""\
manufacturer = "{MANUFACTURER}"
serial_number = "robot"
map_id = "{MAP_ID}"
driver = "loopback"
journal = {{ enabled = false }}
mqtt = {{ port = {port} }}
log = {{ level = "warning" }}
{work}
[interval]
visualization = 0
[loopback]
count = {robots}
speed = {SPEED_MM_S / 1000}
drain = 0
{starts}
"""


class _Host:
    """Keeps orders waiting, and hears of their ends."""

    def __init__(self, client: httpx.AsyncClient, port: int, hall: Hall, backlog: int) -> None:
        self.finished: set[str] = set()
        self.failed: set[str] = set()
        self._waiting: set[str] = set()
        self._begun: set[str] = set()
        self._client = client
        self._backlog = backlog
        self._orders = iter(orders_by_lot(hall, Random(1).randrange(1000)))
        self._wire = Wire(port, "bench-traffic", ("nena/v1/transportOrders/+/status",), self._told)

    def close(self) -> None:
        self._wire.close()

    async def keep_waiting(self, seconds: float) -> None:
        """Keep the backlog up for so long."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for pick, drop in islice(self._orders, max(0, self._backlog - len(self._waiting))):
                destinations = (
                    Destination(location_name=pick, operation=PICK),
                    Destination(location_name=drop, operation=DROP),
                )
                request = TransportOrderRequest(destinations=destinations)
                body = request.model_dump_json(by_alias=True, exclude_defaults=True)
                answer = await self._client.post(
                    "/v1/transportOrders", content=body, headers={"Content-Type": "application/json"}
                )
                answer.raise_for_status()
                name = answer.json()["name"]
                if name not in self._begun:
                    self._waiting.add(name)
            await time_passes(LOOK_SECONDS)

    def _told(self, _topic: str, payload: bytes, _moment: float) -> None:
        if not payload:
            return
        status = json.loads(payload)
        if status["state"] in ("BEING_PROCESSED", "FINISHED", "FAILED", "UNROUTABLE"):
            self._begun.add(status["name"])
            self._waiting.discard(status["name"])
        if status["state"] == "FINISHED":
            self.finished.add(status["name"])
        elif status["state"] in ("FAILED", "UNROUTABLE"):
            self.failed.add(status["name"])
