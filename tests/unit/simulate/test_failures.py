"""A failure that a program would survive outside of a simulation ends the simulation with an error."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.halls import two_halls
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.link import FleetLink
from nena_shared.tasks import Supervisor, forever
from nena_simulate.command import app
from nena_simulate.demand import Demand
from nena_simulate.simulation import simulate
from nena_simulate.site import Case
from nena_simulate.virtual_time import SimulationFailedError, VirtualClock, run
from support.pausing import time_passes

CASE = Case(
    plant=two_halls().with_robots(2),
    demand=Demand(backlog=2),
    robots=2,
    hours=0.02,
    warm_up=10.0,
    work_seconds=2.0,
)


def fail(*_: object, **__: object) -> None:
    raise RuntimeError("why")


async def failing_task() -> None:
    await time_passes(1)
    fail()


async def restarted() -> None:
    await forever("poll", failing_task)


async def left_alone() -> None:
    async with Supervisor() as tasks:
        tasks.start("helper", failing_task(), vital=False)
        await time_passes(60)


async def vital() -> None:
    async with Supervisor() as tasks:
        tasks.start("heart", failing_task())
        await tasks.wait(asyncio.Event())


async def callback() -> None:
    asyncio.get_running_loop().call_later(1, fail)
    await time_passes(60)


async def at_the_end() -> None:
    with suppress(asyncio.CancelledError):
        await restarted()


@pytest.mark.provokes_failures
@pytest.mark.parametrize("work", [restarted, left_alone, vital, callback, at_the_end])
def test_each_failure_ends_a_simulation(work: Callable[[], Coroutine[None, None, None]]) -> None:
    async def working(_: VirtualClock) -> None:
        await work()

    with pytest.raises(SimulationFailedError, match="RuntimeError\\('why'\\)"):
        run(working)


@pytest.mark.simulation
@pytest.mark.provokes_failures
@pytest.mark.parametrize(
    ("part", "method"),
    [(FleetLink, "_check_periodically"), (Engine, "run_checks"), (FleetController, "on_state")],
)
def test_failing_part_of_the_order_service_ends_the_run(
    part: type, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(part, method, fail)

    with pytest.raises(SimulationFailedError, match="why"):
        simulate(CASE)


def test_the_command_reports_the_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plant = tmp_path / "halls.json"
    plant.write_text(CASE.plant.to_json(), encoding="utf-8")

    def simulate_all(*_: object, **__: object) -> None:
        raise SimulationFailedError("task 'engine' has ended: RuntimeError('why')")

    monkeypatch.setattr("nena_simulate.command.simulate_all", simulate_all)

    result = CliRunner().invoke(app, [str(plant)])

    assert result.exit_code == 1
    assert "task 'engine' has ended: RuntimeError('why')" in result.output
