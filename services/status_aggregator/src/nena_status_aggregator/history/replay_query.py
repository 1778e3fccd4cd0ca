"""The query of a replay: a blocking function, whose positions are thinned by the database."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from typing import Any

from sqlalchemy import Engine, Integer, Select, cast, func, select

from nena_status_aggregator.fleet.events import Code
from nena_status_aggregator.history.database import event_table, iso_of
from nena_status_aggregator.history.period import Period
from nena_status_aggregator.history.replay import Replay, Track, step_of

LONGEST_REPLAY = timedelta(days=1, hours=1)
"""A local day, which may have 25 hours."""

ENTRIES_LIMIT = 10_000_000
"""Maximum number of entries that a replay reads."""

REACH = 2 * 24 * 3600 * 1000
"""Time before the range in which the last position and loads of a robot are looked for, ms."""

CONDITIONS = (Code.CONDITION.value, Code.ROBOT_FORGOTTEN.value)
POSITION, LOADS = Code.POSITION.value, Code.LOADS.value


def read_replay(engine: Engine, since: int, until: int) -> Replay:
    """Read the replay of a time range, ms since 1970.

    Raises:
        TooManyEntriesError: the range has too many entries.
        SQLAlchemyError: the database is unavailable.

    """
    with engine.connect() as connection:
        period = Period(connection, since, until)
        period.refuse_more_than(ENTRIES_LIMIT, *CONDITIONS, POSITION, LOADS)
        last = period.last_of_robots(*CONDITIONS)
        robots = connection.execute(select(func.count()).select_from(last)).scalar_one()
        step = step_of(until - since, robots)
        tracks: dict[str, Track] = {}

        def track(robot: str) -> Track:
            return tracks.get(robot) or tracks.setdefault(robot, Track(robot, since))

        for robot, time, code, condition, reason, before, loads in _read_changes(period):
            if code == LOADS:
                track(robot).add_loads(time, int(loads or 0))
            else:
                track(robot).add_condition(time, condition, reason, before)
        for robot, time, x, y, theta in connection.execute(_select_positions(period, step)):
            track(robot).add_position(time, x, y, theta)
        positions = select(func.min(event_table.c.time)).where(event_table.c.code == POSITION)
        begin = connection.execute(positions).scalar()
        return {
            "since": iso_of(since),
            "until": iso_of(until),
            "recordedSince": None if begin is None else iso_of(int(begin)),
            "step": step / 1000,
            "robots": [tracks[name].replay for name in sorted(tracks)],
        }


def _read_changes(period: Period) -> Iterator[Any]:
    """Read the changes of conditions and loads: the last ones before the range, then those in it."""
    table, values = event_table.c, period.values
    texts = (values.text(name) for name in ("condition", "reason", "before"))
    changes = select(table.robot, table.time, table.code, *texts, values.number("loads"))
    last = period.last_of_robots(*CONDITIONS), period.last_of_robots(LOADS, reach=REACH)
    for each in last:
        yield from period.connection.execute(changes.join_from(each, event_table, each.c.id == table.id))
    inside = changes.where(period.has_codes(*CONDITIONS, LOADS))
    yield from period.connection.execute(inside.order_by(table.id))


def _select_positions(period: Period, step: int) -> Select[Any]:
    """Return the last position of each robot before the range, and one for each step in it."""
    table, values = event_table.c, period.values
    last = select(period.last_of_robots(POSITION, reach=REACH).c.id)
    thinned = (
        select(func.max(table.id).label("id"))
        .where(period.has_codes(POSITION))
        .group_by(table.robot, table.time // step)
    )
    chosen = last.union_all(thinned).subquery()
    hundredths = (cast(func.round(100 * values.number(name)), Integer) for name in ("x", "y", "theta"))
    return (
        select(table.robot, table.time, *hundredths)
        .join_from(chosen, event_table, chosen.c.id == table.id)
        .order_by(table.id)
    )
