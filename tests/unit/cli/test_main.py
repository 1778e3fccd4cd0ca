from __future__ import annotations

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


def test_help_fits_a_terminal_of_80_columns() -> None:
    shown = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "80"}).stdout
    assert max(map(len, shown.splitlines())) <= 80
    assert "─" not in shown
