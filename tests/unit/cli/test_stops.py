"""The commands for stops, and what they ask the order service for."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import pytest
from typer.testing import CliRunner

from nena_cli import stops
from nena_client import Client
from nena_shared.fleet_api.operations import Operation
from nena_shared.fleet_api.stops import Area, StopList, StopStatus, UnpausedVehicle

STATUS = StopStatus(
    name="stop-1",
    by="Anna",
    reason="spill",
    since=datetime(2026, 1, 1, tzinfo=UTC),
    area=Area(x_min=2, y_min=0, x_max=8, y_max=4),
    vehicles=2,
    paused=1,
    not_paused=(UnpausedVehicle(vehicle="V-2", reason="is silent"),),
)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, Any]]:
    """Return the operations that commands call, with names and bodies."""
    found: list[tuple[str, str, Any]] = []

    def call(
        _: Client, operation: Operation[Any], name: str = "", *, body: Any = None, **_more: Any
    ) -> StopList | StopStatus:
        found.append((operation.name, name, body))
        return StopList(stops=(STATUS,)) if operation.answer is StopList else STATUS

    monkeypatch.setattr(Client, "call", call)
    return found


def run(*arguments: str) -> str:
    result = CliRunner().invoke(stops.app, [*arguments], env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output
    return result.output


def test_stops_are_listed_with_the_robots_that_are_not_paused(asked: list[tuple[str, str, Any]]) -> None:
    shown = run("list", "-o", "wide")
    assert all(each in shown for each in ("stop-1", "2,0,8,4", "Anna", "1 of 2", "V-2 is silent"))
    assert asked == [("stops", "", None)]


def test_stops_are_begun_and_ended_with_name_and_reason(asked: list[tuple[str, str, Any]]) -> None:
    run("all", "fire drill", "--by", "Anna")
    run("area", "2,0,8,4", "spill", "--by", "Anna")
    run("end", "stop-1", "--by", "Ben", "--reason", "cleaned")
    area = {"xMin": 2.0, "yMin": 0.0, "xMax": 8.0, "yMax": 4.0}
    assert asked == [
        ("stop", "", {"by": "Anna", "reason": "fire drill"}),
        ("stop", "", {"by": "Anna", "reason": "spill", "area": area}),
        ("endStop", "stop-1", {"by": "Ben", "reason": "cleaned"}),
    ]


def test_area_may_begin_at_a_negative_coordinate(asked: list[tuple[str, str, Any]]) -> None:
    run("area", "-2.5,-1,8,4", "spill", "-o", "wide", "--by", "Anna")
    area = {"xMin": -2.5, "yMin": -1.0, "xMax": 8.0, "yMax": 4.0}
    assert asked == [("stop", "", {"by": "Anna", "reason": "spill", "area": area})]


@pytest.mark.parametrize("corners", ["1,2,3", "a,b,c,d", "2,0,2,4"])
def test_invalid_area_is_named(asked: list[tuple[str, str, Any]], corners: str) -> None:
    result = CliRunner().invoke(stops.app, ["area", corners, "spill"])
    assert result.exit_code == 2
    assert "Invalid area" in result.output
    assert asked == []
