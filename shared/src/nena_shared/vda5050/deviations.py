"""Counts the deviations of a fleet's robots from the standard, and logs them at a limited rate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Final

from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.vda5050.repair import Repair, RepairKind
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

LOGGED_EACH: Final = 3600.0
"""Seconds between two log entries about one robot."""

ROBOTS_LIMIT: Final = 10_000
"""Robots whose deviations are kept; those of further ones are only counted in total."""

FIELDS_LIMIT: Final = 50
"""Fields that are kept of one robot."""

LABELS_LIMIT: Final = 200
"""Pairs of field and kind that are counted apart in total; the rest is counted under ``OTHER``."""

OTHER: Final = "other"


class Deviations:
    """What had to be repaired in the messages of each robot."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._robots: dict[RobotKey, dict[tuple[str, RepairKind], Repair]] = {}
        self._logged_at: dict[RobotKey, float] = {}
        self._totals: Counter[tuple[str, str]] = Counter()

    def note(self, robot: RobotKey, topic: str, repairs: tuple[Repair, ...]) -> bool:
        """Count the repairs of one message; return whether the robot has not deviated like this before."""
        for each in repairs:
            label = (f"{topic}.{each.field}", each.kind.value)
            known = label in self._totals or len(self._totals) < LABELS_LIMIT
            self._totals[label if known else (OTHER, each.kind.value)] += 1
        new = self._keep(robot, topic, repairs)
        self._log(robot, topic, repairs)
        return new

    def note_message(self, topic: str, repairs: tuple[Repair, ...]) -> None:
        """Count the repairs of one message by its full topic, of which the last levels name the robot."""
        *_, manufacturer, serial_number, name = topic.split("/")
        self.note(RobotKey(manufacturer, serial_number), name, repairs)

    def of(self, robot: RobotKey) -> tuple[Repair, ...]:
        """Return how a robot deviates: each field and kind once, with the value that was seen first."""
        return tuple(self._robots.get(robot, {}).values())

    @property
    def totals(self) -> Mapping[tuple[str, str], int]:
        """How many repairs there were, by topic with field, and kind."""
        return self._totals

    def _keep(self, robot: RobotKey, topic: str, repairs: tuple[Repair, ...]) -> bool:
        kept = self._robots.get(robot)
        if kept is None:
            if len(self._robots) >= ROBOTS_LIMIT:
                return False
            kept = self._robots[robot] = {}
        before = len(kept)
        for each in repairs:
            field = f"{topic}.{each.field}"
            if len(kept) < FIELDS_LIMIT:
                kept.setdefault((field, each.kind), each._replace(field=field))
        return len(kept) > before

    def _log(self, robot: RobotKey, topic: str, repairs: tuple[Repair, ...]) -> None:
        now, last = self._clock.monotonic(), self._logged_at.get(robot)
        if robot not in self._robots or (last is not None and now - last < LOGGED_EACH):
            return
        self._logged_at[robot] = now
        log.warning(
            "robot deviates from VDA 5050; its message was repaired",
            robot=str(robot),
            topic=topic,
            repairs=[str(each) for each in repairs],
        )
