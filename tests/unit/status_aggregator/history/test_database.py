from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from sqlalchemy import Engine, update

from nena_status_aggregator.fleet.events import Code, Event, Values
from nena_status_aggregator.history import database
from nena_status_aggregator.history.database import HistoryError, HistoryFilter
from support.fleet_examples import START

ALL = HistoryFilter()


def event(second: float, code: Code = Code.CONDITION, **fields: str) -> Event:
    time = START + timedelta(seconds=second)
    return Event(time, code, fields.pop("text", f"at {second}"), **fields, values={"n": second})


def texts(engine: Engine, wanted: HistoryFilter) -> list[str]:
    return [each["text"] for each in database.read_newest(engine, wanted, before=None, limit=100)]


def test_written_events_are_read_newest_first(engine: Engine) -> None:
    database.write(engine, [event(1, robot="A/1", order="TO-1"), event(2.5)])
    newest, oldest = database.read_newest(engine, ALL, before=None, limit=10)
    assert newest["id"] > oldest["id"]
    assert oldest == {
        "id": oldest["id"],
        "time": "2026-01-01T00:00:01.000Z",
        "code": "condition",
        "robot": "A/1",
        "order": "TO-1",
        "text": "at 1",
        "values": {"n": 1},
    }
    assert (newest["time"], newest["robot"]) == ("2026-01-01T00:00:02.500Z", None)


def test_pages_follow_each_other(engine: Engine) -> None:
    database.write(engine, [event(number) for number in range(5)])
    first = database.read_newest(engine, ALL, before=None, limit=2)
    second = database.read_newest(engine, ALL, before=first[-1]["id"], limit=10)
    assert [each["text"] for each in (*first, *second)] == ["at 4", "at 3", "at 2", "at 1", "at 0"]
    end = first[0]["id"]
    oldest = database.read_oldest(engine, ALL, after=0, upto=end - 1, limit=3)
    rest = database.read_oldest(engine, ALL, after=oldest[-1]["id"], upto=end - 1, limit=3)
    assert [each["text"] for each in (*oldest, *rest)] == ["at 0", "at 1", "at 2", "at 3"]


def test_filters(engine: Engine) -> None:
    database.write(
        engine,
        [
            event(0, robot="A/1", order="TO-1", text="zero"),
            event(1, Code.ERROR_RAISED, robot="A/1", text="one"),
            event(2, Code.POSITION, robot="A/1", text="two"),
            event(3, Code.LINK, text="three"),
        ],
    )
    second = START + timedelta(seconds=1)
    assert texts(engine, ALL) == ["three", "one", "zero"]
    assert texts(engine, HistoryFilter(robot="A/1")) == ["one", "zero"]
    assert texts(engine, HistoryFilter(robot="' OR '1'='1")) == []
    assert texts(engine, HistoryFilter(order="TO-1")) == ["zero"]
    assert texts(engine, HistoryFilter(codes=(Code.POSITION, Code.LINK))) == ["three", "two"]
    assert texts(engine, HistoryFilter(since=second)) == ["three", "one"]
    assert texts(engine, HistoryFilter(until=second)) == ["zero"]


def test_filter_by_a_part_of_the_order(engine: Engine) -> None:
    database.write(
        engine, [event(0, order="WMS-1"), event(1, order="wms_2"), event(2, order="TO-1"), event(3)]
    )
    assert texts(engine, HistoryFilter(order_part="wms")) == ["at 1", "at 0"]
    assert texts(engine, HistoryFilter(order_part="s_")) == ["at 1"]


def test_filter_of_problems(engine: Engine) -> None:
    problems: list[tuple[Code, Values]] = [
        (Code.ERROR_RAISED, {"errorType": "e"}),
        (Code.CONDITION, {"condition": "BLOCKED"}),
        (Code.CONDITION, {"condition": "SILENT", "reason": "silent"}),
        (Code.CONNECTION, {"state": None}),
        (Code.ORDER_ENDED, {"outcome": "abandoned"}),
        (Code.ACTION_ENDED, {"status": "FAILED"}),
        (Code.TRANSPORT_ORDER, {"state": "FAILED", "outcome": "FAILED"}),
        (Code.TRANSPORT_ORDER, {"state": "FAILED", "gaveWay": False}),
        (Code.TRANSPORT_ORDER, {"state": "UNROUTABLE"}),
        (Code.LINK, {"connected": False}),
        (Code.HISTORY_GAP, {"dropped": 1}),
    ]
    others: list[tuple[Code, Values]] = [
        (Code.CONDITION, {"condition": "WAITING"}),
        (Code.CONDITION, {"condition": "SILENT", "reason": "expected"}),
        (Code.CONNECTION, {"state": "ONLINE"}),
        (Code.ORDER_ENDED, {"outcome": "completed"}),
        (Code.ACTION_ENDED, {"status": "FINISHED"}),
        (Code.TRANSPORT_ORDER, {"state": "FAILED", "outcome": "WITHDRAWN"}),
        (Code.TRANSPORT_ORDER, {"state": "FAILED", "gaveWay": True}),
        (Code.TRANSPORT_ORDER, {"state": "FINISHED"}),
        (Code.LINK, {"connected": True}),
    ]
    database.write(engine, [Event(START, code, "bad", values=values) for code, values in problems])
    database.write(engine, [Event(START, code, "good", values=values) for code, values in others])
    assert texts(engine, HistoryFilter(problems=True)) == ["bad"] * len(problems)


def test_unusual_texts_are_stored_as_far_as_databases_allow(engine: Engine) -> None:
    odd = "\x00 \U0001f916 'quoted' %s"
    database.write(engine, [event(0, robot="r" * 999, text=odd)])
    (entry,) = database.read_newest(engine, ALL, before=None, limit=1)
    assert entry["text"] == odd.replace("\x00", "\ufffd")
    assert entry["robot"] == "r" * database.ROBOT_LENGTH


def test_old_entries_expire(engine: Engine) -> None:
    track = [event(number, Code.POSITION) for number in range(4)]
    database.write(engine, [*track, *(event(number) for number in range(4))])
    limit = START + timedelta(seconds=2)
    assert database.expire(engine, before=limit, code=Code.POSITION) == 2
    assert texts(engine, HistoryFilter(codes=(Code.POSITION,))) == ["at 3", "at 2"]
    assert texts(engine, ALL) == ["at 3", "at 2", "at 1", "at 0"]
    assert database.expire(engine, before=limit) == 2
    assert database.expire(engine, before=limit) == 0
    assert texts(engine, ALL) == ["at 3", "at 2"]


def test_tables_are_created_once_and_other_versions_refused(engine: Engine) -> None:
    database.write(engine, [event(0)])
    database.prepare(engine)
    assert texts(engine, ALL) == ["at 0"]
    with engine.begin() as connection:
        connection.execute(update(database.schema_version).values(version=99))
    with pytest.raises(HistoryError, match="version 99"):
        database.prepare(engine)


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("history.db", "unusable"),
        ("sqlite://", "has no file name"),
        ("sqlite:///:memory:", "has no file name"),
        ("oracle+nothing://host", "unusable"),
    ],
)
def test_invalid_url_is_refused_with_an_example(url: str, reason: str) -> None:
    with pytest.raises(HistoryError, match=f"{reason}.*sqlite:///nena-history.db"):
        database.make_engine(url)


@pytest.mark.parametrize("end", ["an@secret@127.0.0.1", "an@other:secret@127.0.0.1", "x@127.0.0.1:secret"])
def test_a_password_that_is_written_wrongly_is_not_repeated(end: str) -> None:
    with pytest.raises(HistoryError, match="unusable") as caught:
        database.make_engine(f"postgresql+psycopg://user:{end}/history")
    assert "secret" not in f"{caught.value}{caught.value.__cause__}"


def test_the_tables_are_those_that_a_history_of_today_has() -> None:
    tables = {
        table.name: {column.name: str(column.type) for column in table.columns}
        for table in database.metadata.sorted_tables
    }
    assert tables == {
        "history_schema_version": {"version": "INTEGER"},
        "happenings": {
            "id": "BIGINT",
            "time": "BIGINT",
            "code": "VARCHAR(40)",
            "robot": "VARCHAR(300)",
            "order_name": "VARCHAR(600)",
            "text": "TEXT",
            "details": "TEXT",
        },
    }


def test_texts_in_nested_values_are_stored_without_nul(engine: Engine) -> None:
    """PostgreSQL cannot read JSON with it."""

    def values(text: str) -> dict[str, Any]:
        return {
            "reason": text,
            "codedReason": {"code": "words", "values": {"text": text}, "causes": [{"n": 1}]},
        }

    event = Event(START, Code.TRANSPORT_ORDER, "ended", values=values("a\0b"))
    database.write(engine, [event])
    (found,) = database.read_newest(engine, ALL, before=None, limit=1)
    assert found["values"] == values("a\ufffdb")
