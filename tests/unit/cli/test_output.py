from __future__ import annotations

import json

import pytest
import typer
import yaml  # type: ignore[import-untyped]
from rich.text import Text

from nena_cli.options import Format
from nena_cli.output import REFUSED, WRONG, echo, fail, print_json, print_object, print_table
from nena_cli.styled import Table
from nena_shared.fleet_api.transport_order import Problem


def test_messages_for_people_are_printed_verbatim_on_standard_error(
    capsys: pytest.CaptureFixture[str],
) -> None:
    echo("nena: [red]no[/] 'x'" + " y" * 100, style="red")

    told = capsys.readouterr()
    assert told.out == ""
    assert told.err == "nena: [red]no[/] 'x'" + " y" * 100 + "\n"


@pytest.mark.parametrize("status", [WRONG, REFUSED])
def test_failed_command_prints_the_reason_and_sets_the_status(
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


def test_table_for_a_pipe_is_wide(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table("name", "why")
    table.add_row("T-1", "w" * 150)
    print_table(table)

    assert "w" * 150 in capsys.readouterr().out


def test_a_pipe_gets_rows_of_values_between_tabs(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table("name", "why", title="Orders")
    table.add_row("T-1", Text("two\nlines\tand a tab", style="red"))
    table.add_row("T-2", "")
    print_table(table)

    assert capsys.readouterr().out == "T-1\ttwo lines and a tab\nT-2\t\n"


def test_a_wide_table_has_a_header_and_one_line_per_row(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table("name", "why")
    table.add_row("T-1", "w" * 300)
    print_table(table, wide=True)

    out = capsys.readouterr().out
    assert "name" in out
    assert "w" * 300 in out


def test_yaml_has_a_document_per_object(capsys: pytest.CaptureFixture[str]) -> None:
    for detail in ("größer: 1", "b"):
        print_object(Format.YAML, Problem(title="A", status=404, detail=detail))

    documents = [*yaml.safe_load_all(capsys.readouterr().out)]
    assert [each["detail"] for each in documents] == ["größer: 1", "b"]


def test_an_object_without_a_name_has_no_name_format(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit):
        print_object(Format.NAME, Problem(title="A", status=404, detail="a"))

    assert "has no name" in capsys.readouterr().err
