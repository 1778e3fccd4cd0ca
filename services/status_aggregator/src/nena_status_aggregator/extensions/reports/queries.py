"""Queries of reports: blocking functions, whose sums are computed by the database.

A report reads at most ENTRIES_LIMIT entries; the rest of the history is reached only through its indexes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from math import ceil
from typing import Any

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Engine,
    Select,
    Subquery,
    Text,
    and_,
    case,
    cast,
    func,
    literal,
    null,
    select,
    union_all,
)

from nena_shared.fleet_api.transport_order import OrderOutcome, TransportOrderState
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.connection import ConnectionState
from nena_status_aggregator.extensions.reports.report import (
    HOUR,
    WAITING,
    WORKING,
    FailureFigures,
    FailureKind,
    HourFigures,
    Link,
    OrderFigures,
    Outage,
    PlaceFigures,
    Report,
    RobotFigures,
    WaitFigures,
    find_outages,
    share_in_service,
)
from nena_status_aggregator.fleet.condition import Condition
from nena_status_aggregator.fleet.events import Code
from nena_status_aggregator.history.database import event_table, iso_of
from nena_status_aggregator.history.period import Period

LONGEST_RANGE = timedelta(days=31, hours=1)
"""A month of local days, of which one may have 25 hours."""

ENTRIES_LIMIT = 1_000_000
"""Maximum number of entries that a report reads."""

FAILURES_LIMIT = 100
"""Maximum number of rows per kind of failure."""

PLACES_LIMIT = 1000
"""Maximum number of places for which robots waited."""

CONDITION_CODES = (Code.CONDITION.value, Code.ROBOT_FORGOTTEN.value)
"""Events that end the previous condition of a robot."""

CODES = tuple(
    code.value
    for code in (
        Code.CONDITION,
        Code.ROBOT_FORGOTTEN,
        Code.TRANSPORT_ORDER,
        Code.ORDER_ENDED,
        Code.ACTION_ENDED,
        Code.ERROR_RAISED,
        Code.CHARGING,
        Code.CONNECTION,
        Code.LINK,
        Code.HISTORY_GAP,
    )
)
"""Events that a report reads."""

FINAL = tuple(state.value for state in TransportOrderState if state.final)
NO_FAILURE = (OrderOutcome.WITHDRAWN.value, OrderOutcome.GAVE_WAY.value)
NOT_FINISHED = tuple(state for state in FINAL if state != TransportOrderState.FINISHED)


def compute_report(engine: Engine, since: int, until: int) -> Report:
    """Compute the report of a time range, ms since 1970.

    Raises:
        TooManyEntriesError: the range has too many entries.
        SQLAlchemyError: the database is unavailable.
    """
    with engine.connect() as connection:
        period = Period(connection, since, until)
        period.refuse_more_than(ENTRIES_LIMIT, *CODES)
        # The history begins with its oldest entry; None: no part of it is in the range.
        oldest = connection.execute(select(func.min(event_table.c.time))).scalar()
        begin = None if oldest is None or oldest >= until else max(since, int(oldest))
        down = find_outages(_connection_changes(period), until)
        recorded = 0 if begin is None else until - begin - sum(outage.within(begin, until) for outage in down)
        robots, waits = _figures_by_robot(period, down)
        dropped = select(func.sum(period.values.number("dropped"))).where(
            period.has_codes(Code.HISTORY_GAP.value)
        )
        total: dict[str, float] = defaultdict(float)
        for robot in robots:
            for condition, seconds in robot["conditions"].items():
                total[condition] += seconds
        return {
            "since": iso_of(since),
            "until": iso_of(until),
            "recordedSince": None if begin is None else iso_of(begin),
            "recordedSeconds": max(0, recorded) / 1000,
            "missing": int(connection.execute(dropped).scalar() or 0),
            "orders": _order_figures(period, begin, max(0, recorded)),
            "utilisation": share_in_service(WORKING, total),
            "waitingShare": share_in_service(WAITING, total),
            "robots": robots,
            "waiting": waits.by_cause(),
            "waitingPlaces": waits.by_place(),
            "failures": _failures_by_cause(period),
        }


def _connection_changes(period: Period) -> list[Link]:
    """Return the connection changes in the range, the last one before it and the first one after it."""
    table, earlier = event_table.c, event_table.alias()
    previous = select(earlier.c.time).where(earlier.c.id < table.id).order_by(earlier.c.id.desc()).limit(1)
    values = period.values
    query = select(
        table.time,
        values.truth("connected").label("connected"),
        values.truth("started").label("started"),
        previous.scalar_subquery().label("before"),
    ).where(table.code == Code.LINK.value)
    earlier_change = (
        query.where(table.time < period.since).order_by(table.time.desc(), table.id.desc()).limit(1)
    )
    inside = query.where(table.time >= period.since, table.time < period.until)
    later_change = query.where(table.time >= period.until).order_by(table.time, table.id).limit(1)
    rows = [
        row
        for part in (earlier_change, inside.order_by(table.time, table.id), later_change)
        for row in period.connection.execute(part)
    ]
    return [Link(row.time, bool(row.connected), bool(row.started), row.before) for row in rows]


@dataclass(slots=True)
class Waits:
    """The time that robots waited, by cause and by place, ms."""

    causes: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    places: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    robots: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))
    """Robots that waited, by place."""

    def add_wait(self, robot: str, cause: str, place: str | None, spent: int) -> None:
        """Count a wait."""
        self.causes[cause] += spent
        if place is not None and spent:
            self.places[place] += spent
            self.robots[place].add(robot)

    def by_cause(self) -> list[WaitFigures]:
        """Return the times by cause, longest first."""
        return [{"cause": cause, "seconds": spent / 1000} for cause, spent in _longest_first(self.causes)]

    def by_place(self) -> list[PlaceFigures]:
        """Return the longest times by place, longest first."""
        return [
            {"place": place, "seconds": spent / 1000, "robots": len(self.robots[place])}
            for place, spent in _longest_first(self.places)[:PLACES_LIMIT]
        ]


def _longest_first(times: dict[str, int]) -> list[tuple[str, int]]:
    return sorted(times.items(), key=lambda item: -item[1])


def _figures_by_robot(period: Period, down: Sequence[Outage]) -> tuple[list[RobotFigures], Waits]:
    conditions: dict[str, dict[str, float]] = defaultdict(dict)
    waits = Waits()
    spent = _time_spent(period, down)
    waiting = spent.c.condition == Condition.WAITING.value
    cause, place = (case((waiting, column)).label(column.name) for column in (spent.c.cause, spent.c.place))
    split = select(spent.c.robot, spent.c.condition, cause, place, spent.c.spent).subquery()
    groups = split.c.robot, split.c.condition, split.c.cause, split.c.place
    query = select(*groups, func.sum(split.c.spent)).group_by(*groups)
    for robot, condition, cause_code, place_name, total in period.connection.execute(query):
        seconds = int(total) / 1000
        conditions[robot][condition] = round(conditions[robot].get(condition, 0.0) + seconds, 3)
        if condition == Condition.WAITING:
            waits.add_wait(robot, cause_code, place_name, int(total))
    distances, charges = _distances_by_robot(period), _charges_by_robot(period)
    robots = [
        _robot_figures(name, conditions.get(name, {}), distances.get(name), charges.get(name))
        for name in sorted({*conditions, *distances, *charges})
    ]
    return robots, waits


def _robot_figures(
    name: str,
    conditions: dict[str, float],
    distances: tuple[float | None, float | None] | None,
    charges: tuple[int, float | None] | None,
) -> RobotFigures:
    distance, empty = distances or (None, None)
    count, at_start = charges or (0, None)
    return {
        "robot": name,
        "conditions": dict(sorted(conditions.items())),
        "utilisation": share_in_service(WORKING, conditions),
        "waitingShare": share_in_service(WAITING, conditions),
        "distance": distance,
        "emptyDistance": empty,
        "charges": count,
        "chargeAtStart": at_start,
    }


def _condition_changes(period: Period) -> Subquery:
    """Return the changes of conditions: the last one of each robot before the range, and those in it."""
    table, values = event_table.c, period.values
    last = period.last_of_robots(*CONDITION_CODES)
    columns = (
        table.id,
        table.robot,
        table.time,
        values.text("condition").label("condition"),
        values.text("reason").label("cause"),
        func.coalesce(values.text("at"), values.text("next")).label("place"),  # next: waiting for its release
    )
    # Without the change before the range, a robot that stands all day would have no condition in it.
    earlier = select(*columns).join(last, last.c.id == table.id)
    return union_all(earlier, select(*columns).where(period.has_codes(*CONDITION_CODES))).subquery("changes")


def _time_spent(period: Period, down: Sequence[Outage]) -> Subquery:
    """Return the parts of the range that robots spent in a condition, without outages: ``spent``, ms.

    ``up`` is a time without the outages before it, so that a difference of two has none. The cost does not
    depend on the number of outages.
    """
    placed = _place_outages(_condition_changes(period), down)
    robots: dict[str, Any] = {"partition_by": placed.c.robot, "order_by": placed.c.id}
    steps = select(
        placed,
        func.lead(placed.c.time).over(**robots).label("next_time"),
        func.lead(placed.c.up).over(**robots).label("next_up"),
    ).subquery("steps")

    def up_time(time: int) -> int:
        return time - sum(outage.within(outage.begin, time) for outage in down)

    columns = steps.c
    begin, end = _limit_to_range(
        columns.time, (columns.next_time, columns.cut_time), period.since, period.until
    )
    begin_up, end_up = _limit_to_range(
        columns.up, (columns.next_up, columns.cut_up), up_time(period.since), up_time(period.until)
    )
    has_condition = and_(columns.condition.is_not(None), end > begin)
    parts = select(
        columns.robot, columns.condition, columns.cause, columns.place, (end_up - begin_up).label("spent")
    )
    return parts.where(has_condition).subquery("spent")


def _limit_to_range(
    begin: ColumnElement[Any], ends: Sequence[ColumnElement[Any]], since: int, until: int
) -> tuple[ColumnElement[Any], ColumnElement[Any]]:
    """Return the begin and the first end (null: none), both within the range."""
    first: ColumnElement[Any] = literal(since, BigInteger)
    last: ColumnElement[Any] = literal(until, BigInteger)
    for end in ends:
        # SQLite names the lesser of two min, PostgreSQL least; both know case.
        last = case((end < last, end), else_=last)  # a null end is not less
    return case((begin > first, begin), else_=first), last


def _place_outages(changes: Subquery, down: Sequence[Outage]) -> Subquery:
    """Return changes with their ``up``, and where the first restart after them cuts them off."""
    columns = ("id", "robot", "time", "condition", "cause", "place")
    marks: list[list[ColumnElement[Any]]] = []
    lost = 0
    for outage in sorted(down, key=lambda outage: (outage.begin, outage.end)):
        begin, end = outage.begin, outage.end
        # A restarted aggregator does not know the conditions of before; they end where it was stopped.
        cut = (begin, begin - lost) if outage.restart else (None, None)
        marks += [_outage_mark(begin, -begin, 1), _outage_mark(end, end, -1, *cut)]
        lost += end - begin
    rows = union_all(
        select(*(changes.c[name] for name in columns), *_mark_values(1)), *(select(*mark) for mark in marks)
    ).subquery("rows")
    order: dict[str, Any] = {"order_by": (rows.c.time, rows.c.kind)}
    lost_before = func.sum(rows.c.moved).over(rows=(None, 0), **order)
    lost_now = func.sum(rows.c.opened).over(rows=(None, 0), **order) * rows.c.time
    return select(
        *(rows.c[name] for name in columns),
        (rows.c.time - lost_before - lost_now).label("up"),
        func.min(rows.c.cut_time).over(rows=(0, None), **order).label("cut_time"),
        func.min(rows.c.cut_up).over(rows=(0, None), **order).label("cut_up"),
    ).subquery("placed")


def _outage_mark(
    time: int, moved: int, opened: int, cut_time: int | None = None, cut_up: int | None = None
) -> list[ColumnElement[Any]]:
    """Return a row at the begin or end of an outage; it comes before changes at the same time."""
    nothing: tuple[Any, ...] = (BigInteger, Text, BigInteger, Text, Text, Text)
    names = ("id", "robot", "time", "condition", "cause", "place")
    empty: list[ColumnElement[Any]] = [
        cast(null(), kind).label(name) for kind, name in zip(nothing, names, strict=True)
    ]
    empty[2] = literal(time, BigInteger).label("time")
    return [*empty, *_mark_values(0, moved, opened, cut_time, cut_up)]


def _mark_values(
    kind: int, moved: int = 0, opened: int = 0, cut_time: int | None = None, cut_up: int | None = None
) -> list[ColumnElement[Any]]:
    """Return what a row adds to the time lost before it: ``moved`` + ``opened`` x time, ms."""
    values = {"kind": kind, "moved": moved, "opened": opened, "cut_time": cut_time, "cut_up": cut_up}
    return [cast(literal(value, BigInteger), BigInteger).label(name) for name, value in values.items()]


def _distances_by_robot(period: Period) -> dict[str, tuple[float | None, float | None]]:
    """Return the distance of each robot's ended orders and its part without a load, m."""
    robot, values = event_table.c.robot, period.values
    trips = select(
        robot, values.number("distance").label("distance"), values.number("emptyDistance").label("empty")
    )
    part = trips.where(period.has_codes(Code.ORDER_ENDED.value)).subquery()
    distance, empty = part.c.distance, part.c.empty
    query = select(
        part.c.robot, func.sum(distance), case((func.count(empty) == func.count(distance), func.sum(empty)))
    ).group_by(part.c.robot)
    return {
        name: (_round_value(total), _round_value(without))
        for name, total, without in period.connection.execute(query)
    }


def _charges_by_robot(period: Period) -> dict[str, tuple[int, float | None]]:
    """Return how often each robot started to charge, and its mean charge then, percent."""
    values = period.values
    begun = period.has_codes(Code.CHARGING.value), values.truth("charging") == 1
    part = select(event_table.c.robot, values.number("charge").label("charge")).where(*begun).subquery()
    query = select(part.c.robot, func.count(), func.avg(part.c.charge)).group_by(part.c.robot)
    return {name: (count, _round_value(charge)) for name, count, charge in period.connection.execute(query)}


def _round_value(value: float | None) -> float | None:
    return None if value is None else round(float(value), 2)


def _ended_orders(period: Period) -> Subquery:
    """Return the orders that ended in the range, each once.

    Parking, recharging, and orders that were withdrawn or gave way to another one are left out.
    """
    table, values = event_table.c, period.values
    events = (
        select(
            table.id,
            table.order_name,
            table.time,
            values.text("state").label("state"),
            values.text("before").label("before"),
            values.text("reason").label("reason"),
            values.text("vehicle").label("vehicle"),
            values.number("leadTime").label("lead"),
            values.truth("late").label("late"),
            values.truth("automatic").label("automatic"),
            values.text("outcome").label("outcome"),
            values.truth("gaveWay").label("gave_way"),
        )
        .where(period.has_codes(Code.TRANSPORT_ORDER.value))
        .subquery("order_events")
    )
    repetition = func.row_number().over(partition_by=events.c.order_name, order_by=events.c.id)
    ends = (
        select(events, repetition.label("repetition"))
        .where(events.c.state.in_(FINAL), func.coalesce(events.c.before, "").not_in(FINAL))
        .where(
            func.coalesce(events.c.automatic, 0) == 0,
            func.coalesce(events.c.outcome, "").not_in(NO_FAILURE),
            func.coalesce(events.c.gave_way, 0) == 0,  # events of earlier releases have no outcome
        )
        .subquery("ends")
    )
    return select(ends).where(ends.c.repetition == 1).subquery("orders")


def _order_figures(period: Period, begin: int | None, recorded: int) -> OrderFigures:
    orders = _ended_orders(period)
    done = orders.c.state == TransportOrderState.FINISHED.value
    counts = select(
        func.count(case((done, 1))),
        func.count(case((orders.c.state.in_(NOT_FINISHED), 1))),
        func.count(case((done, orders.c.lead))),
        func.count(orders.c.late),
        func.count(case((and_(done, orders.c.late == 0), 1))),
    )
    finished, failed, timed, deadlines, on_time = period.connection.execute(counts).one()
    leads = select(orders.c.lead).where(done, orders.c.lead.is_not(None)).order_by(orders.c.lead)
    return {
        "finished": finished,
        "failed": failed,
        "perHour": round(finished * HOUR / recorded, 2) if recorded else None,
        "leadTimes": timed,
        "leadTimeP50": _percentile_of(period, leads, timed, 50),
        "leadTimeP95": _percentile_of(period, leads, timed, 95),
        "deadlines": deadlines,
        "onTime": on_time,
        "hours": [] if begin is None else _figures_by_hour(period, orders, begin),
    }


def _percentile_of(period: Period, ascending: Select[Any], number: int, percent: int) -> float | None:
    """Return a percentile of ``number`` values, by the nearest rank."""
    if not number:
        return None
    rank = ceil(number * percent / 100)
    return _round_value(period.connection.execute(ascending.limit(1).offset(rank - 1)).scalar())


def _figures_by_hour(period: Period, orders: Subquery, begin: int) -> list[HourFigures]:
    """Return the hours of the range, counted from its start, beginning with the first recorded one."""
    hour = ((orders.c.time - period.since) // HOUR).label("hour")
    done = case((orders.c.state == TransportOrderState.FINISHED.value, 1), else_=0).label("done")
    ended = select(hour, done).subquery()
    query = select(ended.c.hour, func.sum(ended.c.done), func.count()).group_by(ended.c.hour)
    counted = {
        int(number): (int(ok), count - int(ok)) for number, ok, count in period.connection.execute(query)
    }
    hours: list[HourFigures] = []
    for number in range((begin - period.since) // HOUR, ceil((period.until - period.since) / HOUR)):
        finished, failed = counted.get(number, (0, 0))
        start = iso_of(period.since + number * HOUR)
        hours.append({"since": start, "finished": finished, "failed": failed})
    return hours


def _failures_by_cause(period: Period) -> list[FailureFigures]:
    table, values, orders = event_table.c, period.values, _ended_orders(period)
    status, state = values.text("status"), values.text("state")
    action = func.coalesce(values.text("actionType"), values.text("actionId"))
    errors = period.has_codes(Code.ERROR_RAISED.value)
    actions = period.has_codes(Code.ACTION_ENDED.value), status == ActionStatus.FAILED.value
    connections = period.has_codes(Code.CONNECTION.value), state == ConnectionState.CONNECTION_BROKEN.value
    parts = {
        FailureKind.ERROR: _select_failures(
            values.text("errorType"), robot=table.robot, level=values.text("errorLevel")
        ).where(errors),
        FailureKind.ACTION: _select_failures(action, robot=table.robot).where(*actions),
        FailureKind.CONNECTION: _select_failures(state, robot=table.robot).where(*connections),
        FailureKind.ORDER: _select_failures(orders.c.reason, vehicle=orders.c.vehicle).where(
            orders.c.state.in_(NOT_FINISHED)
        ),
    }
    failures = [row for kind, part in parts.items() for row in _most_frequent(period, kind, part)]
    return sorted(failures, key=lambda failure: -failure["count"])


def _select_failures(
    cause: ColumnElement[Any],
    *,
    robot: ColumnElement[Any] | None = None,
    vehicle: ColumnElement[Any] | None = None,
    level: ColumnElement[Any] | None = None,
) -> Select[Any]:
    """Select failures; what is not given is null."""
    columns = {"robot": robot, "vehicle": vehicle, "cause": cause, "level": level}
    return select(
        *(
            cast(null(), Text).label(name) if column is None else column.label(name)
            for name, column in columns.items()
        )
    )


def _most_frequent(period: Period, kind: FailureKind, part: Select[Any]) -> list[FailureFigures]:
    rows = part.subquery()
    groups = rows.c.robot, rows.c.vehicle, rows.c.cause, rows.c.level
    count = func.count()
    query = select(*groups, count).group_by(*groups).order_by(count.desc(), *groups).limit(FAILURES_LIMIT)
    return [
        {
            "kind": kind,
            "robot": robot,
            "vehicle": vehicle,
            "cause": cause or "",
            "level": level,
            "count": times,
        }
        for robot, vehicle, cause, level, times in period.connection.execute(query)
    ]
