"""Which process of Nav2 dies or hangs, and what is active: the robot stops, or the state truthfully reports
that it does not.

A representative part by default; ``--long`` runs the whole table.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import datetime
from itertools import product
from math import hypot
from typing import Any

import pytest

from nena_edge_agent.driver.port import STANDING
from nena_robot_simulator.servers import Server
from support.action_types import HERE, needs_action_types
from support.edge_agent import FleetControl, status_of
from support.nav2_agent import ROS, Bench, ready
from support.pausing import time_passes
from support.robot_core import action, order, position
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

ALL = "all"
HANGS = "bt_navigator hangs"
PROCESSES = (
    *("bt_navigator", "controller_server", "planner_server", "behavior_server"),
    *("amcl", "lifecycle_manager_navigation", ALL, HANGS),
)
WORK = ("drive", "pass", "cancel", "pause", "dock")
FEW = (
    ("bt_navigator", "drive"),
    ("bt_navigator", "cancel"),
    ("controller_server", "pause"),
    ("planner_server", "pass"),
    ("behavior_server", "cancel"),
    ("amcl", "drive"),
    ("lifecycle_manager_navigation", "pause"),
    (ALL, "pass"),
    *((HANGS, work) for work in ("drive", "pass", "cancel")),
)
CASES = [
    pytest.param(
        *each,
        marks=(
            *(() if each in FEW else (pytest.mark.long,)),
            *((needs_action_types,) if each[0] == HANGS else ()),  # only actions have feedback
        ),
    )
    for each in product(PROCESSES, WORK)
]

GRACE = 1.0
"""Seconds in which a robot that is to stop stands, and in which a state follows the odometry."""
RESOLUTION = 0.01
"""Seconds that the timestamp of a state is rounded down by at most."""
PERIOD = 0.05
"""Seconds between two messages of the odometry: the robot's own clock, which a busy computer slows down."""
BOND = 4.0
"""Seconds after which Nav2's lifecycle manager misses a process that the drive does not need at once."""
NOT_NEEDED = frozenset({"behavior_server", "lifecycle_manager_navigation"})
"""Processes without which a drive goes on, until the bond breaks at the latest."""
BEAT = 0.02
"""Seconds between two looks at how long the agent's process was held up."""

DRIVE = {"speed": 0.5, "acceleration": 2.5, "approach": 0.6}
BRAKING = DRIVE["speed"] ** 2 / (2 * DRIVE["acceleration"])
"""Metres in which the robot stops."""
LIKE_NAV2 = ("--replan_period", "1.0", "--recovery_time", "18")
WAY = {f"n{index}": position(2.0 * index, radius=1.1) for index in range(12)}


class Delay:
    """How long a busy computer has kept this process, with the agent in it, from running: seconds."""

    def __init__(self) -> None:
        self.seconds = 0.0

    async def measure(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            began = loop.time()
            await time_passes(BEAT)
            self.seconds += max(0.0, loop.time() - began - 2 * BEAT)


@asynccontextmanager
async def delayed() -> AsyncIterator[Delay]:
    """Measure the delay of this process during the block."""
    delay = Delay()
    task = asyncio.create_task(delay.measure(), name="measure the delay")
    try:
        yield delay
    finally:
        task.cancel()


def told_at(state: dict[str, Any]) -> float:
    return datetime.fromisoformat(state["timestamp"]).timestamp()


def stamp(message: Any) -> float:
    return float(message.header.stamp.sec + message.header.stamp.nanosec / 1e9)


def moving_at(bench: Bench, time: float) -> bool:
    """Return whether the robot moved by its odometry all of the last second before ``time``."""
    until_then = time + RESOLUTION
    last = [each.twist.twist for each in bench.odometry if time - GRACE <= stamp(each) <= until_then]
    return bool(last) and all(max(abs(each.linear.x), abs(each.angular.z)) >= STANDING for each in last)


async def begin(bench: Bench, fleet: FleetControl, work: str) -> None:
    """Start what is active when a process dies."""
    if work == "dock":
        bench.fault("foreign_goal", x=20.0, y=0.0)  # a docking server drives by a goal of its own
    elif work == "pass":
        fleet.send(order(*WAY, positions=WAY))
    else:
        fleet.send(order("n0", "n3"))
    await until(lambda: bench.speed > 0.45, what="the robot on its way")


@pytest.mark.parametrize(("process", "work"), CASES)
async def test_no_robot_drives_unreported_after_a_process_dies(bench: Bench, process: str, work: str) -> None:
    ros = {**ROS, "call_timeout": 0.5, "watch_period": 1.0, "navigation": "auto" if HERE else "topics"}
    passing = {"strategy": "pass_through"} if work == "pass" else {}
    with bench.simulator(*LIKE_NAV2, time_factor=1.0, drive=DRIVE):
        async with bench.agent(ros=ros, drive=passing) as fleet:
            await fleet.state(ready)
            bench.fault("stuck", active=False)
            await begin(bench, fleet, work)
            async with delayed() as delay:
                kill(bench, process)
                died = bench.odometry[-1]
                died_at = stamp(died)
                if work in ("cancel", "pause"):
                    fleet.instant(action("a", "NONE", f"{work}Order" if work == "cancel" else "startPause"))
                    await fleet.state(lambda state: status_of(state, "a") in ("FINISHED", "FAILED"))
                stood = await the_end(bench, died_at, process, work)
            states = [each for each in fleet.states if told_at(each) >= died_at]
    check(bench, states, work=work)
    at_once = work in ("cancel", "pause") or process in ("bt_navigator", "planner_server", ALL, HANGS)
    if at_once and work != "dock":
        assert stood is not None
        rolled = [each for each in bench.odometry if died_at < stamp(each) < stamp(stood)]
        grace = GRACE + delay.seconds
        assert len(rolled) * PERIOD <= grace, f"stopped within a second, and {delay.seconds:.2f} s of delay"
        assert rolled_out(died, stood) <= DRIVE["speed"] * grace + BRAKING, "and also if messages were lost"


def kill(bench: Bench, process: str) -> None:
    """Make a process of Nav2 die or hang, or all of them die."""
    servers = [each.value for each in Server] if process == ALL else [process.split(maxsplit=1)[0]]
    for server in servers:
        bench.fault("server_hung" if process == HANGS else "server_died", server=server)


def rolled_out(died: Any, stood: Any) -> float:
    """Return the distance between two messages of the odometry, metres."""
    before, after = died.pose.pose.position, stood.pose.pose.position
    return hypot(after.x - before.x, after.y - before.y)


async def the_end(bench: Bench, died_at: float, process: str, work: str) -> Any | None:
    """Wait until the robot is at standstill, and return its odometry then.

    None: it drives on under control, because it needs nothing that is missing.
    """

    def stands() -> bool:
        return bench.speed < STANDING

    stopped = work in ("cancel", "pause")
    if process in NOT_NEEDED and not stopped:
        seen = len(bench.odometry)
        await until(
            lambda: stands() or len(bench.odometry) >= seen + (BOND + 2) / PERIOD, what="the bond's end"
        )
        if not stands():
            return None
    await until(stands, what="the robot at rest")
    return next(each for each in bench.odometry if stamp(each) > died_at and _still(each))


def _still(message: Any) -> bool:
    return bool(abs(message.twist.twist.linear.x) < STANDING)


def check(bench: Bench, states: list[dict[str, Any]], *, work: str) -> None:
    """Check that no state has falsely reported a standstill, and that a stop was answered truthfully."""
    for state in states:
        if not state["driving"]:
            assert not moving_at(bench, told_at(state)), f"told as standing at {state['timestamp']}"
        if work in ("cancel", "pause") and status_of(state, "a") == "FINISHED":
            assert not moving_at(bench, told_at(state))
        if status_of(state, "a") == "FAILED":
            assert any(each["errorType"] == "ROBOT_NOT_STOPPED" for each in states[-1]["errors"])


async def test_killed_agent_is_reported_as_lost_and_continues_correctly(bench: Bench) -> None:
    """Nav2 drives on without its agent, as adopted later; fleet control hears that the robot is lost."""
    with bench.simulator(*LIKE_NAV2, time_factor=1.0, drive=DRIVE), bench.agent_process() as agent:
        await bench.fleet.state(ready)
        bench.fleet.send(order("n0", "n3"))
        await until(lambda: bench.speed > 0.45, what="the robot on its way")
        agent.kill()
        await until(lambda: bench.fleet.connections[-1] == "CONNECTIONBROKEN", what="the last will")
        before = len(bench.fleet.states)
        agent.restart()
        state = await until(lambda: next(iter(bench.fleet.states[before:]), None), what="a state")
        assert state["driving"]
        bench.fleet.instant(action("c", "NONE", "cancelOrder"))
        done = await bench.fleet.state(lambda state: status_of(state, "c") in ("FINISHED", "FAILED"))
        assert status_of(done, "c") == "FINISHED"
        assert await bench.speed_at(done) == 0.0
