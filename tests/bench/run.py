"""Runs the benchmarks on this machine and writes their figures as JSON; see docs/benchmarks.md."""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Awaitable, Callable, Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import psutil

from bench import (
    aggregator_load,
    core_cost,
    edge_agent,
    loopback_fleet,
    many_orders,
    many_robots,
    order_service,
    passing_nodes,
    plant_cost,
    queue_cost,
    reading_cost,
    rest_to_wire,
    sessions,
    state_cost,
    traffic,
)
from bench.process import rss_mb_of
from bench.robots import InstantRobots, Start
from nena_demo import stack
from nena_demo.processes import Child, Processes, console_script
from support.waiting import awaited

LOOPBACK_ROBOTS = 50
STARTS = (
    Start("robot-01", "Parking bay", 1.0, 7.0),
    Start("robot-02", "Packing stand", 23.0, 7.0),
)


async def main() -> None:
    """Run the requested benchmarks and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("bench.json"))
    parser.add_argument(
        "--entries",
        nargs="*",
        choices=ENTRIES,
        metavar="ENTRY",
        help=f"what to measure: {', '.join(ENTRIES)}; all, if none is named",
    )
    parser.add_argument("--samples", type=int, default=300, help="orders per latency")
    parser.add_argument("--seconds", type=float, default=10.0, help="of states for the CPU figures")
    arguments = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    folder = Path(tempfile.mkdtemp(prefix="nena-bench-"))
    figures: dict[str, Any] = {
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": f"{platform.machine()}, {psutil.cpu_count()} cores, Python {platform.python_version()}",
        "load_before": os.getloadavg()[0],
    }
    try:
        for name in arguments.entries or ENTRIES:
            figures[name] = await ENTRIES[name](folder / name, arguments.samples, arguments.seconds)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    figures["load_after"] = os.getloadavg()[0]
    text = json.dumps(figures, indent=2)
    arguments.output.write_text(text + "\n", encoding="utf-8")
    sys.stdout.write(text + "\n")
    for line in missed(figures):
        sys.stdout.write(f"MISSED {line}\n")


def missed(figures: dict[str, Any], path: str = "") -> Iterator[str]:
    """Yield each missed target, with its value."""
    for name, each in figures.items():
        where = f"{path}.{name}" if path else name
        if not isinstance(each, dict):
            continue
        if each.get("met") is False:
            yield f"{where}: {each['value']}, target {each['target']}"
        yield from missed(each, where)


async def _services(folder: Path, samples: int, seconds: float) -> dict[str, Any]:
    """(a) and (c): order service and aggregator with robots that finish at once."""
    async with Processes(folder) as processes:
        running = await stack.start_services(processes, stack.Options())
        robots = InstantRobots(running.mqtt.port, STARTS)
        latency = await asyncio.to_thread(
            rest_to_wire.measure, running.rest_url, running.mqtt.port, robots, samples
        )
        pids = {child.name: child.process.pid for child in processes.children if child.name != "broker"}
        cost = await asyncio.to_thread(state_cost.measure, running.mqtt.port, pids, seconds)
        robots.close()
        return {"a_rest_to_wire": latency, "c_cpu_per_state": cost}


async def _memory(folder: Path, _samples: int, _seconds: float) -> dict[str, float]:
    """(d): all processes with 50 loopback robots that report."""
    async with Processes(folder) as processes:
        running = await stack.start_services(processes, stack.Options())
        await processes.start(
            "edge-agent-50-loopback",
            [
                console_script("nena-edge-agent"),
                "--driver",
                "loopback",
                "--loopback.count",
                str(LOOPBACK_ROBOTS),
            ],
            environment=stack.environment(folder, running.mqtt.port),
        )
        async with httpx.AsyncClient(base_url=running.panel_url) as panel:
            await awaited(partial(_robots_seen, panel), LOOPBACK_ROBOTS.__eq__, what="every loopback robot")
        processes.check()
        return _memory_of(processes.children)


async def _robots_seen(panel: httpx.AsyncClient) -> int:
    """Count the robots of which the aggregator has seen a state."""
    fleet = (await panel.get("/api/v1/fleet")).json()
    return sum(robot["lastState"] is not None for robot in fleet["robots"])


def _memory_of(children: list[Child]) -> dict[str, float]:
    return {child.name: rss_mb_of(child.process.pid) for child in children}


async def _core(_folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    return core_cost.measure()


async def _queue(_folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    return await queue_cost.measure()


async def _plant(_folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    return plant_cost.measure()


async def _reading(_folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    return reading_cost.measure()


async def _aggregator(folder: Path, _samples: int, seconds: float) -> dict[str, Any]:
    return await aggregator_load.measure(folder, seconds)


async def _smooth(folder: Path, _samples: int, _seconds: float) -> dict[str, Any]:
    """(s): speed at passed nodes. Loaded late: the peer of the tests sets up the environment for ROS."""
    from bench import smooth_driving  # noqa: PLC0415 - see above

    return await smooth_driving.measure(folder)


ENTRIES: dict[str, Callable[[Path, int, float], Awaitable[dict[str, Any]]]] = {
    "services": _services,
    "order_service": order_service.measure,
    "grid": many_orders.on_a_grid,
    "waiting": many_orders.with_a_queue,
    "whole_fleet": many_orders.whole_fleet,
    "passing": passing_nodes.measure,
    "loopback_fleet": loopback_fleet.measure,
    "many_robots": many_robots.measure,
    "edge_agent": edge_agent.measure,
    "memory": _memory,
    "sessions": sessions.measure,
    "core": _core,
    "queue": _queue,
    "plant": _plant,
    "reading": _reading,
    "aggregator": _aggregator,
    "smooth": _smooth,
    "traffic": traffic.measure,
}
"""What can be measured: each gets a folder, orders per latency, and seconds for figures of CPU."""


if __name__ == "__main__":
    asyncio.run(main())
