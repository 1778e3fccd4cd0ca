from __future__ import annotations

import asyncio
import shutil
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from nena_edge_agent import metrics
from nena_edge_agent import program as program_module
from nena_edge_agent.metrics import DISK, MetricsServer, Program
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.loop_lag import LoopLag
from nena_shared.tasks import StartError, Supervisor
from nena_shared.vda5050.topics import RobotKey
from support.clocks import ManualClock
from support.waiting import until

ROBOT = RobotKey("ACME", "r1")


def program(journal: Path | None) -> Program:
    clock = ManualClock()
    return Program({}, clock, LoopLag(clock), journal)


async def test_a_hanging_disk_is_queried_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Check that only one thread waits: each query takes one, which is not free before the disk answers."""
    answer, asked = threading.Event(), list[Path]()

    def usage(folder: Path) -> SimpleNamespace:
        asked.append(folder)
        answer.wait()
        return SimpleNamespace(free=7)

    monkeypatch.setattr(shutil, "disk_usage", usage)
    monkeypatch.setattr(metrics, "REQUEST_TIMEOUT", 0.01)
    shown = program(tmp_path)
    try:
        for _ in range(3):
            await shown.refresh()
            assert shown.disk_free is None
        assert asked == [tmp_path]
    finally:
        answer.set()
    await until(lambda: shown._disk_query is not None and shown._disk_query.done(), what="the disk")
    monkeypatch.setattr(metrics, "REQUEST_TIMEOUT", 5.0)
    await shown.refresh()
    assert shown.disk_free == 7
    assert len(asked) == 2


async def test_a_failing_disk_shows_no_free_space(tmp_path: Path) -> None:
    shown = program(tmp_path / "gone")
    await shown.refresh()
    assert shown.disk_free is None


@pytest.mark.parametrize(
    ("journal", "problem", "works"),
    [(Path("journal"), "", True), (Path("journal"), "disk full", False), (None, "", None)],
)
def test_a_robot_without_a_journal_has_no_journal_metric(
    *, journal: Path | None, problem: str, works: bool | None
) -> None:
    shown = program(journal)
    shown.snapshots = {ROBOT: SimpleNamespace(journal_problem=problem)}  # type: ignore[dict-item]
    (metric,) = (each for each in DISK.metrics if each.name == "nena_agent_journal_works")
    assert metric.read(shown) == ({} if works is None else {("ACME", "r1"): works})


@pytest.mark.provokes_failures
async def test_a_port_in_use_is_retried(monkeypatch: pytest.MonkeyPatch) -> None:
    served, tries = asyncio.Event(), list[str]()

    async def run(_: MetricsServer) -> None:
        tries.append("")
        if len(tries) == 1:
            message = "the port is taken"
            raise StartError(message)
        served.set()
        await asyncio.Event().wait()

    monkeypatch.setattr(MetricsServer, "run", run)
    monkeypatch.setattr(program_module, "METRICS_PAUSE", 0.0)
    settings = EdgeAgentSettings.model_validate({"metrics": {"port": 9101}})
    async with Supervisor() as supervisor:
        program_module._serve_metrics(settings, {}, ManualClock(), supervisor)
        await until(served.is_set, what="a second try")
