"""``nena simulate``: a plant file goes in; tables, JSON, Markdown and pictures come out."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.halls import two_halls
from nena_cli.__main__ import app as nena
from nena_simulate.command import app

SHORT = ("--hours", "0.02", "--warm-up", "0.2", "--speed", "3", "--work", "2")


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    file = tmp_path / "halls.json"
    file.write_text(two_halls().with_robots(2).to_json(), encoding="utf-8")
    return file


@pytest.mark.long
def test_fleet_sizes_side_by_side_in_every_form(plant: Path, tmp_path: Path) -> None:
    files = ("--json", tmp_path / "r.json", "--markdown", tmp_path / "r.md", "--heat-maps", tmp_path / "maps")

    result = CliRunner().invoke(app, [str(plant), "--robots", "2,4", *SHORT, *map(str, files)])

    assert result.exit_code == 0, result.output
    figures = json.loads((tmp_path / "r.json").read_text())["figures"]
    assert [each["robots"] for each in figures] == [2, 4]
    rate = f"{figures[0]['orders_per_hour']:>5}  {figures[1]['orders_per_hour']:>5}"
    assert rate in result.output
    assert "| orders per hour |" in (tmp_path / "r.md").read_text()
    pictures = sorted(each.name for each in (tmp_path / "maps").iterdir())
    assert pictures == ["waiting-2.svg", "waiting-4.svg"]


def test_nena_passes_its_arguments_on_to_a_process_whose_sets_have_a_fixed_order(
    plant: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[str] = []

    def execve(_: str, command: list[str], environment: dict[str, str]) -> None:
        begun.extend([environment["PYTHONHASHSEED"], *command[1:]])
        raise SystemExit(3)  # it never returns

    monkeypatch.setattr("os.execve", execve)
    monkeypatch.delenv("PYTHONHASHSEED", raising=False)
    arguments = [str(plant), "--robots", "none"]

    assert CliRunner().invoke(nena, ["simulate", *arguments]).exit_code == 3
    assert begun == ["0", "-m", "nena_simulate", *arguments]

    monkeypatch.setenv("PYTHONHASHSEED", "0")
    result = CliRunner().invoke(nena, ["simulate", *arguments])
    assert result.exit_code == 2
    assert "'none' is not a list of fleet sizes" in result.output


@pytest.mark.simulation
@pytest.mark.long
def test_a_single_run_needs_no_other_process(plant: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nena_simulate.sweep.observe_apart", lambda _: pytest.fail("another process"))

    result = CliRunner().invoke(app, [str(plant), "--robots", "2", *SHORT])

    assert result.exit_code == 0, result.output
    assert "1 of 1 done" in result.output


def test_an_interrupted_single_run_is_named(plant: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("nena_simulate.sweep.observe", interrupt)

    result = CliRunner().invoke(app, [str(plant), "--robots", "2", *SHORT])

    assert result.exit_code == 1
    assert "interrupted with 0 of 1 runs done" in result.output


@pytest.mark.parametrize("text", ["no plant", '{"name": "empty"}'])
def test_unusable_plant_is_refused_with_a_reason(tmp_path: Path, text: str) -> None:
    file = tmp_path / "plant.json"
    file.write_text(text, encoding="utf-8")

    result = CliRunner().invoke(app, [str(file), *SHORT])

    assert result.exit_code == 2
    assert "nena simulate: " in result.output


@pytest.mark.long
def test_the_start_imports_no_web_framework() -> None:
    names = "{'fastapi', 'starlette', 'nena_order_service.extension'}"
    code = f"import sys, nena_simulate.command; print({names} & sys.modules.keys())"

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert done.stdout == "set()\n"
