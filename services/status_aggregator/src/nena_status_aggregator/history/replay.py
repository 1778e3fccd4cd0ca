"""The replay: where each robot was in a time range and how it looked, in numbers that are quick to load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from typing_extensions import TypedDict

from nena_status_aggregator.fleet.condition import URGENT
from nena_status_aggregator.fleet.events import Code

POSITIONS_LIMIT = 240_000
"""Number of positions to which a replay is thinned: 50 robots every 6 s in 8 hours, a frame at 60 times."""

TENTH = 100
"""ms."""

Look = tuple[int, str | None, bool, int, int]
"""Tenths of a second after ``since``, condition (null: none), whether the robot is urgent, its loads, and the
number of robots in a jam behind it."""


class RobotReplay(TypedDict):
    """Positions and looks of a robot, oldest first.

    In times, x and y, each number is the difference to the one before it.
    """

    robot: str
    times: list[int]
    """Tenths of a second, from ``since``."""
    x: list[int]
    """cm."""
    y: list[int]
    theta: list[int]
    """Hundredths of a rad, not differences."""
    looks: list[Look]


class StopReplay(TypedDict):
    """A stop of an area."""

    begin: int
    """Tenths of a second after ``since``."""
    end: int | None
    """null: it has not ended."""
    area: dict[str, float]


class Replay(TypedDict):
    """The replay of a time range."""

    since: str
    until: str
    """Exclusive; not later than the time of the request."""
    recordedSince: str | None
    """Time of the oldest position in the history; null: it has none."""
    step: float
    """At most one position of a robot in this time, s."""
    robots: list[RobotReplay]
    stops: list[StopReplay]


def step_of(span: int, robots: int) -> int:
    """Return the step to which the positions in a time range are thinned, ms."""
    return max(1, span * robots // POSITIONS_LIMIT)


class Track:
    """Collects the positions and looks of a robot, oldest first; times are ms since 1970."""

    __slots__ = ("_look", "_since", "_time", "_x", "_y", "replay")

    def __init__(self, robot: str, since: int) -> None:
        self.replay: RobotReplay = {"robot": robot, "times": [], "x": [], "y": [], "theta": [], "looks": []}
        self._since = since
        self._time = self._x = self._y = 0
        self._look: tuple[str | None, bool, int, int] = None, False, 0, 0

    def add_position(self, time: int, values: Mapping[str, float]) -> None:
        """Add a position, m and rad; one before the range is that at its begin."""
        columns, time = self.replay, self._offset(time)
        x, y, theta = round(100 * values["x"]), round(100 * values["y"]), round(100 * values["theta"])
        columns["times"].append(time - self._time)
        columns["x"].append(x - self._x)
        columns["y"].append(y - self._y)
        columns["theta"].append(theta)
        self._time, self._x, self._y = time, x, y

    def add_change(self, time: int, code: str, values: Mapping[str, Any]) -> None:
        """Add a change of loads, of the jam behind it, or of the condition (none: the robot was removed)."""
        condition, urgent, loads, jam = self._look
        if code == Code.LOADS:
            loads = int(values.get("loads") or 0)
        elif code == Code.JAM:
            jam = int(values.get("robots") or 0)
        else:
            before = values.get("before")
            if before and not self.replay["looks"]:  # the first change tells what was before
                self._add_look(self._since, (before, False, loads, jam))
            condition, urgent = values.get("condition"), values.get("reason") in URGENT
        self._add_look(time, (condition, urgent, loads, jam))

    def _add_look(self, time: int, look: tuple[str | None, bool, int, int]) -> None:
        if look != self._look:
            self._look = look
            self.replay["looks"].append((self._offset(time), *look))

    def _offset(self, time: int) -> int:
        return max(0, time - self._since) // TENTH
