"""The commands for the audit trail."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import pytest
from typer.testing import CliRunner

from nena_cli import audit
from nena_client import Client
from nena_client.exchange import params_of
from nena_shared.fleet_api.audit import GENESIS, AuditEntry, AuditMark, AuditPage, hash_after
from nena_shared.fleet_api.operations import Operation


def trail(length: int) -> list[AuditEntry]:
    rows: list[AuditEntry] = []
    for number in range(1, length + 1):
        given = AuditEntry.model_validate(
            {
                "sequence": number,
                "timestamp": datetime(2026, 1, 1, 8, number, tzinfo=UTC),
                "user": "ann",
                "interface": "REST",
                "client": "nena",
                "operation": "withdraw",
                "objectKind": "transportOrder",
                "object": f"T-{number}",
                "request": "{}",
                "before": '{"state":"ACTIVE"}',
                "after": '{"state":"FAILED"}',
                "result": "DONE" if number > 1 else "REFUSED",
                "reason": "" if number > 1 else "ORDER_ENDED: it has ended",
                "hash": "",
            }
        )
        previous = rows[-1].hash if rows else GENESIS
        hash_ = hash_after(previous, given.model_dump(mode="json", by_alias=True))
        rows.append(given.model_copy(update={"hash": hash_}))
    return rows


class Served:
    """An order service with this trail; notes the queries."""

    def __init__(self, rows: list[AuditEntry]) -> None:
        self.rows = rows
        self.last = AuditMark(sequence=rows[-1].sequence, hash=rows[-1].hash)
        self.queries: list[dict[str, Any]] = []

    def pages(self, _operation: Operation[Any], query: dict[str, Any]) -> Iterator[AuditPage]:
        self.queries.append(params_of(query))
        rows = self.rows if query.get("oldestFirst") else self.rows[::-1]
        for start in range(0, len(rows), 2):
            following = str(start) if start + 2 < len(rows) else None
            part = tuple(rows[start : start + 2])
            yield AuditPage(entries=part, next=following, deleted=AuditMark(), last=self.last)


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Served:
    made = Served(trail(5))
    monkeypatch.setattr(Client, "pages", made.pages)
    return made


def run(*arguments: str, status: int = 0) -> str:
    result = CliRunner().invoke(audit.app, [*arguments], env={"COLUMNS": "300", "TZ": "UTC"})
    assert result.exit_code == status, result.output
    return result.output


def test_rows_are_listed_with_state_and_reason(served: Served) -> None:
    shown = run("list", "-o", "wide", "--limit", "5")
    for text in (
        "T-5",
        "ann",
        "REST (nena)",
        '{"state":"ACTIVE"} > {"state":"FAILED"}',
        "REFUSED: ORDER_ENDED",
    ):
        assert text in shown
    assert served.queries == [{"limit": 5}]


def test_filters_are_sent(served: Served) -> None:
    run("list", "--user", "ann", "--operation", "hold", "--object", "T-1", "--result", "REFUSED")
    assert served.queries == [
        {"user": "ann", "operation": "hold", "object": "T-1", "result": "REFUSED", "limit": 100}
    ]
    run("list", "--since", "2026-01-01T08:00:00", "--until", "2026-01-02")
    since, until = served.queries[-1]["since"], served.queries[-1]["until"]
    assert (
        datetime.fromisoformat(since).astimezone() == datetime.fromisoformat("2026-01-01T08:00").astimezone()
    )
    assert datetime.fromisoformat(until).tzinfo is not None


@pytest.mark.usefixtures("served")
def test_export_has_a_line_per_row_that_others_can_check() -> None:
    lines = [json.loads(each) for each in run("export").splitlines()]
    assert [each["sequence"] for each in lines] == [1, 2, 3, 4, 5]
    previous = GENESIS
    for each in lines:
        assert each["hash"] == hash_after(previous, each)
        previous = each["hash"]


def test_intact_trail_is_confirmed_with_its_last_row(served: Served) -> None:
    assert run("verify").strip() == f"The audit trail is intact: 5 rows, the last one {served.last}"
    assert json.loads(run("verify", "--json")) == {"sequence": 5, "hash": served.last.hash}
    assert "intact" in run("verify", "--expect", f"2:{served.rows[1].hash}")


def test_changed_row_is_named(served: Served) -> None:
    served.rows[2] = served.rows[2].model_copy(update={"user": "ben"})
    shown = run("verify", status=1)
    assert "not intact: row 3 (withdraw by ben, 2026-01-01 08:03:00 UTC)" in shown


@pytest.mark.parametrize("arguments", [("list", "-o", "wide"), ("list",)])
def test_control_characters_of_others_do_not_reach_the_terminal(
    served: Served, arguments: tuple[str, ...]
) -> None:
    """A name in a refused request could otherwise erase rows from the screen."""
    served.rows[2] = served.rows[2].model_copy(update={"object": "T\x1b[2J\u202e", "client": "a\nb"})
    shown = run(*arguments)
    assert "\x1b" not in shown
    assert "\u202e" not in shown
    assert r"T\x1b[2J\u202e" in shown
    assert r"REST (a\nb)" in shown
    served.rows[2] = served.rows[2].model_copy(update={"user": "\x1b[2K"})
    assert r"withdraw by \x1b[2K" in run("verify", status=1)
