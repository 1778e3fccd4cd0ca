"""(w) 10,000 loopback robots in four processes with one order service and one aggregator, for ten minutes.

Robots that stand report every 30 s, as VDA 5050 demands at least, and publish no visualization.
"""

from __future__ import annotations

import asyncio
import json
import os
import time
from collections import Counter
from pathlib import Path
from typing import Any

import httpx

from bench.event_loop import LONGEST_HOLD_MS, loop_probe
from bench.figures import within
from bench.lanes import APART_M, MAP_ID, SHARE, Hall, lanes, order_of, robot
from bench.process import cpu_of_each, rss_mb_of
from bench.rates import Hosts
from bench.readiness import READY_SECONDS, wait_until_ready
from bench.retained import unlike_rest
from bench.robots import SCHEME
from bench.wire import Wire
from nena_demo import stack
from nena_demo.processes import console_script, free_port
from nena_shared.vda5050.topics import Topic
from support.pausing import pass_time

ROBOTS = int(os.environ.get("NENA_BENCH_ROBOTS", "10000"))
MINUTES = float(os.environ.get("NENA_BENCH_MINUTES", "10"))
RATE = float(os.environ.get("NENA_BENCH_RATE", "10"))
"""Orders created per second; each drives 5 m."""
STATE_EVERY = float(os.environ.get("NENA_BENCH_STATE_EVERY", "30"))
"""Seconds between the states of a robot that stands."""
END_SECONDS = 60.0
"""Until the last orders have ended."""
FINAL = {"FINISHED", "FAILED", "UNROUTABLE"}
LOOK_EVERY = 0.5
"""Seconds."""


async def measure(folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    """Start all programs, create orders at a steady rate, and measure each program."""
    async with lanes(folder, ROBOTS) as hall:
        panel = await _start_aggregator(hall, folder)
        begin = time.perf_counter()
        for share in range(-(-ROBOTS // SHARE)):
            await _start_agent(hall, folder, share)
        await asyncio.to_thread(hall.wait_for_robots)
        there = time.perf_counter() - begin
        found = await asyncio.to_thread(_under_way, hall)
        async with httpx.AsyncClient(base_url=panel, timeout=READY_SECONDS) as client:
            fleet = (await client.get("/api/v1/fleet")).json()
    return {
        "targets": {
            "refused": within(found["refused"], 0),
            "not_finished": within(found["created"] - found["finished"], 0),
            "not_in_the_panel": within(ROBOTS - len(fleet["robots"]), 0),
            "event_loop_ms": within(found["event_loop"]["longest_ms"], LONGEST_HOLD_MS),
            "statuses_unlike_rest": within(found["unlike_rest"]["all"], 0),
        },
        "robots": ROBOTS,
        "seconds_until_all_are_there": round(there, 1),
        **found,
    }


async def _start_aggregator(hall: Hall, folder: Path) -> str:
    """Return its URL."""
    port = free_port()
    await hall.processes.start(
        "status-aggregator",
        [
            console_script("nena-status-aggregator"),
            *("--http.port", str(port), "--mqtt.port", str(hall.port)),
            *("--history.url", f"sqlite:///{folder / 'history.db'}", "--order_service.url", hall.url),
        ],
    )
    url = f"http://127.0.0.1:{port}"
    await asyncio.to_thread(wait_until_ready, url)
    return url


async def _start_agent(hall: Hall, folder: Path, share: int) -> None:
    """Start the edge agent for a share of the robots, each at the start of its lane."""
    first, last = share * SHARE, min((share + 1) * SHARE, ROBOTS)
    await hall.processes.start(
        f"edge-agent-{share}",
        [
            console_script("nena-edge-agent"),
            *("--driver", "loopback", "--manufacturer", "NeNa", "--map_id", MAP_ID),
            *("--serial_number", robot(first).rpartition("-")[0], "--loopback.count", str(last - first)),
            *("--loopback.row", "1", "--loopback.spacing", str(APART_M)),
            *("--loopback.y", str(first * APART_M), "--interval.visualization", "0"),
            *(
                "--interval.state_maximum",
                str(STATE_EVERY),
                "--journal.folder",
                str(folder / f"agent-{share}"),
            ),
        ],
        environment=stack.environment(folder, hall.port),
    )


def _under_way(hall: Hall) -> dict[str, Any]:
    """Create orders at a steady rate; return what happened, and what each program took."""
    pids = {child.name: child.process.pid for child in hall.processes.children}
    states, ended = Counter[str](), dict[str, str]()

    def on_state(_topic: str, _payload: bytes, _moment: float) -> None:
        states["all"] += 1

    def on_status(topic: str, payload: bytes, _moment: float) -> None:
        if (state := json.loads(payload)["state"] if payload else "") in FINAL:
            ended[topic] = state

    watched = Wire(hall.port, "bench-states", (SCHEME.for_all(Topic.STATE),), on_state)
    statuses = Wire(hall.port, "bench-ends", ("nena/v1/transportOrders/+/status",), on_status)
    hosts, created = Hosts(hall.url), 0
    with loop_probe(hall.url) as probe:
        states.clear()
        before, begin = cpu_of_each(pids), time.perf_counter()
        while (passed := time.perf_counter() - begin) < MINUTES * 60:
            while created < passed * RATE:
                hosts.create(order_of(created, hall.robots))
                created += 1
            pass_time(LOOK_EVERY)
        seconds, after = time.perf_counter() - begin, cpu_of_each(pids)
        reported = states["all"]
        hosts.close()
        deadline = time.perf_counter() + END_SECONDS
        while len(ended) < created - len(hosts.refused) and time.perf_counter() < deadline:
            pass_time(LOOK_EVERY)
        loop = probe.figures()
    watched.close()
    statuses.close()
    return {
        "seconds": round(seconds, 1),
        "created": created,
        "refused": len(hosts.refused),
        "finished": list(ended.values()).count("FINISHED"),
        "states_per_second": round(reported / seconds, 1),
        "share_of_a_core": {name: round((after[name] - before[name]) / seconds, 3) for name in pids},
        "rss_mb": {name: rss_mb_of(pid) for name, pid in pids.items()},
        "event_loop": loop,
        "unlike_rest": unlike_rest(hall),
    }
