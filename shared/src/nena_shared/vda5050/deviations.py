"""Count how robots deviate from the standard, and log it at a limited rate."""

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
"""Minimum interval between log entries about one robot, seconds."""

ROBOTS_LIMIT: Final = 10_000
"""Maximum number of robots with stored deviations; those of further robots only count in the totals."""

FIELDS_LIMIT: Final = 50
"""Maximum number of stored deviations per robot."""

LABELS_LIMIT: Final = 200
"""Maximum number of pairs of field and kind in the totals; others count as ``OTHER``."""

OTHER: Final = "other"


class Deviations:
    """The repairs in the messages of each robot."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._robots: dict[RobotKey, dict[tuple[str, RepairKind], Repair]] = {}
        self._logged_at: dict[RobotKey, float] = {}
        self._totals: Counter[tuple[str, str]] = Counter()

    def note(self, robot: RobotKey, topic: str, repairs: tuple[Repair, ...]) -> bool:
        """Count the repairs of one message; return whether one of them is new for this robot."""
        for repair in repairs:
            label = (f"{topic}.{repair.field}", repair.kind.value)
            counted = label in self._totals or len(self._totals) < LABELS_LIMIT
            self._totals[label if counted else (OTHER, repair.kind.value)] += 1
        new = self._keep_new(robot, topic, repairs)
        at, last = self._clock.monotonic(), self._logged_at.get(robot)
        # a robot that deviates does so in every state, several times a second
        if robot in self._robots and (last is None or at - last >= LOGGED_EACH):
            self._logged_at[robot] = at
            log.warning(
                "robot deviates from VDA 5050; its message was repaired",
                robot=str(robot),
                topic=topic,
                repairs=[str(repair) for repair in repairs],
            )
        return new

    def of(self, robot: RobotKey) -> tuple[Repair, ...]:
        """Return a robot's repairs: each field and kind once, with the first received value."""
        return tuple(self._robots.get(robot, {}).values())

    @property
    def totals(self) -> Mapping[tuple[str, str], int]:
        """Number of repairs by topic with field, and kind."""
        return self._totals

    def _keep_new(self, robot: RobotKey, topic: str, repairs: tuple[Repair, ...]) -> bool:
        kept = self._robots.get(robot)
        if kept is None:
            if len(self._robots) >= ROBOTS_LIMIT:
                return False
            kept = self._robots[robot] = {}
        previously = len(kept)
        for repair in repairs:
            field = f"{topic}.{repair.field}"
            if len(kept) < FIELDS_LIMIT:
                kept.setdefault((field, repair.kind), repair._replace(field=field))
        return len(kept) > previously
