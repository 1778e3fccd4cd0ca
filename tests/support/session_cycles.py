"""Starts and stops a driver's ROS session many times, and prints what remains of it, as JSON.

Run it in a separate process, beside a simulated robot: ``python -m support.session_cycles DOMAIN_ID CYCLES``.
"""

from __future__ import annotations

import asyncio
import gc
import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from nena_edge_agent.driver.port import PoseReport, SessionReport
from nena_shared.log import configure
from nena_shared.settings import LogSettings
from support.nav2_driver import DrivenRobot
from support.waiting import until

WARM_UP = 10
"""Cycles before the first measurement: modules and memory pools are loaded once, and kept."""


@dataclass(frozen=True, slots=True)
class Left:
    """Resources of a process: threads, file descriptors, resident bytes."""

    threads: int
    descriptors: int
    memory: int

    @classmethod
    def now(cls) -> Left:
        gc.collect()
        process = psutil.Process()
        return cls(process.num_threads(), process.num_fds(), process.memory_info().rss)

    def more_than(self, before: Left, cycles: int, seconds: float) -> dict[str, Any]:
        """Return the resources left after these cycles, and the seconds per cycle."""
        return {
            "cycles": cycles,
            "threads_more": self.threads - before.threads,
            "descriptors_more": self.descriptors - before.descriptors,
            "memory_more_mb": round((self.memory - before.memory) / 1e6, 2),
            "ms_per_cycle": round(seconds / cycles * 1e3, 1),
        }


def measured(domain_id: int, cycles: int, program: str = "support.session_cycles") -> dict[str, Any]:
    """Run this module, or another one, in a separate process, and return its output."""
    command = [sys.executable, "-m", program, str(domain_id), str(cycles)]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, timeout=120 + cycles)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


async def _cycle(robot: DrivenRobot, cycles: int) -> None:
    for _ in range(cycles):
        await robot.driver.session.start()
        await robot.driver.session.stop()
        await _off(robot)
        states = [report.state for report in robot.all(SessionReport)]
        assert states == ["INITIATING", "ACTIVE", "TERMINATING", "NOT_ACTIVE"], states
        robot.events.clear()


async def _off(robot: DrivenRobot) -> None:
    """Wait until the driver has reported the end of the session."""
    await robot.hears(SessionReport, lambda report: report.state == "NOT_ACTIVE")


async def _live(robot: DrivenRobot) -> None:
    """Stay active for long enough to receive the robot's pose."""
    await robot.driver.session.start()
    await robot.hears(PoseReport)
    await robot.driver.session.stop()
    await _off(robot)
    robot.events.clear()


async def main() -> None:
    """Run the cycles and print the measurements."""
    domain_id, cycles = map(int, sys.argv[1:])
    async with DrivenRobot(domain_id, start_session=False) as robot:
        await _off(robot)
        robot.events.clear()
        await _live(robot)
        await _cycle(robot, WARM_UP)
        before, began = Left.now(), time.perf_counter()
        await _cycle(robot, cycles)
        seconds = time.perf_counter() - began
        await _live(robot)
        await until(lambda: Left.now().threads <= before.threads, what=f"{before} again")
        after = Left.now()
    sys.stdout.write(json.dumps(after.more_than(before, cycles, seconds)))


if __name__ == "__main__":
    configure(LogSettings(level="error"))
    asyncio.run(main())
