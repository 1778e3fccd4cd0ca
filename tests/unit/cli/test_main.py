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
