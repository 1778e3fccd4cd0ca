"""The commands for points and locations, and what they ask the order service for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from nena_cli import places
from nena_client import Client
from nena_shared.fleet_api.operations import Operation
from nena_shared.fleet_api.places import LocationLink, LocationPage, LocationStatus, PointPage, PointStatus
from nena_shared.plant_terms import PointType

POINT = PointStatus(
    name="Dock 1",
    type=PointType.HALT_POSITION,
    x=1.5,
    y=-2.0,
    theta=None,
    map_id="hall",
    locations=("Packing",),
    occupied_by=("Robot-01",),
    reserved_by=("Robot-01", "Robot-02"),
)
LOCATION = LocationStatus(
    name="Packing",
    type="Station",
    x=1.0,
    y=-2.0,
    locked=True,
    operations=("Load cargo", "Unload cargo"),
    peripheral_operations=("open",),
    links=(
        LocationLink(point="Dock 1", operations=("Load cargo", "Unload cargo")),
        LocationLink(point="Dock 2", operations=("Load cargo",)),
    ),
)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Any]]:
    """Return the operations that commands call, with the object's name or the query."""
    calls: list[tuple[str, Any]] = []

    def call(_: Client, operation: Operation[Any], name: str = "") -> PointStatus | LocationStatus:
        calls.append((operation.name, name))
        return POINT if operation.answer is PointStatus else LOCATION

    def pages(_: Client, operation: Operation[Any], query: Any = None) -> Iterator[PointPage | LocationPage]:
        calls.append((operation.name, query))
        yield (
            PointPage(points=(POINT,))
            if operation.answer is PointPage
            else LocationPage(locations=(LOCATION,))
        )

    monkeypatch.setattr(Client, "call", call)
    monkeypatch.setattr(Client, "pages", pages)
    return calls


def run(app: typer.Typer, *arguments: str) -> str:
    result = CliRunner().invoke(app, [*arguments], env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output
    return result.output


def test_points_are_listed_with_who_uses_them(asked: list[tuple[str, Any]]) -> None:
    shown = run(places.points, "list", "--type", "HALT_POSITION", "--map", "hall", "--vehicle", "Robot-01")
    assert shown == "Dock 1\tHALT_POSITION\t1.50, -2.00\thall\tPacking\tRobot-01\tRobot-01, Robot-02\n"
    assert asked == [("points", {"type": ["HALT_POSITION"], "mapId": "hall", "vehicle": "Robot-01"})]


def test_locations_are_listed_with_what_they_offer(asked: list[tuple[str, Any]]) -> None:
    shown = run(
        places.locations, "list", "--operation", "Load cargo", "--point", "Dock 1", "--type", "Station"
    )
    offered = "Load cargo, Unload cargo\topen\tDock 1; Dock 2: Load cargo"
    assert shown == f"Packing\tStation\t1.00, -2.00\tlocked\t{offered}\n"
    assert asked == [("locations", {"type": "Station", "point": "Dock 1", "operation": "Load cargo"})]


def test_one_is_shown_by_name(asked: list[tuple[str, Any]]) -> None:
    assert run(places.points, "show", "Dock 1", "-o", "name") == "Dock 1\n"
    assert '"reservedBy":["Robot-01","Robot-02"]' in run(places.points, "show", "Dock 1", "-o", "json")
    assert run(places.locations, "show", "Packing", "-o", "name") == "Packing\n"
    assert asked == [("point", "Dock 1"), ("point", "Dock 1"), ("location", "Packing")]
