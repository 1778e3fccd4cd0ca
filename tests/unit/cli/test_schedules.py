"""The commands for schedules, and what they ask the order service for."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from nena_cli import schedules
from nena_client import Client
from nena_shared.fleet_api.operations import Operation
from nena_shared.fleet_api.schedules import ScheduleList, ScheduleRun, ScheduleStatus
from nena_shared.fleet_api.transport_order import OrderTemplate

TEMPLATE = {
    "destinations": [{"locationName": "Goods in", "operation": "Load cargo"}, {"locationName": "Storage"}]
}
PLANNED = datetime(2026, 11, 27, 5, 30, tzinfo=UTC)
STATUS = ScheduleStatus(
    name="milk-run",
    transport_order=OrderTemplate.model_validate(TEMPLATE),
    cron="30 6 * * MON-FRI",
    time_zone="Europe/Berlin",
    next_runs=(datetime(2026, 11, 30, 5, 30, tzinfo=UTC),),
    last_runs=(
        ScheduleRun(planned=PLANNED, transport_order="milk-run-20261127T053000Z"),
        ScheduleRun(planned=PLANNED, reason="2 skipped: outage"),
    ),
    created_orders=7,
    skipped_runs=2,
)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, Any]]:
    """Return the operations that commands call, with names and bodies."""
    found: list[tuple[str, str, Any]] = []

    def call(
        _: Client, operation: Operation[Any], name: str = "", *, body: Any = None, **_more: Any
    ) -> ScheduleList | ScheduleStatus:
        found.append((operation.name, name, body))
        return ScheduleList(schedules=(STATUS,)) if operation.answer is ScheduleList else STATUS

    monkeypatch.setattr(Client, "call", call)
    return found


def run(*arguments: str) -> str:
    result = CliRunner().invoke(schedules.app, [*arguments], env={"COLUMNS": "250", "TZ": "UTC"})
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.usefixtures("asked")
def test_schedules_are_listed_and_shown_with_their_runs() -> None:
    shown = run("list", "-o", "wide")
    row = (
        "milk-run",
        "30 6 * * MON-FRI",
        "Goods in: Load cargo > Storage: MOVE",
        "milk-run-20261127T053000Z",
    )
    assert all(each in shown for each in row)
    assert "2 skipped: outage" in run("show", "milk-run", "-o", "wide")
    assert run("list", "-o", "name").split() == ["milk-run"]


def test_schedule_is_put_with_its_order(asked: list[tuple[str, str, Any]]) -> None:
    run(
        *(
            "put",
            "milk-run",
            "30 6 * * MON-FRI",
            "Goods in:Load cargo",
            "Storage",
            "--time-zone",
            "Europe/Berlin",
        ),
        *("--catch-up", "1", "--until", "2030-01-01T00:00:00", "--priority", "5", "--timeout", "600"),
    )
    ((operation, name, body),) = asked
    assert (operation, name) == ("putSchedule", "milk-run")
    assert body.pop("validUntil").startswith(("2029-12-31T", "2030-01-01T"))
    order = {
        "destinations": [
            {"locationName": "Goods in", "operation": "Load cargo"},
            {"locationName": "Storage"},
        ],
        "priority": 5,
        "type": "-",
        "timeout": 600.0,
    }
    assert body == {
        "transportOrder": order,
        "cron": "30 6 * * MON-FRI",
        "timeZone": "Europe/Berlin",
        "validFrom": None,
        "catchUp": 1,
        "maxOpenOrders": 100,
        "enabled": True,
    }


def test_order_may_come_from_a_file(asked: list[tuple[str, str, Any]], tmp_path: Path) -> None:
    file = tmp_path / "order.json"
    file.write_text(json.dumps(TEMPLATE))
    run("put", "milk-run", "30 6 * * *", "--file", str(file), "--disabled")
    assert (asked[0][2]["transportOrder"], asked[0][2]["enabled"]) == (TEMPLATE, False)


def test_options_of_the_order_are_refused_beside_a_file(
    asked: list[tuple[str, str, Any]], tmp_path: Path
) -> None:
    file = tmp_path / "order.json"
    file.write_text(json.dumps(TEMPLATE))
    command = ["put", "milk-run", "30 6 * * *", "--file", str(file), "--priority", "0", "--vehicle", "V1"]
    result = CliRunner().invoke(schedules.app, command, env={"COLUMNS": "250"})
    assert (result.exit_code, asked) == (2, [])
    assert "set --vehicle, --priority there instead" in result.output


@pytest.mark.parametrize("more", [[], ["Storage", "--file", "order.json"]])
def test_order_comes_from_stops_or_a_file(
    asked: list[tuple[str, str, Any]], more: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "order.json").write_text("{}")
    result = CliRunner().invoke(schedules.app, ["put", "milk-run", "30 6 * * *", *more])
    assert result.exit_code == 2
    assert "Specify stops or --file" in result.output
    assert asked == []


def test_file_that_is_no_json_is_named(asked: list[tuple[str, str, Any]], tmp_path: Path) -> None:
    file = tmp_path / "order.json"
    file.write_text("{")
    result = CliRunner().invoke(schedules.app, ["put", "milk-run", "30 6 * * *", "--file", str(file)])
    assert (result.exit_code != 0, asked) == (True, [])
    assert "order.json" in result.output


def test_schedule_is_switched_and_deleted(asked: list[tuple[str, str, Any]]) -> None:
    for command in ("disable", "enable", "delete"):
        run(command, "milk-run")
    assert asked == [
        ("enableSchedule", "milk-run", {"enabled": False}),
        ("enableSchedule", "milk-run", {"enabled": True}),
        ("deleteSchedule", "milk-run", None),
    ]
