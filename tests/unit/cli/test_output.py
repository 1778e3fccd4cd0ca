from __future__ import annotations

import json

import pytest
import typer

from nena_cli.output import REFUSED, WRONG, echo, fail, print_json
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
