"""``nena simulate --on``: a real Dask scheduler with two workers, of which one is killed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.halls import two_halls
from nena_simulate.command import app
from support.broker import free_port
from support.waiting import PATIENCE

pytestmark = pytest.mark.simulation

Program = subprocess.Popen[str]
Start = Callable[..., Program]
SHORT = (
    "--hours",
    "0.05",
    "--warm-up",
    "0.2",
    "--speed",
    "3",
    "--work",
    "2",
    "--robots",
    "2",
    "--seeds",
    "1-3",
)


@contextmanager
def dask(*arguments: str) -> Iterator[Program]:
    command = [sys.executable, "-m", "dask", *arguments]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as program:
        try:
            yield program
        finally:
            program.kill()


def wait_for(program: Program, text: str) -> None:
    """Wait until a program has written a line; it ends by itself if it cannot start."""
    assert program.stderr
    assert any(re.search(text, line) for line in program.stderr), f"Dask ended without {text!r}"


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    file = tmp_path / "halls.json"
    file.write_text(two_halls().with_robots(2).to_json(), encoding="utf-8")
    return file


@pytest.fixture
def address() -> Iterator[str]:
    port = free_port()
    with dask("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard") as scheduler:
        wait_for(scheduler, "Scheduler at:")
        yield f"tcp://127.0.0.1:{port}"


def simulated(plant: Path, file: Path, *options: str) -> dict[str, object]:
    result = CliRunner().invoke(app, [str(plant), *SHORT, "--json", str(file), *options])
    assert result.exit_code == 0, result.output
    report: dict[str, object] = json.loads(file.read_text(encoding="utf-8"))
    return report


@pytest.mark.timeout(6 * PATIENCE)
def test_a_killed_worker_costs_no_result(
    plant: Path, tmp_path: Path, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    worker = ("worker", address, "--no-nanny", "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")
    with ExitStack() as stack:
        workers = [stack.enter_context(dask(*worker, "--local-directory", str(tmp_path))) for _ in range(2)]
        for each in workers:
            wait_for(each, "Registered to:")
        told: list[str] = []

        def tell(text: str) -> None:
            if not told:
                workers[0].kill()
            told.append(text)

        monkeypatch.setattr("nena_simulate.command._tell_progress", tell)
        found = simulated(plant, tmp_path / "cluster.json", "--on", address)
        assert workers[1].poll() is None

    assert len(told) == 3
    assert found["missing"] == []
    assert found == simulated(plant, tmp_path / "here.json")


def test_a_cluster_without_workers_is_refused(
    plant: Path, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nena_simulate.sweep.CONNECT_SECONDS", 2)
    result = CliRunner().invoke(app, [str(plant), *SHORT, "--on", address])

    assert result.exit_code == 2
    assert (
        f"the scheduler at {address} has no workers; start them with: dask worker {address}" in result.output
    )
