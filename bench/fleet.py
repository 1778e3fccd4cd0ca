"""Many loopback robots in one process, with order service and aggregator, under a steady load of orders."""

from __future__ import annotations

import json
import os
import time

import httpx

from bench import lanes
from bench.programs import WAIT_SECONDS, Figures, Version, running_site
from bench.wire import Wire
from support.pausing import pass_time

ROBOTS = int(os.environ.get("NENA_BENCH_ROBOTS", "1000"))
MINUTES = float(os.environ.get("NENA_BENCH_MINUTES", "2"))
ORDERS_PER_SECOND = float(os.environ.get("NENA_BENCH_RATE", "5"))
END_SECONDS = 60.0
"""Until the last orders have ended."""
FINAL = ("FINISHED", "FAILED", "UNROUTABLE")


def measure_fleet(version: Version) -> Figures:
    """Return what 1,000 robots and 5 orders a second take of each program."""
    ended: dict[str, str] = {}

    def note(topic: str, payload: bytes, _moment: float) -> None:
        if (state := json.loads(payload)["state"] if payload else "") in FINAL:
            ended[topic] = state

    with running_site(version) as site:
        url = site.start_order_service(lanes.lanes(ROBOTS))
        panel = site.start_aggregator(url)
        begin = time.perf_counter()
        site.start(
            "edge-agent",
            version.program("nena-edge-agent"),
            *("--driver", "loopback", "--manufacturer", "NeNa", "--map_id", lanes.MAP_ID),
            *("--serial_number", "lane", "--loopback.count", str(ROBOTS), "--loopback.row", "1"),
            *("--loopback.spacing", str(lanes.APART_M), "--interval.visualization", "0"),
            *("--journal.folder", str(site.folder / "journal")),
        )
        lanes.wait_for_robots(url, ROBOTS)
        figures: Figures = {"start_s": time.perf_counter() - begin}
        statuses = Wire(site.broker_port, "bench-ends", ("nena/v1/transportOrders/+/status",), note)
        host, created = lanes.Host(url), 0
        cpu, begin = site.cpu(), time.perf_counter()
        while (passed := time.perf_counter() - begin) < MINUTES * 60:
            while created < passed * ORDERS_PER_SECOND:
                host.create(lanes.order(created, ROBOTS))
                created += 1
            pass_time(0.1)
        seconds, after, memory = time.perf_counter() - begin, site.cpu(), site.memory()
        host.close()
        deadline = time.perf_counter() + END_SECONDS
        while len(ended) < created - len(host.refused) and time.perf_counter() < deadline:
            pass_time(0.5)
        statuses.close()
        shown = httpx.get(f"{panel}/api/v1/fleet", timeout=WAIT_SECONDS).json()["robots"]
    for name in memory:
        figures[f"{name}_cpu_percent"] = (after[name] - cpu[name]) / seconds * 100
        figures[f"{name}_memory_mb"] = memory[name]
    finished = sum(state == "FINISHED" for state in ended.values())
    return {**figures, "not_finished": float(created - finished), "not_shown": float(ROBOTS - len(shown))}
