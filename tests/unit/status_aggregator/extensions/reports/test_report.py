from __future__ import annotations

import csv
from io import StringIO

from nena_status_aggregator.extensions.reports.report import (
    OUTAGES_KEPT,
    FailureKind,
    Link,
    Outage,
    Report,
    find_outages,
    report_csv,
    share_in_service,
)

END = 10_000

REPORT: Report = {
    "since": "2026-01-01T06:00:00.000Z",
    "until": "2026-01-01T07:00:00.000Z",
    "recordedSince": None,
    "recordedSeconds": 0.0,
    "missing": 0,
    "orders": {
        "finished": 3,
        "failed": 1,
        "perHour": None,
        "leadTimes": 3,
        "leadTimeP50": 12.5,
        "leadTimeP95": 20.0,
        "deadlines": 0,
        "onTime": 0,
        "hours": [{"since": "2026-01-01T06:00:00.000Z", "finished": 3, "failed": 1}],
    },
    "utilisation": None,
    "waitingShare": None,
    "robots": [
        {
            "robot": "=cmd/1",
            "conditions": {"BUSY": 5.0},
            "utilisation": 1.0,
            "waitingShare": 0.0,
            "distance": None,
            "emptyDistance": None,
            "charges": 2,
            "chargeAtStart": 20.5,
        }
    ],
    "waiting": [{"cause": "waits_turn", "seconds": 7.5}],
    "waitingPlaces": [{"place": "=P-2", "seconds": 6.0, "robots": 2}],
    "failures": [
        {
            "kind": FailureKind.ERROR,
            "robot": "A/1",
            "vehicle": None,
            "cause": "=1+1",
            "level": "FATAL",
            "count": 2,
        }
    ],
}


def up(time: int, *, before: int | None = None, started: bool = False) -> Link:
    return Link(time, connected=True, started=started, before=before)


def down(time: int) -> Link:
    return Link(time, connected=False, started=False, before=time)


def test_lost_connection_is_an_outage_until_it_is_back() -> None:
    first = up(0, started=True)
    assert find_outages([first, down(10), up(20, before=15)], END) == [Outage(10, 20, restart=False)]
    assert find_outages([first, down(10)], END) == [Outage(10, END, restart=False)]
    assert find_outages([first, down(10), down(12), up(20)], END) == [Outage(10, 20, restart=False)]


def test_killed_run_ends_with_its_last_event() -> None:
    first = up(0, started=True)
    assert find_outages([first, up(50, before=30, started=True)], END) == [Outage(30, 50, restart=True)]
    assert find_outages([first, up(50, before=30)], END) == [Outage(30, 50, restart=True)], "earlier releases"
    assert find_outages([first, down(10), up(50, before=30, started=True)], END) == [
        Outage(10, 50, restart=True)
    ]


def test_longest_outages_are_kept() -> None:
    links = [up(0, started=True)]
    for number in range(OUTAGES_KEPT + 1):
        links += [down(1000 * number), up(1000 * number + number + 1)]
    kept = find_outages(links, 10**9)
    assert len(kept) == OUTAGES_KEPT
    assert kept[0].begin == 1000


def test_waiting_is_no_utilisation_and_both_are_shares_of_the_time_in_service() -> None:
    conditions: dict[str, float] = {"BUSY": 30, "WAITING": 10, "IDLE": 40, "OFFLINE": 1000}
    assert share_in_service("BUSY", conditions) == 0.375
    assert share_in_service("WAITING", conditions) == 0.125
    assert share_in_service("BUSY", {"OFFLINE": 10}) is None
    assert share_in_service("BUSY", {}) is None


def test_csv_has_a_row_per_figure_and_no_formulas() -> None:
    rows = list(csv.DictReader(StringIO(report_csv(REPORT), newline="")))
    found = {
        tuple(row[name] for name in ("section", "figure", "robot", "detail")): row["value"] for row in rows
    }
    assert len(found) == len(rows)
    assert found["orders", "finished", "", ""] == "3"
    assert found["orders", "perHour", "", ""] == ""
    assert found["hours", "failed", "", "2026-01-01T06:00:00.000Z"] == "1"
    assert found["robots", "seconds", "'=cmd/1", "BUSY"] == "5.0"
    assert found["robots", "waitingShare", "'=cmd/1", ""] == "0.0"
    assert found["waiting", "seconds", "", "waits_turn"] == "7.5"
    assert found["waitingPlaces", "seconds", "", "'=P-2"] == "6.0"
    assert found["waitingPlaces", "robots", "", "'=P-2"] == "2"
    assert found["failures", "error", "A/1", "'=1+1 (FATAL)"] == "2"
