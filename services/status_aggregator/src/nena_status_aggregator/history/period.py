"""Time ranges of the history, and what was last before them."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, Subquery, and_, func, literal, select

from nena_status_aggregator.history.database import EventValues, event_table

BEYOND_ALL = 2**63 - 1


class TooManyEntriesError(Exception):
    """A range has more entries than are read at once; the first argument is their limit."""


@dataclass(frozen=True, slots=True)
class Period:
    """A time range of the history in an open database; ms since 1970."""

    connection: Connection
    since: int
    until: int

    @property
    def values(self) -> EventValues:
        """The values of events."""
        return EventValues(self.connection.dialect, event_table)

    def has_codes(self, *codes: str) -> ColumnElement[bool]:
        """Return the condition for events of these kinds in the range."""
        table = event_table.c
        return and_(table.code.in_(codes), table.time >= self.since, table.time < self.until)

    def holds_many(self, code: str) -> ColumnElement[bool]:
        """Return the condition for a kind that most events in the range have."""
        # Reading all rows in order is faster than finding each by the index of kinds: coalesce avoids it.
        table, begin, end = event_table.c, self._first_id(self.since), self._first_id(self.until)
        return and_(func.coalesce(table.code, "") == code, table.id >= begin, table.id < end)

    def refuse_more_than(self, limit: int, *codes: str) -> None:
        """Raise TooManyEntriesError if the range has more events of these kinds.

        Counts at most one entry more than the limit: the whole range may have many millions.
        """
        entries = select(literal(1).label("one")).where(self.has_codes(*codes)).limit(limit + 1)
        if self.connection.execute(select(func.count()).select_from(entries.subquery())).scalar_one() > limit:
            raise TooManyEntriesError(limit)

    def last_of_robots(self, *codes: str, reach: int | None = None) -> Subquery:
        """Return the ``id`` of the last event of these kinds of each robot before the range (null: none).

        The names of all robots, and the last event of each, are found through the index of robots. With
        ``reach``, ms, older events are not looked for: a robot may have none at all.
        """
        table, past = event_table.c, event_table.alias()
        names = select(func.min(table.robot).label("robot")).cte("names", recursive=True)
        greater = select(func.min(table.robot)).where(table.robot > names.c.robot).scalar_subquery()
        names = names.union_all(select(greater).where(names.c.robot.is_not(None)))
        earliest = 0 if reach is None else self._first_id(self.since - reach)
        last_id = (
            select(past.c.id)
            .where(past.c.robot == names.c.robot, past.c.code.in_(codes))
            .where(past.c.id < self._first_id(self.since), past.c.id >= earliest)
            .order_by(past.c.id.desc())
            .limit(1)
            .scalar_subquery()
        )
        return select(last_id.label("id")).select_from(names).where(names.c.robot.is_not(None)).subquery()

    def _first_id(self, time: int) -> int:
        table = event_table.c
        query = select(table.id).where(table.time >= time).order_by(table.time, table.id).limit(1)
        found = self.connection.execute(query).scalar()
        return BEYOND_ALL if found is None else found
