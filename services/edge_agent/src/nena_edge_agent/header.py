"""Headers of what a robot sends (section 7.2)."""

from __future__ import annotations

from collections import Counter
from typing import Any

from nena_shared.clock import Clock
from nena_shared.vda5050.topics import RobotKey, Topic

WRAP = 2**32


class HeaderMaker:
    """Counts the messages of each topic, from 0."""

    def __init__(self, robot: RobotKey, *, version: str, clock: Clock) -> None:
        self._robot = robot
        self._version = version
        self._clock = clock
        self._counts: Counter[Topic] = Counter()

    def make(self, topic: Topic) -> dict[str, Any]:
        """Give the header of the next message under ``topic``, by its neutral names."""
        number = self._counts[topic]
        self._counts[topic] = (number + 1) % WRAP
        return {
            "header_id": number,
            "timestamp": self._clock.now(),
            "version": self._version,
            "manufacturer": self._robot.manufacturer,
            "serial_number": self._robot.serial_number,
        }

    def last_id(self, topic: Topic) -> int:
        """Give the headerId of the last message under ``topic``; 0 before the first."""
        return max(0, self._counts[topic] - 1)
