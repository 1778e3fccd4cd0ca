"""The edge agent on ROS: (b) and (h) its latencies, (d) its memory, (i) its idle CPU, (k) its start.

Each figure beside a yardstick in the same run, with what it is to reach. Navigation and localisation are
played by the benchmark itself, so that their load is known.
"""

from __future__ import annotations

import asyncio
import os
import queue
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from bench import robot_latency
from bench.figures import within
from bench.helper import helper
from bench.nav2_stand_in import Nav2StandIn
from bench.process import cpu_of_each, rss_mb_of
from bench.robot_latency import FleetControl, ready
from bench.wire import Wire
from nena_demo import stack
from nena_demo.processes import Child, Processes, console_script, free_port, start_broker
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from support.pausing import pass_time

DOMAIN_ID = 78
NAMESPACE = "r1"
ROBOT = RobotKey("NeNa", "robot-01")
AS_INSTALLED = Path(__file__).with_name("as_installed")
"""Hides what logging would load as well where it finds it, and finds on no robot: 5 MB."""
RUNS = 3
STARTS = 7
WAIT_SECONDS = 30.0
SETTLE_SECONDS = 3.0

IDLE_CPU = 3.0
"""Percent of a core, with 20 poses and one state a second."""
MEMORY = 100.0
"""MB."""
START = 0.8
"""Seconds."""


async def measure(folder: Path, samples: int, seconds: float) -> dict[str, Any]:
    """Return all figures; the latencies are medians of several runs, each with a new agent."""
    runs, memory = [], []
    for number in range(RUNS):
        async with _broker(folder / f"latency-{number}") as (processes, port):
            agent = await _start_agent(processes, port)
            latencies = partial(
                robot_latency.measure,
                *(port, DOMAIN_ID, NAMESPACE, ROBOT),
                samples=samples,
                folder=processes.folder,
            )
            runs.append(await asyncio.to_thread(latencies))
            memory.append(rss_mb_of(agent.process.pid))
    async with _broker(folder / "idle") as (processes, port):
        idle = await _idle(processes, port, seconds)
    async with _broker(folder / "start") as (processes, port):
        start = await _starts(processes, port)
    return {
        "runs": RUNS,
        "b_order_on_wire_to_goal_pose": robot_latency.medians(runs, "order_on_wire_to_goal_pose"),
        "h_terminal_status_to_state_on_wire": robot_latency.medians(runs, "terminal_status_to_state_on_wire"),
        "bare_record_on_disk": robot_latency.middle([run["bare_record_on_disk"] for run in runs]),
        "d_rss_mb": within(round(median(memory), 1), MEMORY),
        **idle,
        "k_exec_to_online": start,
    }


@asynccontextmanager
async def _broker(folder: Path) -> AsyncIterator[tuple[Processes, int]]:
    async with Processes(folder) as processes:
        port = free_port()
        await start_broker(processes, port, "mosquitto")
        yield processes, port


async def _start_agent(processes: Processes, port: int, settings: str = "") -> Child:
    configuration = processes.folder / "agent.toml"
    configuration.write_text(
        f"""\
manufacturer = "{ROBOT.manufacturer}"
serial_number = "{ROBOT.serial_number}"
map_id = "{robot_latency.MAP_ID}"
driver = "nav2"
journal = {{ folder = "{processes.folder / "journal"}" }}
{settings}
[ros]
namespace = "{NAMESPACE}"
domain_id = {DOMAIN_ID}
""",
        encoding="utf-8",
    )
    command = [console_script("nena-edge-agent"), "--config", str(configuration)]
    paths = [str(AS_INSTALLED), *filter(None, [os.environ.get("PYTHONPATH")])]
    variables = {**stack.environment(processes.folder, port), "PYTHONPATH": os.pathsep.join(paths)}
    return await processes.start("edge-agent", command, environment=variables)


async def _idle(processes: Processes, port: int, seconds: float) -> dict[str, Any]:
    """Measure (i), and the yardstick of (d): a robot at standstill, with poses alone and with odometry as
    well.
    """
    agent = await _start_agent(processes, port, "interval = { state_maximum = 1.0 }")
    fleet = FleetControl(port, ROBOT)
    figures: dict[str, Any] = {}
    try:
        for name, odometry in (("i_idle_cpu_percent", False), ("i_idle_cpu_percent_with_odometry", True)):
            figures[name] = await asyncio.to_thread(_idle_cpu, agent.process.pid, fleet, seconds, odometry)
    finally:
        fleet.wire.close()
    return figures


def _idle_cpu(pid: int, fleet: FleetControl, seconds: float, odometry: bool) -> dict[str, Any]:  # noqa: FBT001
    nav2 = Nav2StandIn(DOMAIN_ID, (NAMESPACE,), odometry=odometry)
    try:
        with helper("bench.bare_node", str(DOMAIN_ID), NAMESPACE) as bare:
            fleet.wait_until(ready)
            pass_time(SETTLE_SECONDS)
            processes = {"agent": pid, "bare_rclpy": bare.pid}
            before = cpu_of_each(processes)
            pass_time(seconds)
            after = cpu_of_each(processes)
            percent = {name: round((after[name] - before[name]) / seconds * 100, 2) for name in processes}
            bare_memory = rss_mb_of(bare.pid)
    finally:
        nav2.close()
    return {
        "agent": within(percent["agent"], IDLE_CPU),
        "bare_rclpy": percent["bare_rclpy"],
        "bare_rclpy_rss_mb": bare_memory,
    }


async def _starts(processes: Processes, port: int) -> dict[str, Any]:
    """(k): an agent and the bare node started in turn, some times."""
    online: queue.SimpleQueue[float] = queue.SimpleQueue()

    def note(_topic: str, payload: bytes, moment: float) -> None:
        if payload and CODEC.decode(Connection, payload).connection_state is ConnectionState.ONLINE:
            online.put(moment)

    wire = Wire(port, "bench-starts", (TopicScheme("uagv").of(ROBOT, Topic.CONNECTION),), note)
    agent_seconds, bare_seconds = [], []
    try:
        for _ in range(STARTS):
            begin = time.perf_counter()
            child = await _start_agent(processes, port)
            moment = await asyncio.to_thread(online.get, timeout=WAIT_SECONDS)
            agent_seconds.append(moment - begin)
            child.process.terminate()
            await child.process.wait()
            begin = time.perf_counter()
            with helper("bench.bare_node", str(DOMAIN_ID), NAMESPACE):
                bare_seconds.append(time.perf_counter() - begin)
    finally:
        wire.close()
    return {
        "starts": STARTS,
        "agent_s": within(round(median(agent_seconds), 2), START),
        "bare_rclpy_ready_s": round(median(bare_seconds), 2),
    }
