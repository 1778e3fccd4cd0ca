"""The replay as it is read from a database."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import Engine

from nena_status_aggregator.fleet.events import Code, Event, Values
from nena_status_aggregator.history import database, replay_query
from nena_status_aggregator.history.period import TooManyEntriesError
from nena_status_aggregator.history.replay import Replay
from nena_status_aggregator.history.replay_query import read_replay
from support.fleet_examples import START

SINCE = database.milliseconds(START)


def event(second: float, code: Code, robot: str = "A/1", **values: str | float | None) -> Event:
    held: Values = dict(values)
    return Event(START + timedelta(seconds=second), code, "", robot, values=held)


def place(second: float, x: float, robot: str = "A/1") -> Event:
    return event(second, Code.POSITION, robot, x=x, y=0.5, theta=1.0, mapId="hall")


def replay(engine: Engine, seconds: float) -> Replay:
    return read_replay(engine, SINCE, SINCE + round(1000 * seconds))


def test_replay_begins_with_what_was_before_it(engine: Engine) -> None:
    was = [place(-100, 3), event(-90, Code.CONDITION, condition="ERROR", reason="error", before="BUSY")]
    then = [event(5, Code.LOADS, loads=1), place(20, 4), place(30, 9)]
    database.write(engine, [*was, event(-80, Code.ROBOT_FORGOTTEN, "A/2"), *then])
    found = replay(engine, 25)
    (robot,) = (each for each in found["robots"] if each["looks"])
    assert robot == {
        "robot": "A/1",
        "times": [0, 200],
        "x": [300, 100],
        "y": [50, 0],
        "theta": [100, 100],
        "looks": [(0, "BUSY", False, 0, 0), (0, "ERROR", True, 0, 0), (50, "ERROR", True, 1, 0)],
    }
    assert found["recordedSince"] == "2025-12-31T23:58:20.000Z"


def test_jams_and_stopped_areas_are_replayed_until_their_end_or_a_restart(engine: Engine) -> None:
    area = {"xMin": 1.0, "yMin": 2.0, "xMax": 3.0, "yMax": 4.0}

    def stop(second: float, name: str, *, active: bool, **more: float) -> Event:
        return event(second, Code.STOP, "", stop=name, active=active, by="Anna", reason="oil", **more)

    restart = event(30, Code.LINK, "", connected=True, started=True)
    condition = event(-90, Code.CONDITION, condition="ERROR", reason="error")
    jams = [event(-70, Code.JAM, robots=9), event(10, Code.JAM, robots=12), event(40, Code.JAM, robots=5)]
    stops = [
        stop(-60, "old", active=True, **area),
        stop(-50, "old", active=False),
        stop(-40, "S-1", active=True, **area),
        stop(5, "everywhere", active=True),
        stop(20, "S-1", active=False),
        stop(25, "S-2", active=True, **area),
        stop(45, "S-3", active=True, **area),
    ]
    events = sorted([condition, *jams, *stops, restart], key=lambda each: each.time)
    database.write(engine, [dataclasses.replace(each, robot=each.robot or None) for each in events])
    found = replay(engine, 60)
    (robot,) = (each for each in found["robots"] if each["looks"])
    assert [(look[0], look[4]) for look in robot["looks"]] == [(0, 0), (0, 9), (100, 12), (300, 0), (400, 5)]
    shown = [(each["begin"], each["end"]) for each in found["stops"]]
    assert shown == [(0, 200), (250, 300), (450, None)]
    assert found["stops"][0]["area"] == area


def test_positions_are_thinned_to_the_last_one_of_each_step(
    engine: Engine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nena_status_aggregator.history.replay.POSITIONS_LIMIT", 10)
    database.write(
        engine, [place(second, second, robot) for second in range(100) for robot in ("A/1", "B/2")]
    )
    found = replay(engine, 100)
    assert found["step"] == 20
    assert [robot["times"] for robot in found["robots"]] == [[190, 200, 200, 200, 200]] * 2
    assert [sum(robot["x"]) for robot in found["robots"]] == [9_900] * 2


def test_too_many_entries_are_refused(engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_query, "ENTRIES_LIMIT", 10)
    database.write(engine, [place(second, second) for second in range(20)])
    with pytest.raises(TooManyEntriesError):
        replay(engine, 15)
    assert len(replay(engine, 10)["robots"]) == 1


def shift(hours: float, robots: int) -> Iterator[Event]:
    """Yield a shift of robots that drive a metre per second, with a new condition each half minute."""
    for second in range(round(hours * 3600)):
        for number in range(robots):
            robot = f"ACME/r{number}"
            if second % 30 == 0:
                waits = second % 60 == 0
                told = (
                    {"condition": "WAITING", "reason": "waits_turn", "at": "A"}
                    if waits
                    else {"condition": "BUSY"}
                )
                yield event(second, Code.CONDITION, robot, **told)
            yield place(second, second % 100, robot)


@pytest.mark.parametrize(
    ("hours", "robots"), [(0.25, 10), pytest.param(8, 50, marks=pytest.mark.long)], ids=["short", "shift"]
)
def test_reading_a_shift_takes_little_more_than_reading_its_positions(
    tmp_path: Path, hours: float, robots: int
) -> None:
    """The yardstick is what any replay has to do: read the rows of all positions once."""
    engine = database.make_engine(f"sqlite:///{tmp_path}/history.db")
    database.prepare(engine)
    database.write(engine, list(shift(hours, robots)))
    begin = time.process_time()
    with engine.connect() as connection:
        query = "SELECT robot, time, details FROM happenings WHERE code = 'position'"
        connection.exec_driver_sql(query).all()
    yardstick = time.process_time() - begin
    begin = time.process_time()
    found = replay(engine, hours * 3600)
    spent = time.process_time() - begin
    engine.dispose()
    thinned = sum(len(robot["times"]) for robot in found["robots"])
    assert thinned <= 250_000
    assert spent < 5 * yardstick + 0.1, f"{spent:.2f} s, yardstick {yardstick:.2f} s"
