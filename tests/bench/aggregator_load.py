"""(g) The aggregator with a thousand robots, beside what it has to reach."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
from prometheus_client.parser import text_string_to_metric_families

from bench import event_latency, panel_frames, scrape_cost
from bench.bare_subscriber import bare_subscriber
from bench.figures import Figures, at_least, within
from bench.pace import Pace
from bench.process import cpu_of, cpu_of_each, rss_mb_of
from bench.readiness import wait_until_ready
from bench.state_cost import payload
from bench.wire import Wire
from nena_demo.processes import Processes, console_script, free_port, start_broker
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from support.pausing import pass_time
from support.waiting import wait_until

SCHEME = TopicScheme("uagv")
ROBOTS = 1000
STEADY_RATE = 1000.0
"""States per second: each robot sends one."""
FLOOD_RATE = 5000.0
FLOOD_STATES = 30_000
"""Six seconds of it."""
SCRAPES = 10
WAIT_SECONDS = 60.0
SETTLE_SECONDS = 2.0
LOOK_EVERY = 0.5
LITTLE_CPU = 0.02
"""Seconds of CPU that count for nothing in such a time."""


async def measure(folder: Path, seconds: float) -> dict[str, Any]:
    """Run separate aggregators; return all figures, and which of the targets they meet."""
    async with _aggregator(folder) as (port, pid, url):
        load = await asyncio.to_thread(_measure_load, port, pid, url, seconds)
    async with _aggregator(folder / "events") as (port, _, url):
        events = await event_latency.measure(port, url, seconds)
    async with _aggregator(folder / "frames") as (port, _, url):
        frames = await panel_frames.measure(port, url, seconds)
    figures = {
        **load,
        "scrape_beside_the_loop": await scrape_cost.measure(ROBOTS),
        "state_to_event": events,
        "frames_per_second": frames,
    }
    return {"targets": _targets(figures), **figures}


def _targets(figures: dict[str, Any]) -> dict[str, Any]:
    scrape = figures["scrape_beside_the_loop"]
    steady, flood = (figures[f"cpu_us_per_state_{rate}_per_second"]["ratio"] for rate in (1000, 5000))
    return {
        "cpu_per_state_to_bare_subscriber": within(max(steady, flood), 2.0),
        "states_per_second_of_one_core": at_least(figures["states_per_second_of_one_core"], FLOOD_RATE),
        "states_lost": within(figures["states_lost"], 0),
        "scrape_cpu_ms": within(max(scrape["cpu_ms"], figures["scrape"]["cpu_ms"]), 20.0),
        "scrape_longest_hold_ms": within(scrape["longest_hold_ms"], 20.0),
        "state_to_event_p99_ms": within(figures["state_to_event"]["p99_ms"], 100.0),
        "state_to_event_in_browser_p99_ms": within(figures["state_to_event"]["browser"]["p99_ms"], 100.0),
        "rss_mb": within(figures["rss_mb"], 200.0),
        "frames_per_second": at_least(figures["frames_per_second"]["moved"], 30.0),
    }


@asynccontextmanager
async def _aggregator(folder: Path) -> AsyncIterator[tuple[int, int, str]]:
    """Start a broker and an aggregator; yield the broker's port, the aggregator's pid and its URL."""
    async with Processes(folder) as processes:
        port, http_port = free_port(), free_port()
        await start_broker(processes, port, "mosquitto")
        child = await processes.start(
            "status-aggregator",
            [
                console_script("nena-status-aggregator"),
                *("--mqtt.port", str(port), "--http.port", str(http_port)),
                *("--history.url", f"sqlite:///{folder / 'history.sqlite3'}"),
            ],
        )
        url = f"http://127.0.0.1:{http_port}"
        await asyncio.to_thread(wait_until_ready, url)
        yield port, child.process.pid, url


def _measure_load(port: int, pid: int, url: str, seconds: float) -> dict[str, Any]:
    with bare_subscriber(port) as bare:
        wire = Wire(port, "bench-flood", ())
        sender = _Sender(wire)
        sender.send(ROBOTS, STEADY_RATE)
        pass_time(SETTLE_SECONDS)
        processes = {"aggregator": pid, "bare_subscriber": bare.pid}
        resting = _half_second(processes)
        steady = _cost(processes, resting, sender, int(STEADY_RATE * seconds), STEADY_RATE, url=url)
        flood = _cost(processes, resting, sender, FLOOD_STATES, FLOOD_RATE, url=url)
        rss = rss_mb_of(pid)
        scrape = _scrapes(pid, url)
        lost = sender.sent - int(_metric(url, "nena_messages_received_total"))
        missed = int(_metric(url, "nena_messages_missed_total"))
        bare_lost = sender.sent - bare.count()
        wire.close()
    return {
        "robots": ROBOTS,
        "state_bytes": len(payload(0, 1)),
        "cpu_us_per_state_1000_per_second": steady,
        "cpu_us_per_state_5000_per_second": flood,
        "states_per_second_of_one_core": round(1e6 / flood["aggregator"]),
        "states_sent": sender.sent,
        "states_lost": lost + missed,
        "states_lost_by_bare_subscriber": bare_lost,
        "rss_mb": rss,
        "scrape": scrape,
    }


class _Sender:
    """Publishes states of all robots in turn, at a rate."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self.sent = 0

    def send(self, number: int, rate: float) -> None:
        """Publish ``number`` states."""
        prepared = [
            (
                SCHEME.of(RobotKey("Bench", f"bench-{each % ROBOTS:03d}"), Topic.STATE),
                payload(each % ROBOTS, each // ROBOTS),
            )
            for each in range(self.sent, self.sent + number)
        ]
        pace = Pace(rate)
        for count, (topic, state) in enumerate(prepared):
            self._wire.publish(topic, state)
            if count % 20 == 0:
                pace.keep(count)
        self.sent += number


def _cost(
    processes: dict[str, int],
    resting: dict[str, float],
    sender: _Sender,
    number: int,
    rate: float,
    *,
    url: str,
) -> Figures:
    """Return the CPU that each process takes per state, µs, and its ratio to the yardstick's."""
    before = cpu_of_each(processes)
    sender.send(number, rate)
    _wait_for_quiet(processes, resting)
    after = cpu_of_each(processes)
    cost = {name: round((after[name] - before[name]) / number * 1e6, 1) for name in processes}
    cost["ratio"] = round(cost["aggregator"] / cost["bare_subscriber"], 2)
    _wait_for_count(url, sender.sent)
    return cost


def _half_second(processes: dict[str, int]) -> dict[str, float]:
    """Return the CPU, s, that each process takes in half a second."""
    before = cpu_of_each(processes)
    pass_time(LOOK_EVERY)
    after = cpu_of_each(processes)
    return {name: after[name] - before[name] for name in processes}


def _wait_for_quiet(processes: dict[str, int], resting: dict[str, float]) -> None:
    """Wait until no process does much more than it did at rest; what that is depends on the machine."""

    def quiet() -> bool:
        now = _half_second(processes)
        return all(now[name] <= 2 * resting[name] + LITTLE_CPU for name in processes)

    wait_until(quiet, timeout=WAIT_SECONDS, what="the end of the states")


def _wait_for_count(url: str, number: int) -> None:
    with suppress(AssertionError):  # those that are lost are counted
        wait_until(
            lambda: _metric(url, "nena_messages_received_total") >= number,
            timeout=WAIT_SECONDS,
            every=LOOK_EVERY,
        )


def _scrapes(pid: int, url: str) -> Figures:
    """Return the total cost of a scrape for the aggregator, HTTP included, and its size."""
    before = cpu_of(pid)
    for _ in range(SCRAPES):
        text = httpx.get(f"{url}/metrics").text
    return {
        "cpu_ms": round((cpu_of(pid) - before) / SCRAPES * 1e3, 1),
        "series_of_robots": text.count('{manufacturer="Bench",serial_number='),
        "megabytes": round(len(text) / 1e6, 2),
    }


def _metric(url: str, name: str) -> float:
    """Return a metric's value for states."""
    families = text_string_to_metric_families(httpx.get(f"{url}/metrics").text)
    return next(
        sample.value
        for family in families
        for sample in family.samples
        if sample.name == name and sample.labels == {"topic": "state"}
    )
