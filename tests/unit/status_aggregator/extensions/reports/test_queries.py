"""Reports against a hand count of a recorded shift of two hours."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Engine, insert

from nena_status_aggregator.extensions.reports import queries as report_queries
from nena_status_aggregator.extensions.reports.queries import compute_report
from nena_status_aggregator.extensions.reports.report import Report
from nena_status_aggregator.fleet.events import Code, Event
from nena_status_aggregator.history import database
from nena_status_aggregator.history.period import TooManyEntriesError

SHIFT = Path(__file__).parents[4] / "fixtures" / "history" / "shift.jsonl"
SIX = datetime(2026, 1, 1, 6, tzinfo=UTC)
EIGHT = SIX + timedelta(hours=2)


def event(line: str) -> Event:
    entry = json.loads(line)
    time = datetime.fromisoformat(entry["time"])
    return Event(time, Code(entry["code"]), entry["text"], entry["robot"], entry["order"], entry["values"])


@pytest.fixture
def shift(engine: Engine) -> Engine:
    """Return a history with the recorded shift."""
    lines = SHIFT.read_text(encoding="utf-8").splitlines()
    database.write(engine, [event(line) for line in lines])
    return engine


def report(engine: Engine, since: datetime = SIX, until: datetime = EIGHT) -> Report:
    return compute_report(engine, database.milliseconds(since), database.milliseconds(until))


def conditions(found: Report) -> dict[str, dict[str, float]]:
    return {robot["robot"]: robot["conditions"] for robot in found["robots"]}


def test_range_and_outages(shift: Engine) -> None:
    found = report(shift)
    assert (found["since"], found["until"]) == ("2026-01-01T06:00:00.000Z", "2026-01-01T08:00:00.000Z")
    assert found["recordedSince"] == "2026-01-01T06:00:00.000Z"
    # Connection lost from 6:45 to 6:46; the last entry before the restart at 7:00 is from 6:50.
    assert found["recordedSeconds"] == 7200 - 60 - 600
    assert found["missing"] == 7


def test_orders(shift: Engine) -> None:
    # Finished: WMS-1 (6:15, repeated after the restart), WMS-2 (6:39), WMS-3 (7:20), WMS-7 (7:50, from an
    # earlier release). Failed: WMS-5 (6:12), WMS-4 (7:40). Not counted: Park-1 (automatic), WMS-9 (gave
    # way), WMS-6 (ended before), WMS-8 (at the end of the range).
    assert report(shift)["orders"] == {
        "finished": 4,
        "failed": 2,
        "perHour": 2.2,  # 4 in 6540 s
        "leadTimes": 3,  # 600, 1200, 1500
        "leadTimeP50": 1200.0,
        "leadTimeP95": 1500.0,
        "deadlines": 3,  # WMS-1, WMS-3 (late), WMS-4 (failed)
        "onTime": 1,
        "hours": [
            {"since": "2026-01-01T06:00:00.000Z", "finished": 2, "failed": 1},
            {"since": "2026-01-01T07:00:00.000Z", "finished": 2, "failed": 1},
        ],
    }


def test_time_per_condition(shift: Engine) -> None:
    found = report(shift)
    assert conditions(found) == {
        # IDLE: 6:00 to 6:10, 6:40 to 6:50 without a minute, 7:00:05 to 8:00
        "ACME/r1": {"BUSY": 600 + 900, "IDLE": 600 + 540 + 3595, "WAITING": 300},
        # BUSY: 6:35 to 6:41, 6:44 to 6:50 without a minute, 7:00:10 to 7:30
        "ACME/r2": {
            "BUSY": 360 + 300 + 1790,
            "CHARGING": 1500,
            "ERROR": 180,
            "IDLE": 300 + 300,
            "OFFLINE": 1800,
        },
        "ACME/r3": {"BUSY": 300},  # removed at 6:05
    }
    shares = {robot["robot"]: robot["utilisation"] for robot in found["robots"]}
    assert shares == {
        "ACME/r1": round(1500 / 6535, 4),
        "ACME/r2": round(2450 / 4730, 4),  # without OFFLINE
        "ACME/r3": 1.0,
    }
    assert found["utilisation"] == round(4250 / 11565, 4)
    waits = {robot["robot"]: robot["waitingShare"] for robot in found["robots"]}
    assert waits == {"ACME/r1": round(300 / 6535, 4), "ACME/r2": 0.0, "ACME/r3": 0.0}
    assert found["waitingShare"] == round(300 / 11565, 4)


def test_waiting_by_cause(shift: Engine) -> None:
    assert report(shift)["waiting"] == [
        {"cause": "waits_turn", "seconds": 180},  # the cause changed at 6:22
        {"cause": "waits_passing", "seconds": 120},
    ]


def test_waiting_by_place(shift: Engine) -> None:
    assert report(shift)["waitingPlaces"] == [{"place": "P-2", "seconds": 300, "robots": 1}]


def test_places_are_sorted_limited_and_only_those_of_waits(
    engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report_queries, "PLACES_LIMIT", 2)
    waits = [  # minute, robot, condition, values
        (0, "A/1", "WAITING", {"reason": "waits_passing", "at": "P-1--P-2"}),
        (3, "A/1", "BUSY", {"reason": "driving", "next": "P-9"}),
        (0, "A/2", "WAITING", {"reason": "waiting_for_release", "place": "P-3", "next": "P-4"}),
        (5, "A/2", "WAITING", {"reason": "waits_other", "why": "no route"}),
        (0, "A/3", "WAITING", {"reason": "waits_turn", "at": "P-1--P-2"}),
        (4, "A/3", "WAITING", {"reason": "waits_peripheral", "at": "Door"}),
        (5, "A/3", "IDLE", {"reason": "idle"}),
    ]
    database.write(
        engine,
        [
            Event(
                SIX + timedelta(minutes=minute), Code.CONDITION, "", robot, values={"condition": to, **values}
            )
            for minute, robot, to, values in sorted(waits, key=lambda each: each[0])
        ],
    )
    assert report(engine, SIX, SIX + timedelta(minutes=10))["waitingPlaces"] == [
        {"place": "P-1--P-2", "seconds": 420, "robots": 2},
        {"place": "P-4", "seconds": 300, "robots": 1},
    ]


def test_distances_and_charges(shift: Engine) -> None:
    figures = {
        robot["robot"]: (robot["distance"], robot["emptyDistance"], robot["charges"], robot["chargeAtStart"])
        for robot in report(shift)["robots"]
    }
    assert figures == {
        "ACME/r1": (65.5, 15.0, 0, None),
        "ACME/r2": (12.0, None, 1, 30.0),  # does not report its loads
        "ACME/r3": (None, None, 0, None),
    }


def test_failures(shift: Engine) -> None:
    rows = [
        (each["kind"], each["robot"] or each["vehicle"], each["cause"], each["level"], each["count"])
        for each in report(shift)["failures"]
    ]
    assert rows[0] == ("error", "ACME/r2", "orderError", "CRITICAL", 2)
    assert sorted(rows[1:], key=str) == [
        ("action", "ACME/r1", "pick", None, 1),
        ("connection", "ACME/r3", "CONNECTION_BROKEN", None, 1),
        ("error", "ACME/r1", "batteryLow", "WARNING", 1),
        ("order", "Vehicle-2", "Wheel lost.", None, 1),
        ("order", None, "No route.", None, 1),
    ]


def test_withdrawn_orders_are_neither_failures_nor_late(engine: Engine) -> None:
    ends = {"WMS-1": ("FAILED", "WITHDRAWN"), "WMS-2": ("FAILED", "GAVE_WAY"), "WMS-3": ("FAILED", "FAILED")}
    database.write(
        engine,
        [
            Event(
                SIX,
                Code.TRANSPORT_ORDER,
                "",
                order=name,
                values={"state": state, "outcome": outcome, "reason": outcome, "late": True},
            )
            for name, (state, outcome) in ends.items()
        ],
    )
    found = report(engine, SIX, SIX + timedelta(hours=1))
    assert (found["orders"]["failed"], found["orders"]["deadlines"]) == (1, 1)
    assert [(each["kind"], each["cause"]) for each in found["failures"]] == [("order", "FAILED")]


def test_history_that_begins_inside_the_range(shift: Engine) -> None:
    found = report(shift, SIX - timedelta(hours=3), SIX)
    assert found["recordedSince"] == "2026-01-01T05:59:00.000Z"
    assert found["recordedSeconds"] == 60
    assert found["orders"]["hours"] == [{"since": "2026-01-01T05:00:00.000Z", "finished": 1, "failed": 0}]
    assert conditions(found)["ACME/r1"] == {"IDLE": 50}


def test_range_whose_run_was_killed_and_restarted_later(shift: Engine) -> None:
    found = report(shift, SIX + timedelta(minutes=47), SIX + timedelta(minutes=57))
    assert found["recordedSeconds"] == 180
    assert conditions(found) == {"ACME/r1": {"IDLE": 180}, "ACME/r2": {"BUSY": 180}}


def test_condition_from_before_the_range_lasts_to_its_end(shift: Engine) -> None:
    found = report(shift, EIGHT, EIGHT + timedelta(hours=1))
    assert conditions(found) == {"ACME/r1": {"IDLE": 3600}, "ACME/r2": {"OFFLINE": 3600}}
    assert [robot["utilisation"] for robot in found["robots"]] == [0.0, None]


def test_empty_history(engine: Engine) -> None:
    found = report(engine)
    assert (found["recordedSince"], found["recordedSeconds"]) == (None, 0)
    assert (found["orders"]["perHour"], found["orders"]["hours"]) == (None, [])


def test_entries_of_earlier_releases_with_nul_are_passed_over(engine: Engine) -> None:
    def row(time: datetime, **values: Any) -> dict[str, Any]:
        details = json.dumps(values)
        stored = database.milliseconds(time)
        return {"time": stored, "code": "errorRaised", "robot": "A/1", "text": "", "details": details}

    with engine.begin() as connection:
        odd = row(SIX, errorType="odd", errorLevel="FATAL", description="\x00")
        fine = row(SIX, errorType="fine", errorLevel="FATAL", description="\\u0001 \U0001f916")
        connection.execute(insert(database.event_table), [odd, fine])
    assert "fine" in [each["cause"] for each in report(engine)["failures"]]


def test_too_many_entries_are_refused(shift: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report_queries, "ENTRIES_LIMIT", 10)
    with pytest.raises(TooManyEntriesError):
        report(shift)
    assert report(shift, EIGHT, EIGHT + timedelta(hours=1))["orders"]["finished"] == 1


def test_failures_are_limited(engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report_queries, "FAILURES_LIMIT", 3)
    errors = [
        Event(SIX, Code.ERROR_RAISED, "", "A/1", values={"errorType": f"e{number}", "errorLevel": "FATAL"})
        for number in (1, 2, 3, 4, 5, 5)
    ]
    database.write(engine, errors)
    assert [each["cause"] for each in report(engine)["failures"]] == ["e5", "e1", "e2"]
