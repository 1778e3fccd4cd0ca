"""(n) Orders of robots that meet on a grid, (o) with a long queue, and (p) for a whole fleet at once."""

from __future__ import annotations

import asyncio
import os
import time
from collections import Counter
from pathlib import Path
from typing import Any

from bench import order_throughput
from bench.event_loop import LONGEST_HOLD_MS, loop_probe
from bench.figures import at_least, within
from bench.grid import grid
from bench.grid import start_of as on_grid
from bench.lanes import Hall, lanes, order_of, start_of
from bench.rates import Hosts, closed_loop
from bench.retained import unlike_rest
from bench.robots import BaseRobots, InstantRobots
from bench.wire import Wire
from support.pausing import pass_time

MEETING = 100
"""Robots that meet on the grid."""
FEW = 10
"""Robots with a long queue."""
QUEUE = int(os.environ.get("NENA_BENCH_QUEUE", "4000"))
ORDERS = int(os.environ.get("NENA_BENCH_ORDERS", "1500"))
"""Orders measured in a closed loop; a tenth as many warm up."""
FLEET = int(os.environ.get("NENA_BENCH_FLEET", "5000"))
ECHO_BYTES = 1500
LOOK_EVERY = 0.005
"""Seconds."""
WAIT_SECONDS = 300.0
SETTLE_SECONDS = 5.0


async def on_a_grid(folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    """(n): orders per second of 100 robots, beside the same orders on lanes, where nobody is in the way."""
    async with lanes(folder / "lanes", MEETING) as hall:
        alone = await asyncio.to_thread(_on_lanes, hall)
    async with grid(folder / "grid", MEETING) as hall:
        met = await asyncio.to_thread(_closed, hall, 0, ORDERS)
    rate, rate_alone = met["orders"]["per_second_of_one_core"], alone["per_second_of_one_core"]
    return {
        "targets": {
            "per_second_of_one_core": at_least(rate, 300.0),
            "per_second_of_one_core_on_lanes": at_least(rate_alone, 600.0),
            **_common(met),
        },
        "ratio_to_lanes": round(rate / rate_alone, 2),
        "lanes": alone,
        **met,
    }


async def with_a_queue(folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    """(o): 10 robots and 4,000 waiting orders, beside an empty queue."""
    figures = {}
    for name, waiting in (("empty", 0), ("long", QUEUE)):
        async with grid(folder / name, FEW) as hall:
            figures[name] = await asyncio.to_thread(_closed, hall, waiting, ORDERS // 2)
    empty, long = (figures[name]["orders"]["per_second"] for name in ("empty", "long"))
    of_core = [figures[name]["orders"]["per_second_of_one_core"] for name in ("long", "empty")]
    targets = {"rate_of_empty_queue": at_least(round(long / empty, 2), 0.8), **_common(figures["long"])}
    return {"targets": targets, "of_one_core": round(of_core[0] / of_core[1], 2), **figures}


async def whole_fleet(folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    """(p): 5,000 robots are given an order each, beside as many bare messages over the same broker."""
    async with lanes(folder / "fleet", FLEET) as hall:
        figures = await asyncio.to_thread(_given, hall)
    return {
        "targets": {
            "seconds": within(figures["seconds"], 20.0),
            "sent_more_than_once": within(figures["sent_more_than_once"], 0),
            "not_sent": within(figures["not_sent"], 0),
            **_common(figures),
        },
        **figures,
    }


def _on_lanes(hall: Hall) -> dict[str, Any]:
    robots = InstantRobots(hall.port, tuple(map(start_of, range(hall.robots))))
    hall.wait_for_robots()
    found = order_throughput.measure(hall, robots, ORDERS)
    robots.close()
    return found


def _common(figures: dict[str, Any]) -> dict[str, Any]:
    return {
        "event_loop_ms": within(figures["event_loop"]["longest_ms"], LONGEST_HOLD_MS),
        "statuses_unlike_rest": within(figures["unlike_rest"]["all"], 0),
    }


def _closed(hall: Hall, waiting: int, orders: int) -> dict[str, Any]:
    robots = BaseRobots(hall.port, tuple(map(on_grid, range(hall.robots))))
    hall.wait_for_robots()
    with loop_probe(hall.url) as probe:
        warm_up = max(hall.robots, orders // 10)
        found = closed_loop(hall, robots, waiting=waiting, warm_up=warm_up, orders=orders)
        loop = probe.figures()
    sent = Counter(order for _, order, _ in robots.taken())
    robots.close()  # so that the statuses come to rest
    return {
        "robots": hall.robots,
        "orders": {**found, "sent_more_than_once": sum(times > 1 for times in sent.values())},
        "event_loop": loop,
        "unlike_rest": unlike_rest(hall),
    }


def _given(hall: Hall) -> dict[str, Any]:
    robots = InstantRobots(hall.port, tuple(map(start_of, range(hall.robots))))
    hall.wait_for_robots()
    bare = _bare_messages(hall)
    pass_time(SETTLE_SECONDS)
    with loop_probe(hall.url) as probe:
        before, begin = hall.cpu(), time.perf_counter()
        hosts = Hosts(hall.url)
        for number in range(hall.robots):
            hosts.create(order_of(number, hall.robots))
        times, last = Counter[str](), begin
        while len(times) < hall.robots and time.perf_counter() - last < WAIT_SECONDS:
            for serial, _, moment in robots.taken(wait=1.0):
                times[serial] += 1
                last = max(last, moment)
        seconds, cpu = last - begin, hall.cpu() - before
        hosts.close()
        loop = probe.figures()
    times.update(serial for serial, _, _ in robots.taken(wait=1.0))
    robots.close()  # so that the statuses come to rest
    return {
        "robots": hall.robots,
        "refused": len(hosts.refused),
        "seconds": round(seconds, 2),
        "cpu_ms_per_order": round(cpu / hall.robots * 1e3, 2),
        "bare_messages_seconds": round(bare, 3),
        "ratio": round(seconds / bare, 1),
        "sent_more_than_once": sum(each > 1 for each in times.values()),
        "not_sent": hall.robots - len(times),
        "rss_mb": hall.rss_mb(),
        "event_loop": loop,
        "unlike_rest": unlike_rest(hall),
    }


def _bare_messages(hall: Hall) -> float:
    """Return how long bare paho takes to pass a message to each robot over the broker, s."""
    arrivals: list[float] = []
    wire = Wire(hall.port, "bench-bare", ("bench/+/order",), lambda _t, _p, moment: arrivals.append(moment))
    begin = time.perf_counter()
    for number in range(hall.robots):
        wire.publish(f"bench/{number}/order", b"x" * ECHO_BYTES)
    while len(arrivals) < hall.robots and time.perf_counter() - begin < WAIT_SECONDS:
        pass_time(LOOK_EVERY)
    wire.close()
    return arrivals[-1] - begin
