"""(s) How slow a robot becomes at nodes that it passes, by each way to drive, and what that costs the agent.

The simulated robot drives at 0.5 m/s over nodes 2 m apart, slows down near a goal as Regulated Pure Pursuit
does, and plans again once a second; the second half of the base comes on the way. The yardstick is its own
cruise in the same drive.
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from statistics import median
from typing import Any

import psutil
from nav_msgs.msg import Odometry

from nena_edge_agent.nav2.settings import Navigation
from support.broker import Broker
from support.nav2_agent import Bench, ready
from support.ros import BEST_EFFORT, RosPeer, own_domain_id
from support.smooth_drive import LIKE_NAV2, REGULATED, WAYS, drive

RUNS = 3
LEAST = 0.8
"""What the slowest speed at a passed node is to be, as a share of the cruise."""


async def measure(folder: Path) -> dict[str, Any]:
    """Return the figures of each way to drive."""
    return {"s_" + navigation: await _way(folder / navigation, navigation) for navigation in WAYS}


async def _way(folder: Path, navigation: Navigation) -> dict[str, Any]:
    folders = [folder / str(number) for number in range(RUNS)]
    for each in folders:
        await asyncio.to_thread(each.mkdir, parents=True)
    runs = [await _run(each, navigation) for each in folders]
    slowest = min(ratio for ratio, _ in runs)
    return {
        "slowest_at_passed_nodes": [round(ratio, 2) for ratio, _ in runs],
        "least": {"value": round(slowest, 2), "target": LEAST, "met": slowest >= LEAST},
        "agent_cpu_percent": round(median(cpu for _, cpu in runs), 1),
    }


async def _run(folder: Path, navigation: Navigation) -> tuple[float, float]:
    """Drive once, with separate programs.

    Return the minimum speed at nodes, and the agent's CPU in percent.
    """
    broker = Broker()
    with own_domain_id() as domain_id, RosPeer(domain_id) as peer:
        bench = Bench(broker, "bench", ros=peer, domain_id=domain_id, folder=folder)
        odometry = peer.subscribe(Odometry, "odom", BEST_EFFORT)
        options = ("--drive.strategy", "pass_through")
        with (
            bench.mqtt,
            bench.simulator(*LIKE_NAV2, time_factor=1.0, drive=REGULATED),
            bench.agent_process(*options, "--ros.navigation", navigation) as agent,
        ):
            await bench.fleet.state(ready, within=30.0)
            process = psutil.Process(agent.process.pid)
            process.cpu_percent()
            slowest = await drive(bench.fleet, odometry, WAYS[navigation])
            cpu = process.cpu_percent()
    broker.close()
    return slowest, cpu
