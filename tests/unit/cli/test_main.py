from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version

import pytest
from typer.testing import CliRunner

from nena_cli.__main__ import COMMANDS, app

WIDE = {"COLUMNS": "200"}


def test_version() -> None:
    assert CliRunner().invoke(app, ["--version"]).stdout == f"nena {version('nena-cli')}\n"


def test_help_lists_all_commands_in_order() -> None:
    shown = CliRunner().invoke(app, ["--help"], env=WIDE).stdout
    positions = [shown.index(f" {name} ") for name in COMMANDS]
    assert positions == sorted(positions)
    assert "simulate" in shown


@pytest.mark.parametrize("name", [*COMMANDS])
def test_each_command_loads_and_explains_itself(name: str) -> None:
    done = CliRunner().invoke(app, [name, "--help"], env=WIDE)
    assert done.exit_code == 0, done.output
    assert COMMANDS[name].help.removesuffix(".") in done.stdout


def test_an_unknown_command_is_an_error() -> None:
    done = CliRunner().invoke(app, ["ordres"])
    assert (done.exit_code, "ordres" in done.stderr) == (2, True)


def test_a_start_imports_nothing_of_the_other_commands() -> None:
    look = (
        "import sys, nena_cli.__main__; "
        "print([each for each in ('httpx', 'pydantic', 'structlog', 'nena_shared') if each in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", look], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout == "[]\n"
