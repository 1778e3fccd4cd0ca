"""(m) The order service with its targets: latency, throughput, states of a large fleet, memory."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import httpx

from bench import order_states, order_throughput, rest_to_wire
from bench.figures import at_least, ratio, within
from bench.lanes import Hall, lanes, order_of, start_of
from bench.robots import DrivingRobots, InstantRobots
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store.database import Changes, write
from nena_order_service.store.schema import open_database
from nena_shared.fleet_api.transport_order import TransportOrderRequest
from support.postgres import Postgres

FINISHING = 100
"""Robots that finish at once."""
ORDERS = 3000
FLEET = 2000
"""Robots that report at 1 Hz."""
STORED = 10_000
WAITING = 500
"""Stored orders that are not at their end."""
ROBOTS_IN_MEMORY = 500
PAGE = 1000


async def measure(folder: Path, samples: int, seconds: float) -> dict[str, Any]:
    """Run separate order services; return all figures, and which of the targets they meet."""
    async with lanes(folder / "finishing", FINISHING) as hall:
        finishing = await asyncio.to_thread(_finishing, hall, samples)
    with postgresql() as url:
        async with lanes(folder / "postgresql", FINISHING, url) as hall:
            finishing |= {"rest_to_wire_postgresql": await asyncio.to_thread(_latency, hall, samples)}
    async with lanes(folder / "fleet", FLEET) as hall:
        states = await asyncio.to_thread(_states, hall, seconds)
    memory = folder / "memory"
    memory.mkdir(parents=True)
    await asyncio.to_thread(_store, f"sqlite:///{memory / 'orders.db'}")
    async with lanes(memory, ROBOTS_IN_MEMORY) as hall:
        stored = await asyncio.to_thread(_memory, hall, seconds)
    figures = {**finishing, "states": states, "memory": stored}
    return {"targets": _targets(figures), **figures}


def _targets(figures: dict[str, Any]) -> dict[str, Any]:
    wire, orders, states = figures["rest_to_wire"], figures["orders"], figures["states"]
    sqlite, echo = wire["request_to_order_on_wire"], wire["bare_mqtt_echo"]
    postgresql_ms = figures["rest_to_wire_postgresql"]["request_to_order_on_wire"]["p50_ms"]
    return {
        "request_to_order_on_wire_p50_ms": within(sqlite["p50_ms"], 3.0),
        "request_to_order_on_wire_p50_echoes": within(ratio(sqlite, echo)["p50"], 8.0),
        "request_to_order_on_wire_p99_ms": within(sqlite["p99_ms"], 12.0),
        "request_to_order_on_wire_postgresql_p50_ms": within(postgresql_ms, 4.5),
        "orders_per_second": at_least(orders["per_second"], 600.0),
        "orders_per_second_of_one_core": at_least(orders["per_second_of_one_core"], 600.0),
        "orders_sent_more_than_once": within(orders["sent_more_than_once"], 0),
        "cpu_per_state_ratio": within(states["cpu_us_per_state"]["ratio"], 1.15),
        "robots_of_one_core": at_least(states["robots_of_one_core"], 2000.0),
        "state_age_p99_ms": within(states["state_age"]["p99_ms"], 500.0),
        "rss_mb": within(figures["memory"]["rss_mb"], 250.0),
    }


def _finishing(hall: Hall, samples: int) -> dict[str, Any]:
    robots = InstantRobots(hall.port, tuple(map(start_of, range(hall.robots))))
    hall.wait_for_robots()
    orders = order_throughput.measure(hall, robots, ORDERS)
    body = partial(order_of, robots=hall.robots)
    wire = rest_to_wire.measure(hall.url, hall.port, robots, samples, body)
    robots.close()
    return {"orders": orders, "rest_to_wire": wire}


@contextmanager
def postgresql() -> Iterator[str]:
    """Run a PostgreSQL server that writes each commit to the disk, as that of a site does; yield its URL."""
    server = Postgres(fsync=True)
    try:
        yield server.url
    finally:
        server.close()


def _latency(hall: Hall, samples: int) -> dict[str, Any]:
    robots = InstantRobots(hall.port, tuple(map(start_of, range(hall.robots))))
    hall.wait_for_robots()
    body = partial(order_of, robots=hall.robots)
    wire = rest_to_wire.measure(hall.url, hall.port, robots, samples, body)
    robots.close()
    return wire


def _states(hall: Hall, seconds: float) -> dict[str, Any]:
    robots = DrivingRobots(hall.port, tuple(map(start_of, range(hall.robots))))
    hall.wait_for_robots()
    found = order_states.measure(hall, robots, seconds)
    robots.close()
    return found


def _memory(hall: Hall, seconds: float) -> dict[str, Any]:
    """Make robots work and report over the stored orders, and a host read all of them."""
    at_start = hall.rss_mb()
    robots = DrivingRobots(hall.port, tuple(map(start_of, range(hall.robots))))
    hall.wait_for_robots()
    order_states.measure(hall, robots, seconds)
    robots.close()
    after: dict[str, str] = {}
    read = 0
    with httpx.Client(base_url=hall.url, timeout=order_states.WAIT_SECONDS) as client:
        while "after" not in after or after["after"]:
            page = client.get("/v1/transportOrders", params={"limit": PAGE, **after}).json()
            read += len(page["transportOrders"])
            after = {"after": page["next"] or ""}
    return {"robots": hall.robots, "orders": read, "at_start_rss_mb": at_start, "rss_mb": hall.rss_mb()}


def _store(url: str) -> None:
    """Write orders into a new store: most of them done, the others waiting for the robots' second turn."""
    engine = open_database(url)
    changes = Changes()
    for number in range(1, STORED + 1):
        request = TransportOrderRequest.model_validate(order_of(number + ROBOTS_IN_MEMORY, ROBOTS_IN_MEMORY))
        changes.put_order(_order(request, number, done=number <= STORED - WAITING), None)
    changes.numbered(0)
    write(engine, changes)
    engine.dispose()


def _order(request: TransportOrderRequest, number: int, *, done: bool) -> TransportOrder:
    now = datetime.now(UTC)
    order = TransportOrder.created(request, number=number, name=f"Stored-{number}", now=now)
    order = order.activated().dispatchable()
    if not done:
        return order
    vehicle = request.intended_vehicle or ""
    return order.assigned(vehicle, [(f"{vehicle}-0", f"{vehicle}-1")], "it is free", now).finished(now)
