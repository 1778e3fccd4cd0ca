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


HEAVY = ("rich", "pydantic", "httpx", "nena_shared", "nena_client", "structlog", "yaml", "asyncio")


@pytest.mark.parametrize("arguments", [["--version"], ["--help"]])
def test_version_and_help_start_without_heavy_modules(arguments: list[str]) -> None:
    assert imported_by(arguments, HEAVY) == set()


def test_a_command_imports_nothing_of_the_others() -> None:
    others = ("nena_conversations", "nena_cli.plants", "nena_cli.orders", "nena_cli.arguments")
    of_other_programs = ("nena_shared.mqtt", "nena_shared.plant.lif", "nena_shared.vda5050.zone_set")
    of_httpx_main = ("click", "pygments.lexers")
    of_pretty_help = ("typer.rich_utils", "rich.markdown", "markdown_it")
    of_plant_models = ("nena_shared.plant", "nena_shared.plant.model")
    of_other_operations = tuple(
        f"nena_shared.fleet_api.{each}"
        for each in (
            "places",
            "plant",
            "schedules",
            "audit",
            "webhooks",
            "operations.fleet",
            "operations.table",
        )
    )
    of_terminals = ("rich", "nena_cli.narrow")
    unneeded = (
        *(
            *others,
            *of_other_programs,
            *of_httpx_main,
            *of_pretty_help,
            *of_plant_models,
            *of_other_operations,
            *of_terminals,
        ),
        *("asyncio", "structlog", "yaml"),
    )
    command = ["vehicles", "list", "--url", "http://127.0.0.1:9"]
    assert imported_by(command, ("httpx", "pydantic", *unneeded)) == {"httpx", "pydantic"}


def test_a_command_without_an_answer_builds_no_model() -> None:
    complete = "[each.__name__ for each in below(CamelCase) if each.__pydantic_complete__]"
    found = found_at_end(["vehicles", "list", "--url", "http://127.0.0.1:9"], complete)
    assert found == {"AcceptableOrderType"}  # a default of vehicles


def imported_by(arguments: list[str], modules: tuple[str, ...]) -> set[str]:
    """Return which of these modules a command has imported at its end."""
    return found_at_end(arguments, f"set({modules!r}) & set(sys.modules)")


AT_END = """
import atexit, sys
sys.argv = ["nena", *{arguments!r}]
def below(model):
    return {{model}}.union(*map(below, model.__subclasses__()))
def report():
    if "pydantic" in sys.modules:
        from nena_shared.fleet_api.base import CamelCase
    print("found", *({names}))
atexit.register(report)
from nena_cli.__main__ import app
app()
"""


def found_at_end(arguments: list[str], names: str) -> set[str]:
    """Run a command in a process of its own; return the value of the expression ``names`` at its end."""
    done = subprocess.run(
        [sys.executable, "-c", AT_END.format(arguments=arguments, names=names)],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    marker, *found = done.stdout.splitlines()[-1].split()
    assert marker == "found", done.stderr
    return set(found)


def test_help_fits_a_terminal_of_80_columns() -> None:
    shown = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "80"}).stdout
    assert max(map(len, shown.splitlines())) <= 80
    assert "─" not in shown
