from __future__ import annotations

import json

import pytest
import typer
from rich.table import Table

from nena_cli.output import REFUSED, WRONG, echo, fail, print_json, print_table
from nena_shared.fleet_api.transport_order import Problem


def test_people_are_told_on_standard_error_to_the_letter(capsys: pytest.CaptureFixture[str]) -> None:
    echo("nena: [red]no[/] 'x'" + " y" * 100, style="red")

    told = capsys.readouterr()
    assert told.out == ""
    assert told.err == "nena: [red]no[/] 'x'" + " y" * 100 + "\n"


@pytest.mark.parametrize("status", [WRONG, REFUSED])
def test_a_command_that_gives_up_says_why_and_ends_with_its_status(
    status: int, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(typer.Exit) as ended:
        fail(OSError("[no] way"), status)

    assert ended.value.exit_code == status
    assert capsys.readouterr().err == "nena: [no] way\n"


def test_scripts_get_one_line_in_the_names_on_the_wire(capsys: pytest.CaptureFixture[str]) -> None:
    print_json(Problem(title="A\nB", status=404, detail="c"))

    told = capsys.readouterr().out
    assert told.count("\n") == 1
    assert json.loads(told)["title"] == "A\nB"


def test_a_table_that_nobody_sees_on_a_screen_is_wide(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table("name", "why")
    table.add_row("T-1", "w" * 150)
    print_table(table)

    assert "w" * 150 in capsys.readouterr().out
