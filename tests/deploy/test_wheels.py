"""The wheels of `make wheels`: complete without the repository."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build all wheels and install them into a folder; other packages come from this environment."""
    folder = tmp_path_factory.mktemp("wheels")
    packages = [str(each.parent) for each in ROOT.glob("*/**/pyproject.toml") if ".venv" not in each.parts]
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-input"]
    alone = ["--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "wheel", *alone, "--no-build-isolation", "-w", folder, *packages], check=True)
    wheels = list(map(str, folder.glob("*.whl")))
    assert len(wheels) == len(packages)
    subprocess.run([*pip, "install", *alone, "--target", folder / "site", *wheels], check=True)
    return folder / "site"


@pytest.mark.parametrize(
    "program",
    [
        "nena_cli",
        "nena_order_service",
        "nena_edge_agent",
        "nena_status_aggregator",
        "nena_demo",
        "nena_deploy",
        "nena_robot_simulator",
    ],
)
def test_a_program_runs_from_its_wheel(installed: Path, program: str, tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(installed), "COLUMNS": "200"}
    command = [sys.executable, "-m", program, "--help"]
    ran = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert "sage:" in ran.stdout


def test_files_beside_the_code_are_in_the_wheels(installed: Path) -> None:
    for package, pattern in (
        ("nena_status_aggregator", "panel/static/*.js"),
        ("nena_demo", "plants/*.xml"),
        ("nena_client", "py.typed"),
    ):
        assert list((installed / package).glob(pattern)), (package, pattern)
