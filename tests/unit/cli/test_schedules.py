"""The commands for schedules, and what they ask the order service for."""

from __future__ import annotations

from datetime import UTC, datetime
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


def test_an_order_template_is_put_and_run(asked: list[tuple[str, str, Any]]) -> None:
    run("put", "milk-run", "", "Storage")
    run("run", "milk-run", "-o", "name")
    (_, _, template), _, (operation, _, order) = asked
    assert template["cron"] is None
    assert (operation, order) == (
        "createTransportOrder",
        {**TEMPLATE, "name": "milk-run", "incompleteName": True},
    )


def test_schedule_is_switched_and_deleted(asked: list[tuple[str, str, Any]]) -> None:
    for command in ("disable", "enable", "delete"):
        run(command, "milk-run")
    assert asked == [
        ("enableSchedule", "milk-run", {"enabled": False}),
        ("enableSchedule", "milk-run", {"enabled": True}),
        ("deleteSchedule", "milk-run", None),
    ]
