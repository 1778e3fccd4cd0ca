"""Tables in a terminal of 80 columns."""

from __future__ import annotations

import io
import re

import pytest
from rich.console import Console
from rich.text import Text

from nena_cli import output, tables
from nena_cli.narrow import is_too_wide, narrow
from nena_cli.styled import Table
from nena_cli.watching import Board
from nena_client import Event
from nena_shared.fleet_api.vehicle import VehicleStatus
from support.fleet_examples import order_status, vehicle_status

REASON = "vehicle AMR-1 travels to destination 2 of 2, but it waits for AMR-5, which passes 'Middle 5' first"


def shown(table: Table, width: int = 80) -> list[str]:
    console = Console(width=width, file=io.StringIO(), force_terminal=True, color_system=None)
    for line in narrow(console, table):
        console.print(line, soft_wrap=True)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def test_names_stay_whole_and_reasons_go_below_their_row() -> None:
    vehicles = [
        vehicle_status(name=name, transport_order="Transport-c0b7-12", reason=REASON)
        for name in ("AMR-1", "AMR-10")
    ]
    lines = shown(tables.vehicles_table(vehicles))

    assert max(map(len, lines)) <= 80
    assert [line.split()[0] for line in lines if not line.startswith(" ")] == ["vehicle", "AMR-1", "AMR-10"]
    assert " ".join("\n".join(lines).split()).count(f"reason: {REASON}") == 2
    assert "…" not in "".join(lines)


@pytest.mark.parametrize(("vehicles", "complete"), [(3, True), (12, False)])
def test_watched_vehicles_fit_the_screen(vehicles: int, *, complete: bool) -> None:
    board = Board(VehicleStatus, tables.vehicles_table)
    for number in range(vehicles):
        status = vehicle_status(name=f"AMR-{number}", transport_order="Transport-c0b7-12", reason=REASON)
        board.take(Event("vehicle", None, status.model_dump(mode="json", by_alias=True)))
    console = Console(width=80, height=24, file=io.StringIO(), force_terminal=True, color_system=None)
    console.print(board)

    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) < 24
    assert sum(line.startswith("AMR-") for line in lines) == vehicles
    assert (REASON in " ".join(" ".join(lines).split())) == complete


def test_orders_fit_with_all_their_values() -> None:
    lines = shown(tables.orders_table([order_status("Transport-c0b7-12")]))

    assert max(map(len, lines)) <= 80
    assert lines[1].startswith("Transport-c0b7-12  BEING_PROCESSED")
    assert "  destinations: Goods in: Load > Packing: Unload" in lines


def test_empty_values_take_no_line_and_a_name_is_never_broken() -> None:
    table = Table("name", "why", title="Things")
    table.add_row("n" * 30, Text(""))
    table.add_row("m", "two words here")

    assert shown(table, 20) == ["Things", "name", "n" * 30, "m", "  why: two words", "  here"]


def test_a_table_that_fits_keeps_its_frame(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    table = Table("name", "why")
    table.add_row("T-1", "because")
    assert not is_too_wide(table, 21)
    assert is_too_wide(table, 16)
    assert not is_too_wide(Table(frame=False), 1)

    monkeypatch.setenv("FORCE_COLOR", "1")
    for width in ("40", "15"):
        monkeypatch.setenv("COLUMNS", width)
        output.print_table(table)
    drawn = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)
    assert drawn.count("┃ name") == 1
    assert drawn.endswith("name  why\nT-1   because\n")


def test_empty_columns_are_left_out() -> None:
    table = Table("name", "empty", "why")
    table.add_row("n" * 10, "", "w" * 10)

    assert shown(table, 24) == ["name        why", f"{'n' * 10}  {'w' * 10}"]


def test_a_table_without_rows_is_a_line_of_text(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("NO_COLOR", "1")
    output.print_table(Table("name", "why"))
    assert "No entries." in capsys.readouterr().out

    monkeypatch.delenv("FORCE_COLOR")
    output.print_table(Table("name", "why"))
    assert capsys.readouterr().out == ""
