from __future__ import annotations

import pytest
from typer.testing import CliRunner

from nena_cli.__main__ import COMMANDS, app

WIDE = {"COLUMNS": "200"}


@pytest.mark.parametrize("name", [*COMMANDS])
def test_each_command_loads_and_explains_itself(name: str) -> None:
    done = CliRunner().invoke(app, [name, "--help"], env=WIDE)
    assert done.exit_code == 0, done.output
    assert COMMANDS[name].help.removesuffix(".") in done.stdout


@pytest.mark.parametrize(
    ("typed", "meant"), [("ordres", "'orders'"), ("vda505", "'vda5050'"), ("simulat", "'simulate'")]
)
def test_mistyped_command_is_answered_with_what_is_meant(typed: str, meant: str) -> None:
    done = CliRunner().invoke(app, [typed, "list"], env=WIDE)
    assert done.exit_code == 2
    assert f"No such command '{typed}'. Did you mean {meant}?" in done.output
    assert "Did you mean" not in CliRunner().invoke(app, ["zzzz"], env=WIDE).output
