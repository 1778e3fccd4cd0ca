"""The robots that are kept, and which one makes room when there are too many.

Anybody who may publish can invent robots, so their number is bounded. The rule: a newcomer takes the place of
the robot that has not been heard of for the longest time, but only if that time is longer than its silence
limit; while all are alive the newcomer is refused, and counted.
"""

from __future__ import annotations

from collections.abc import Iterator

from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet_model.instant import Instant
from nena_status_aggregator.fleet_model.robot import Robot


class RobotRegister:
    """All robots that are known, by their keys."""

    def __init__(self, limit: int, silence_limit: float | None) -> None:
        self._limit = limit
        self._silence_limit = silence_limit
        self._robots: dict[RobotKey, Robot] = {}

    def __iter__(self) -> Iterator[Robot]:
        return iter(self._robots.values())

    def __len__(self) -> int:
        return len(self._robots)

    def get(self, key: RobotKey) -> Robot | None:
        """Give a robot that is known."""
        return self._robots.get(key)

    def meet(self, key: RobotKey, at: Instant) -> tuple[Robot | None, Robot | None]:
        """Give the robot, known or new, or None if there is no room; and the robot that had to go for it."""
        robot = self._robots.get(key)
        gone = None
        if robot is None:
            if len(self._robots) >= self._limit:
                gone = self._quietest(at)
                if gone is None:
                    return None, None
                del self._robots[gone.key]
            robot = self._robots[key] = Robot(key, at)
        robot.heard = at.monotonic
        return robot, gone

    def _quietest(self, at: Instant) -> Robot | None:
        robot = min(self._robots.values(), key=lambda each: each.heard)
        quiet = at.monotonic - robot.heard > robot.silence_limit(self._silence_limit)
        return robot if quiet else None
