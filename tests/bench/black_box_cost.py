"""What the black box costs a driving robot, in one process that records in every other round.

``PYTHONPATH=tests python -m bench.black_box_cost`` prints the CPU time with and without. Separate processes
would differ by 6 % for other reasons, such as the addresses of their objects.
"""

from __future__ import annotations

import asyncio
import sys
import tempfile
from pathlib import Path
from statistics import mean, stdev
from time import process_time
from unittest import mock

from nena_edge_agent.agent import RobotAgent
from nena_edge_agent.black_box.box import RecordedLink
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.mqtt import MqttLink
from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl, agent_settings, running_agent
from support.pausing import time_passes
from support.robot_core import order

SECONDS = 4.0
"""Length of a round."""
ROUNDS = 40
NAME = "cost"


def busy(broker: Broker, folder: Path) -> EdgeAgentSettings:
    """Return the settings of a robot with twenty poses and visualization messages per second."""
    return agent_settings(
        broker,
        NAME,
        folder / "journal",
        black_box={"enabled": True},
        upload={"folder": folder / "outgoing"},
        loopback={"speed": 0.4, "pose_interval": 0.05},
        interval={"visualization": 0.05, "state_minimum": 0.02},
    )


async def used_in_rounds(agent: RobotAgent) -> tuple[list[float], list[float]]:
    """Return the CPU time (s) of each round, without and with the black box."""
    observers, link = agent._observers, agent._link
    assert isinstance(link, RecordedLink)
    used: tuple[list[float], list[float]] = ([], [])
    for number in range(ROUNDS):
        recorded = number % 4 in (1, 2)  # off, on, on, off: a drift cancels out
        agent._observers = observers if recorded else []
        with mock.patch.object(
            RecordedLink, "publish", RecordedLink.publish if recorded else MqttLink.publish
        ):
            before = process_time()
            await time_passes(SECONDS)
            used[recorded].append(process_time() - before)
    return used


async def measure(folder: Path) -> None:
    """Drive one robot, and print its CPU time."""
    agents: list[RobotAgent] = []
    run = RobotAgent.run

    async def kept(agent: RobotAgent, stop: asyncio.Event) -> None:
        agents.append(agent)
        await run(agent, stop)

    broker = Broker()
    try:
        with mock.patch.object(RobotAgent, "run", kept):
            async with running_agent(busy(broker, folder)):
                with MqttPeer(broker, f"{NAME}/#") as peer:
                    fleet = FleetControl(peer, NAME)
                    await fleet.state()
                    fleet.send(order("n0", "n9", order_id="o-1"))
                    await fleet.state(lambda state: state["driving"])
                off, on = await used_in_rounds(agents[0])
    finally:
        broker.close()
    for name, found in (("without", off), ("with", on)):
        sys.stdout.write(f"{name}: {1000 * mean(found) / SECONDS:.2f} ms of CPU per second\n")
    differences = [100 * (with_box / without - 1) for without, with_box in zip(off, on, strict=True)]
    error = stdev(differences) / len(differences) ** 0.5
    sys.stdout.write(f"with beside without: {mean(differences):+.1f} % (standard error {error:.1f})\n")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        asyncio.run(measure(Path(place)))
