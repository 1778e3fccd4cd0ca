"""A robot from its first order to its last, with agents that die on the way."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from errno import ENOSPC
from functools import partial
from os import strerror
from pathlib import Path
from typing import Any

from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.agent import RobotAgent
from nena_edge_agent.driver.port import Emit, Pose
from nena_edge_agent.journal import Journal
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.vda5050.topics import RobotKey
from support.edge_agent import make_robot
from support.pausing import time_passes
from support.restarts.actions import DECLARATIONS, WorldAction
from support.restarts.driver import WorldDriver
from support.restarts.fate import Fate
from support.restarts.scenario import Fleet, Scenario
from support.restarts.virtual_time import LoopClock, run_virtually
from support.restarts.wire import Wire, WiredLink
from support.restarts.world import Goal, World
from support.robot_core import MAP

ROBOT = RobotKey("ACME", "0001")
LONGEST = 600.0
"""Seconds of the virtual time that a scenario may take."""


@dataclass(frozen=True)
class Death:
    """The agent dies at ``moment``, from 1, and is started again after ``pause`` s.

    Its records, counted from 0, fail at the numbers in ``disk_fails``.
    """

    moment: int
    pause: float
    disk_fails: range = range(0)


@dataclass(frozen=True)
class History:
    """What has happened. ``lives``: the moments of each agent; ``accepted`` and ``begun``: goals and
    actions, with the number of the states before."""

    scenario: Scenario
    world: World
    wire: Wire
    fleet: Fleet
    lives: list[list[str]]
    accepted: list[tuple[int, Goal]]
    begun: list[tuple[int, str]]


class FatedJournal(Journal):
    """A journal whose writer may die before, in the middle of and after a write."""

    fate: Fate
    disk_fails = range(0)
    records = 0

    def write(self, record: bytes) -> None:
        """Write, if the writer lives long enough."""
        number, self.records = self.records, self.records + 1
        if not self.fate.spares("before: write the journal"):
            return
        if number in self.disk_fails:
            raise OSError(ENOSPC, strerror(ENOSPC))
        if not self.fate.spares("amid: write the journal"):
            self._file.with_suffix(".new").write_bytes(record[: len(record) // 2])
            return
        super().write(record)
        self.fate.spares("after: write the journal")

    def sync(self) -> None:
        """Wait for the disk."""
        if self.fate.alive:
            super().sync()
            self.fate.spares("after: wait for the disk")


def live(scenario: Scenario, folder: Path, deaths: Sequence[Death] = ()) -> History:
    """Run a robot through ``scenario``; its agent dies once for each of ``deaths``."""
    return run_virtually(_live(scenario, folder, deaths))


async def _live(scenario: Scenario, folder: Path, deaths: Sequence[Death]) -> History:
    world, wire = World(), Wire()
    fleet = Fleet(scenario, ROBOT, wire)
    history = History(scenario, world, wire, fleet, lives=[], accepted=[], begun=[])
    world.on_accepted = lambda goal: history.accepted.append((len(fleet.states), goal))
    world.on_begun = lambda name: history.begun.append((len(fleet.states), name))
    settings = _settings(scenario, folder)
    async with asyncio.timeout(LONGEST):
        for death in (*deaths, None):
            fate = Fate(death.moment if death else None)
            history.lives.append(fate.moments)
            failures = death.disk_fails if death else range(0)
            with _agent(settings, world, wire, fate, failures) as task:
                await _first(fleet.finished, fate.dead, task)
            if fleet.finished.is_set():
                break
            await asyncio.gather(task, return_exceptions=True)
            await time_passes(death.pause if death else 0.0)
    await asyncio.gather(task, return_exceptions=True)
    return history


@contextmanager
def _agent(
    settings: EdgeAgentSettings, world: World, wire: Wire, fate: Fate, disk_fails: range
) -> Iterator[asyncio.Task[None]]:
    """Run an agent; at the end of the block it is no more."""

    def make_driver(emit: Emit, _: Pose | None) -> WorldDriver:
        return WorldDriver(world, fate, emit)

    agent = RobotAgent(
        settings,
        make_robot(ROBOT),
        make_driver,
        ActionRegistry(WorldAction(each, world, fate) for each in DECLARATIONS),
        clock=LoopClock(),
        make_link=partial(WiredLink, wire, fate),
        make_journal=partial(_journal, fate, disk_fails),
    )
    task = asyncio.create_task(agent.run(asyncio.Event()), name="agent")
    try:
        yield task
    finally:
        world.listener = None
        fate.dead.set()
        task.cancel()


def _journal(
    fate: Fate, disk_fails: range, folder: Path, robot: RobotKey, *, on_record: Callable[[bytes], None]
) -> FatedJournal:
    journal = FatedJournal(folder, robot, on_record=on_record)
    journal.fate, journal.disk_fails = fate, disk_fails
    return journal


async def _first(finished: asyncio.Event, dead: asyncio.Event, task: asyncio.Task[None]) -> None:
    """Wait for the end of the scenario, or of the agent."""
    waits = [asyncio.ensure_future(each.wait()) for each in (finished, dead)]
    await asyncio.wait([*waits, task], return_when=asyncio.FIRST_COMPLETED)
    for each in waits:
        each.cancel()
    if task.done() and not dead.is_set():
        task.result()


def _settings(scenario: Scenario, folder: Path) -> EdgeAgentSettings:
    values: dict[str, Any] = {
        "manufacturer": ROBOT.manufacturer,
        "serial_number": ROBOT.serial_number,
        "interface_name": "fleet",
        "version": scenario.version,
        "map_id": MAP,
        "driver": "loopback",
        "journal": {"folder": folder},
    }
    return EdgeAgentSettings(**(values | scenario.settings))
