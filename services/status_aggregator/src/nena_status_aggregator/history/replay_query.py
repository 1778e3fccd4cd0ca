"""The query of a replay: a blocking function, whose positions are thinned by the database."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from typing import Any

from pydantic_core import from_json
from sqlalchemy import Engine, Select, func, select

from nena_status_aggregator.fleet.events import Code
from nena_status_aggregator.history.database import event_table, iso_of
from nena_status_aggregator.history.period import Period
from nena_status_aggregator.history.replay import TENTH, Replay, StopReplay, Track, step_of

LONGEST_REPLAY = timedelta(days=1, hours=1)
"""A local day, which may have 25 hours."""

ENTRIES_LIMIT = 10_000_000
"""Maximum number of entries that a replay reads."""

REACH = 2 * 24 * 3600 * 1000
"""Time before the range in which the last position and loads of a robot are looked for, ms."""

CONDITIONS = (Code.CONDITION.value, Code.ROBOT_FORGOTTEN.value)
POSITION, LOADS, JAM = Code.POSITION.value, Code.LOADS.value, Code.JAM.value


def read_replay(engine: Engine, since: int, until: int) -> Replay:
    """Read the replay of a time range, ms since 1970.

    Raises:
        TooManyEntriesError: the range has too many entries.
        SQLAlchemyError: the database is unavailable.
    """
    with engine.connect() as connection:
        period = Period(connection, since, until)
        period.refuse_more_than(ENTRIES_LIMIT, *CONDITIONS, POSITION, LOADS, JAM)
        last = period.last_of_robots(*CONDITIONS)
        robots = connection.execute(select(func.count()).select_from(last)).scalar_one()
        step = step_of(until - since, robots)
        tracks: dict[str, Track] = {}

        def track(robot: str) -> Track:
            return tracks.get(robot) or tracks.setdefault(robot, Track(robot, since))

        stops, starts = _read_stops(period)
        for robot, time, code, details in _read_changes(period):
            while starts and starts[0] <= time:  # it has forgotten its jams
                for each in tracks.values():
                    each.add_change(starts[0], JAM, {})
                del starts[0]
            track(robot).add_change(time, code, from_json(details))
        for robot, time, details in connection.execute(_select_positions(period, step)):
            track(robot).add_position(time, from_json(details))
        positions = select(func.min(event_table.c.time)).where(event_table.c.code == POSITION)
        begin = connection.execute(positions).scalar()
        return {
            "since": iso_of(since),
            "until": iso_of(until),
            "recordedSince": None if begin is None else iso_of(int(begin)),
            "step": step / 1000,
            "robots": [tracks[name].replay for name in sorted(tracks)],
            "stops": stops,
        }


def _read_changes(period: Period) -> Iterator[Any]:
    """Read the changes of conditions and loads: the last ones before the range, then those in it."""
    table = event_table.c
    changes = select(table.robot, table.time, table.code, table.details)
    of_loads, of_jams = (period.last_of_robots(code, reach=REACH) for code in (LOADS, JAM))
    for each in (period.last_of_robots(*CONDITIONS), of_loads, of_jams):
        yield from period.connection.execute(changes.join_from(each, event_table, each.c.id == table.id))
    inside = changes.where(period.has_codes(*CONDITIONS, LOADS, JAM))
    yield from period.connection.execute(inside.order_by(table.id))


def _read_stops(period: Period) -> tuple[list[StopReplay], list[int]]:
    """Return the stops of areas in the range, and the times at which the aggregator was started, ms."""
    table = event_table.c
    rows = (
        select(table.time, table.details)
        .where(table.code.in_((Code.STOP.value, Code.LINK.value)))
        .where(table.time >= period.since - REACH, table.time < period.until)
    )
    active: dict[str, StopReplay] = {}
    found: list[StopReplay] = []
    starts: list[int] = []
    for time, details in period.connection.execute(rows.order_by(table.id)):
        values, tenths = from_json(details), max(0, time - period.since) // TENTH
        ended = [*active] if values.get("started") else [] if values.get("active") else [values.get("stop")]
        for stop in (active.pop(name) for name in ended if name in active):
            stop["end"] = tenths
        if values.get("started"):
            starts.append(time)
        elif values.get("active") and "xMin" in values:
            area = {key: values[key] for key in ("xMin", "yMin", "xMax", "yMax")}
            active[values["stop"]] = {"begin": tenths, "end": None, "area": area}
            found.append(active[values["stop"]])
    return [stop for stop in found if stop["end"] != 0], starts


def _select_positions(period: Period, step: int) -> Select[Any]:
    """Return the last position of each robot before the range, and one for each step in it."""
    table = event_table.c
    last = select(period.last_of_robots(POSITION, reach=REACH).c.id)
    inside = period.holds_many(POSITION)
    thinned = select(func.max(table.id).label("id")).where(inside).group_by(table.time // step, table.robot)
    # SQLite takes half of the time for this that it takes for a join with the chosen ones.
    chosen = table.id.in_(last.union_all(thinned))
    return select(table.robot, table.time, table.details).where(chosen).order_by(table.id)
