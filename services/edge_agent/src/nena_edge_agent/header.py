"""Headers of what a robot sends (section 7.2)."""

from __future__ import annotations

from collections import Counter
from typing import Any

from nena_shared.clock import Clock
from nena_shared.vda5050.topics import RobotKey, Topic

WRAP = 2**32
RESERVE = 100
"""Ids of a topic that are set apart at once: at most so many are left out by a restart."""
TOPICS = (Topic.STATE, Topic.VISUALIZATION, Topic.CONNECTION, Topic.FACTSHEET)
"""What a robot sends."""

Reserved = tuple[tuple[Topic, int], ...]
"""For each topic the first id that is not set apart."""


class HeaderMaker:
    """Counts the messages of each topic, from 0 or from where an earlier run of the program may have been.

    Ids are used after they have been reserved on disk, so that none comes twice. A robot that cannot write
    goes on counting: fleet control must take ids that begin anew.
    """

    def __init__(self, robot: RobotKey, *, version: str, clock: Clock, reserved: Reserved = ()) -> None:
        self._robot = robot
        self._version = version
        self._clock = clock
        self._counts: Counter[Topic] = Counter(dict(reserved))
        self._reserved: dict[Topic, int] = {}

    def reserve(self) -> Reserved:
        """Give the first id of each topic that is not set apart; raised when half of those are used."""
        for topic in TOPICS:
            left = (self._reserved.get(topic, 0) - self._counts[topic]) % WRAP
            if not RESERVE // 2 <= left <= RESERVE:
                self._reserved[topic] = (self._counts[topic] + RESERVE) % WRAP
        return tuple(self._reserved.items())

    def make(self, topic: Topic) -> dict[str, Any]:
        """Give the header of the next message under ``topic``, by its neutral names."""
        number = self._counts[topic]
        self._counts[topic] = (number + 1) % WRAP
        return self.form(number)

    def form(self, number: int) -> dict[str, Any]:
        """Give a header with this headerId, without counting it."""
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
