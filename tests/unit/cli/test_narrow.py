"""Tables in a terminal of 80 columns."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from nena_cli import tables
from nena_cli.narrow import narrow
from nena_cli.styled import Table
from nena_cli.watching import Board
from nena_client import Event
from nena_shared.fleet_api.vehicle import VehicleStatus
from support.fleet_examples import vehicle_status

REASON = "robot AMR-1 travels to destination 2 of 2, but it waits for AMR-5, which passes 'Middle 5' first"


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
