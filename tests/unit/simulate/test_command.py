"""``nena simulate``: a plant file goes in; tables, JSON, Markdown and pictures come out."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.halls import two_halls
from nena_cli.__main__ import app as nena
from nena_simulate.__main__ import app

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


def test_nena_passes_its_arguments_on(plant: Path) -> None:
    result = CliRunner().invoke(nena, ["simulate", str(plant), "--robots", "none"])

    assert result.exit_code == 2
    assert "'none' is not a list of fleet sizes" in result.output


@pytest.mark.parametrize("text", ["no plant", '{"name": "empty"}'])
def test_unusable_plant_is_refused_with_a_reason(tmp_path: Path, text: str) -> None:
    file = tmp_path / "plant.json"
    file.write_text(text, encoding="utf-8")

    result = CliRunner().invoke(app, [str(file), *SHORT])

    assert result.exit_code == 2
    assert "nena simulate: " in result.output
