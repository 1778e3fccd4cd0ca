"""Reports: figures of robots and orders over a time range, and their CSV form."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from io import StringIO
from typing import NamedTuple

from typing_extensions import TypedDict

from nena_shared.csv_cells import harmless

HOUR = 3_600_000
"""ms."""

WORKING = "BUSY"
"""Condition that counts as utilisation."""
WAITING = "WAITING"
AWAY = "OFFLINE"
"""Condition that does not count as time in service."""


class FailureKind(StrEnum):
    """Kinds of failures in a report."""

    ERROR = "error"
    """The robot reported an error."""
    ACTION = "action"
    """An action of the robot failed."""
    CONNECTION = "connection"
    """The robot's connection broke."""
    ORDER = "order"
    """A transport order failed, or had no route."""


class HourFigures(TypedDict):
    """Orders that ended in an hour; ``since`` is its start."""

    since: str
    finished: int
    failed: int


class OrderFigures(TypedDict):
    """Transport orders that ended, without parking, recharging and withdrawn ones."""

    finished: int
    failed: int
    """FAILED or UNROUTABLE."""
    perHour: float | None
    """Finished orders per recorded hour; null: nothing recorded."""
    leadTimes: int
    """Number of finished orders with a recorded lead time."""
    leadTimeP50: float | None
    """Seconds from creation to end, nearest rank."""
    leadTimeP95: float | None
    deadlines: int
    """Ended orders with a deadline."""
    onTime: int
    """Those that finished before it."""
    hours: list[HourFigures]


class RobotFigures(TypedDict):
    """Figures of a robot."""

    robot: str
    conditions: dict[str, float]
    """Seconds in each condition."""
    utilisation: float | None
    """BUSY as a share of the time not OFFLINE, 0 to 1; null: never in service."""
    waitingShare: float | None
    """WAITING as a share of the same time."""
    distance: float | None
    """Distance of its ended orders, m; null: not recorded."""
    emptyDistance: float | None
    """The part without a load, m; null: not recorded, or the robot does not report its loads."""
    charges: int
    """Number of times that charging started."""
    chargeAtStart: float | None
    """Mean charge at these times, percent."""


class WaitFigures(TypedDict):
    """Time that robots waited for a cause, the reason code of their condition."""

    cause: str
    seconds: float


class PlaceFigures(TypedDict):
    """Time that robots waited for a point, path, location or block, or for the release of a node."""

    place: str
    seconds: float
    robots: int
    """Number of different robots."""


class FailureFigures(TypedDict):
    """Failures of a kind with the same cause, at the same robot or vehicle."""

    kind: FailureKind
    robot: str | None
    vehicle: str | None
    """Name of the vehicle of a failed order."""
    cause: str
    """Error type, action type, connection state, or reason of the order's state."""
    level: str | None
    """Level of the error."""
    count: int


class Report(TypedDict):
    """A report; times are ISO 8601 in UTC, durations seconds, distances m."""

    since: str
    until: str
    """Exclusive; not later than the time of the request."""
    recordedSince: str | None
    """Start of the history within the range; null: nothing recorded."""
    recordedSeconds: float
    """Time from there to the end, without interruptions of the aggregator or its broker connection."""
    missing: int
    """Number of events in the range that could not be written."""
    orders: OrderFigures
    utilisation: float | None
    """As for a robot, over all robots."""
    waitingShare: float | None
    robots: list[RobotFigures]
    waiting: list[WaitFigures]
    """Longest first."""
    waitingPlaces: list[PlaceFigures]
    """Longest first; at most 1,000. Waits without a place are not included."""
    failures: list[FailureFigures]
    """Most frequent first; at most 100 of each kind."""


class Link(NamedTuple):
    """A change of the broker connection, and the time of the event before it, ms."""

    time: int
    connected: bool
    started: bool
    before: int | None


@dataclass(frozen=True, slots=True)
class Outage:
    """A time without data, ms: the aggregator did not run, or was not connected to the broker."""

    begin: int
    end: int
    restart: bool
    """The aggregator was restarted: what it knew of the robots before ends with it."""

    def within(self, since: int, until: int) -> int:
        """Return the duration of its part in a time range, ms."""
        return max(0, min(self.end, until) - max(self.begin, since))


OUTAGES_KEPT = 200
"""Maximum number of outages that a report considers, the longest ones; bounds the cost of its queries."""


def find_outages(links: Sequence[Link], until: int) -> list[Outage]:
    """Return the outages between these connection changes, oldest first, and after the last one."""
    outages: list[Outage] = []
    last: Link | None = None
    for link in links:
        down = last is not None and not last.connected
        restart = link.started or (last is not None and not down)
        if link.connected and (down or restart):
            # A run that was killed wrote no end: it ends with the last event before the next run.
            begin = last.time if last is not None and down else link.before
            if begin is not None:
                outages.append(Outage(begin, link.time, restart))
        if last is None or link.connected or not down:
            last = link
    if last is not None and not last.connected and last.time < until:
        outages.append(Outage(last.time, until, restart=False))
    longest = sorted(outages, key=lambda outage: outage.begin - outage.end)[:OUTAGES_KEPT]
    return sorted(longest, key=lambda outage: outage.begin)


def share_in_service(condition: str, conditions: dict[str, float]) -> float | None:
    """Return the share of the time in service spent in a condition, 0 to 1; None: never in service."""
    service = sum(seconds for each, seconds in conditions.items() if each != AWAY)
    return round(conditions.get(condition, 0.0) / service, 4) if service else None


COLUMNS = ("section", "figure", "robot", "detail", "value")


def report_csv(report: Report) -> str:
    """Format a report as CSV (RFC 4180), one row per figure; an unknown value is empty."""
    text = StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for section, figure, robot, detail, value in _report_rows(report):
        writer.writerow((section, figure, harmless(robot), harmless(detail), "" if value is None else value))
    return text.getvalue()


Cells = tuple[str, str, str | None, str | None, str | float | None]


def _report_rows(report: Report) -> Iterator[Cells]:
    for name in (
        "since",
        "until",
        "recordedSince",
        "recordedSeconds",
        "missing",
        "utilisation",
        "waitingShare",
    ):
        yield "report", name, None, None, report[name]
    for name, value in report["orders"].items():
        if name != "hours":
            yield "orders", name, None, None, value  # type: ignore[misc]
    for hour in report["orders"]["hours"]:
        yield "hours", "finished", None, hour["since"], hour["finished"]
        yield "hours", "failed", None, hour["since"], hour["failed"]
    for robot in report["robots"]:
        yield from _robot_rows(robot)
    for wait in report["waiting"]:
        yield "waiting", "seconds", None, wait["cause"], wait["seconds"]
    for place in report["waitingPlaces"]:
        yield "waitingPlaces", "seconds", None, place["place"], place["seconds"]
        yield "waitingPlaces", "robots", None, place["place"], place["robots"]
    for failure in report["failures"]:
        cause = f"{failure['cause']} ({failure['level']})" if failure["level"] else failure["cause"]
        yield "failures", failure["kind"], failure["robot"] or failure["vehicle"], cause, failure["count"]


def _robot_rows(robot: RobotFigures) -> Iterator[Cells]:
    name = robot["robot"]
    for condition, seconds in robot["conditions"].items():
        yield "robots", "seconds", name, condition, seconds
    for figure in ("utilisation", "waitingShare", "distance", "emptyDistance", "charges", "chargeAtStart"):
        yield "robots", figure, name, None, robot[figure]
