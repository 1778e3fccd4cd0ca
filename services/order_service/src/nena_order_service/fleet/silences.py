"""When robots that say nothing more have to be noticed as silent."""

from __future__ import annotations

from collections.abc import Iterator
from heapq import heappop, heappush
from math import inf

from nena_shared.vda5050.topics import RobotKey


class Silences:
    """Gives each robot at the moment from which it may be silent, so that nobody has to look at all of them.

    Most are heard again long before. That moves nothing here: who is given and was heard is expected anew.
    """

    def __init__(self) -> None:
        self._at: dict[RobotKey, float] = {}
        self._next: list[tuple[float, RobotKey]] = []
        self._looked_at = -inf

    def expect(self, robot: RobotKey, at: float) -> None:
        """Give the robot after this moment, in monotonic seconds; once that has been looked at, no more."""
        known = self._at.get(robot, inf)
        if self._looked_at <= at < known:
            self._at[robot] = at
            heappush(self._next, (at, robot))

    def passed(self, now: float) -> Iterator[RobotKey]:
        """Give the robots whose moments have passed."""
        self._looked_at = now
        while self._next and self._next[0][0] < now:
            at, robot = heappop(self._next)
            if self._at.get(robot) == at:
                del self._at[robot]
                yield robot
