"""What the black box costs a driving robot: processes with and without one, in the same run.

``PYTHONPATH=tests python -m bench.black_box_cost`` prints the CPU time of each process, and the difference.
"""

from __future__ import annotations

import asyncio
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

from bench.process import cpu_of, rss_mb_of
from support.broker import Broker, MqttPeer
from support.edge_agent import AgentProcess, FleetControl
from support.pausing import time_passes
from support.robot_core import order

SECONDS = 40.0
"""Time measured; the order takes longer."""
PAIRS = 3
BUSY = ("--loopback.speed", "1", "--interval.visualization", "0.05", "--loopback.pose_interval", "0.05")
"""Twenty poses and visualization messages per second."""


async def measure() -> None:
    """Run the processes side by side on the same order, and print their CPU time."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        broker = Broker()
        stack.callback(broker.close)
        processes: dict[str, int] = {}
        for number in range(PAIRS):
            for kind in ("off", "on"):
                name = f"{kind}-{number}"
                named = ("--mqtt.client_id", name)
                box = ("--black_box.enabled", "--upload.folder", str(folder / name)) * (kind == "on")
                agent = stack.enter_context(AgentProcess(broker, name, folder / name, *BUSY, *named, *box))
                processes[name] = agent.process.pid
                fleet = FleetControl(stack.enter_context(MqttPeer(broker, f"{name}/#")), name)
                await fleet.state()
                fleet.send(order("n0", "n9", order_id="o-1"))
                await fleet.state(lambda state: state["driving"])
        before = {name: cpu_of(pid) for name, pid in processes.items()}
        await time_passes(SECONDS)
        used = {name: cpu_of(pid) - before[name] for name, pid in processes.items()}
        for name, pid in processes.items():
            sys.stdout.write(f"{name}: {used[name]:.2f} s of CPU in {SECONDS:g} s, {rss_mb_of(pid)} MB\n")
        off, on = (sum(used[f"{kind}-{number}"] for number in range(PAIRS)) for kind in ("off", "on"))
        sys.stdout.write(f"on beside off: {100 * (on / off - 1):+.1f} %\n")


if __name__ == "__main__":
    asyncio.run(measure())
