"""(g) The aggregator with a thousand robots, beside what it has to reach."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import httpx
import psutil
from prometheus_client.parser import text_string_to_metric_families

from bench import event_latency, panel_frames, scrape_cost
from bench.figures import Figures, at_least, within
from bench.state_cost import payload
from bench.wire import Wire
from nena_demo.broker import start_broker
from nena_demo.ports import free_port
from nena_demo.processes import Processes, console_script
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme

SCHEME = TopicScheme("uagv")
ROBOTS = 1000
STEADY_RATE = 1000.0
"""States per second: each robot sends one."""
FLOOD_RATE = 5000.0
FLOOD_STATES = 30_000
"""Six seconds of it."""
SCRAPES = 10
WAIT_SECONDS = 60.0
READY_SECONDS = 30.0

_BARE = """
import json, sys
from bench.wire import Wire
count = 0
def parse(topic, payload, moment):
    global count
    json.loads(payload)
    count += 1
wire = Wire(int(sys.argv[1]), "bench-bare", ("uagv/v2/+/+/state",), parse)
print("ready", flush=True)
for line in sys.stdin:
    print(count, flush=True)
"""


async def measure(folder: Path, seconds: float) -> dict[str, Any]:
    """Run aggregators of its own; give all figures, and which of the targets they keep to."""
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
    """Start a broker and an aggregator; give the broker's port, the aggregator's pid and its URL."""
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
        await asyncio.to_thread(_wait_until_ready, url)
        yield port, child.process.pid, url


def _wait_until_ready(url: str) -> None:
    end = time.perf_counter() + READY_SECONDS
    while time.perf_counter() < end:
        try:
            if httpx.get(f"{url}/readyz").status_code == httpx.codes.OK:
                return
        except httpx.TransportError:
            _pass_time(0.05)
    raise TimeoutError("the aggregator is not ready")


def _measure_load(port: int, pid: int, url: str, seconds: float) -> dict[str, Any]:
    with _bare_subscriber(port) as bare:
        wire = Wire(port, "bench-flood", ())
        sender = _Sender(wire)
        sender.send(ROBOTS, STEADY_RATE)
        _pass_time(2.0)
        processes = {"aggregator": pid, "bare_subscriber": bare.pid}
        resting = _half_second(processes)
        steady = _cost(processes, resting, sender, int(STEADY_RATE * seconds), STEADY_RATE, url=url)
        flood = _cost(processes, resting, sender, FLOOD_STATES, FLOOD_RATE, url=url)
        rss = psutil.Process(pid).memory_info().rss / 1e6
        scrape = _scrapes(pid, url)
        lost = sender.sent - int(_metric(url, "nena_messages_received_total"))
        missed = int(_metric(url, "nena_messages_missed_total"))
        bare_lost = sender.sent - _bare_count(bare)
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
        "rss_mb": round(rss, 1),
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
        start = time.perf_counter()
        for count, (topic, state) in enumerate(prepared):
            self._wire.publish(topic, state)
            if count % 20 == 0:
                _pass_time(start + count / rate - time.perf_counter())
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
    """Give the CPU that each process takes per state, µs, and how many times the yardstick's that is."""
    before = _cpu(processes)
    sender.send(number, rate)
    _wait_for_quiet(processes, resting)
    after = _cpu(processes)
    cost = {name: round((after[name] - before[name]) / number * 1e6, 1) for name in processes}
    cost["ratio"] = round(cost["aggregator"] / cost["bare_subscriber"], 2)
    _wait_for_count(url, sender.sent)
    return cost


def _half_second(processes: dict[str, int]) -> dict[str, float]:
    """Give the CPU, s, that each process takes in half a second."""
    before = _cpu(processes)
    _pass_time(0.5)
    after = _cpu(processes)
    return {name: after[name] - before[name] for name in processes}


def _wait_for_quiet(processes: dict[str, int], resting: dict[str, float]) -> None:
    """Wait until no process does much more than it did at rest; what that is depends on the machine."""
    end = time.perf_counter() + WAIT_SECONDS
    while time.perf_counter() < end:
        now = _half_second(processes)
        if all(now[name] <= 2 * resting[name] + 0.02 for name in processes):
            return
    raise TimeoutError("the processes do not come to an end with the states")


def _wait_for_count(url: str, number: int) -> None:
    end = time.perf_counter() + WAIT_SECONDS
    while _metric(url, "nena_messages_received_total") < number and time.perf_counter() < end:
        _pass_time(0.5)


def _scrapes(pid: int, url: str) -> Figures:
    """Give what a scrape costs the aggregator as a whole, HTTP included, and how much it says."""
    before = _cpu({"it": pid})["it"]
    for _ in range(SCRAPES):
        text = httpx.get(f"{url}/metrics").text
    return {
        "cpu_ms": round((_cpu({"it": pid})["it"] - before) / SCRAPES * 1e3, 1),
        "series_of_robots": text.count('{manufacturer="Bench",serial_number='),
        "megabytes": round(len(text) / 1e6, 2),
    }


@contextmanager
def _bare_subscriber(port: int) -> Iterator[subprocess.Popen[str]]:
    bare = subprocess.Popen(
        [sys.executable, "-c", _BARE, str(port)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert bare.stdout is not None
        bare.stdout.readline()
        yield bare
    finally:
        bare.communicate(timeout=10)


def _bare_count(bare: subprocess.Popen[str]) -> int:
    assert bare.stdin is not None
    assert bare.stdout is not None
    bare.stdin.write("\n")
    bare.stdin.flush()
    return int(bare.stdout.readline())


def _metric(url: str, name: str) -> float:
    """Give a metric's value for states."""
    families = text_string_to_metric_families(httpx.get(f"{url}/metrics").text)
    return next(
        sample.value
        for family in families
        for sample in family.samples
        if sample.name == name and sample.labels == {"topic": "state"}
    )


def _cpu(processes: dict[str, int]) -> dict[str, float]:
    times = {name: psutil.Process(pid).cpu_times() for name, pid in processes.items()}
    return {name: each.user + each.system for name, each in times.items()}


def _pass_time(seconds: float) -> None:
    """Let time go by, which is what is measured here."""
    threading.Event().wait(max(0.0, seconds))
