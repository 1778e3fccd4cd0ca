"""What a scrape of a thousand robots costs, HTTP included, and for how long it holds the event loop."""

from __future__ import annotations

import asyncio
import time
import urllib.request
from contextlib import suppress

from prometheus_client import CollectorRegistry, Gauge, generate_latest

from bench.figures import Figures
from bench.state_cost import payload
from nena_shared.clock import SystemClock
from nena_shared.vda5050.records import read_record
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.v2_1 import CODEC
from nena_shared.web.server import HttpServer
from nena_shared.web.settings import HttpSettings
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.settings import AggregatorSettings, HistorySettings
from support.pausing import turn_passes

SCRAPES = 10
SERIES = 20
"""Of each robot."""


class _LoopWatch:
    """Runs in every turn of the event loop, and notes the longest CPU time between two."""

    def __init__(self) -> None:
        self.longest = 0.0

    async def run(self) -> None:
        """Watch until cancelled."""
        last = time.thread_time()
        while True:
            await turn_passes()
            now = time.thread_time()
            self.longest = max(self.longest, now - last)
            last = now


async def measure(robots: int) -> Figures:
    """Scrape an aggregator with so many robots over HTTP, beside ``generate_latest`` of as many series."""
    aggregator = _aggregator(robots)
    settings = HttpSettings(port=0)
    server = HttpServer(make_app(aggregator, settings), settings)
    serving = asyncio.create_task(server.run(), name="bench http")
    url = f"{server.url}/metrics"
    first = await asyncio.to_thread(_get, url)
    costs, watch = [await _scrape(url) for _ in range(SCRAPES)], _LoopWatch()
    watching = asyncio.create_task(watch.run(), name="bench watch")
    for _ in range(SCRAPES):
        await asyncio.to_thread(_get, url)
    watching.cancel()
    with suppress(asyncio.CancelledError):
        await watching
    server.stop()
    await serving
    return {
        "series_of_robots": first.count(b'serial_number="bench-'),
        "megabytes": round(len(first) / 1e6, 2),
        "cpu_ms": round(sorted(costs)[SCRAPES // 2] * 1e3, 1),
        "longest_hold_ms": round(watch.longest * 1e3, 1),
        "yardstick_generate_latest_cpu_ms": round(_generate_latest(robots) * 1e3, 1),
    }


async def _scrape(url: str) -> float:
    """Return the CPU time of the event loop's thread for a scrape, s."""
    before = time.thread_time()
    await asyncio.to_thread(_get, url)
    return time.thread_time() - before


def _get(url: str) -> bytes:
    with urllib.request.urlopen(url) as answer:  # noqa: S310 - our own address
        text: bytes = answer.read()
    return text


def _aggregator(robots: int) -> Aggregator:
    aggregator = Aggregator(AggregatorSettings(history=HistorySettings(url=None)), SystemClock())
    now = aggregator.now()
    for number in range(robots):
        key = RobotKey("Bench", f"bench-{number:03d}")
        aggregator.model.on_state(key, read_record(State, CODEC, payload(number, 1)), now)
    aggregator.model.advance(now)
    return aggregator


def _generate_latest(robots: int) -> float:
    """Return the client library's time to write as many gauges, s of CPU."""
    registry = CollectorRegistry()
    for number in range(SERIES):
        gauge = Gauge(f"bench_{number}", "A gauge.", ("manufacturer", "serial_number"), registry=registry)
        for robot in range(robots):
            gauge.labels("Bench", f"bench-{robot:03d}").set(robot)
    before = time.thread_time()
    generate_latest(registry)
    return time.thread_time() - before
