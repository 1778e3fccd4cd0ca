"""The kinds of messages that the aggregator listens to."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from datetime import datetime
from enum import Enum, StrEnum, auto


class MessageKind(StrEnum):
    """Bounded on purpose: the kind is a label of metrics."""

    CONNECTION = "connection"
    STATE = "state"
    VISUALIZATION = "visualization"
    FACTSHEET = "factsheet"
    ROBOT_MAP = "robotMap"
    ORDER_STATUS = "orderStatus"
    VEHICLE_STATUS = "vehicleStatus"
    PLANT_MODEL = "plantModel"


GREATEST_HEADER_ID = 2**32 - 1


class Verdict(Enum):
    """What a message is, compared with those before it."""

    TAKEN = auto()
    REPEATED = auto()
    LATE = auto()


@dataclass(slots=True)
class Sequence:
    """What is remembered of one topic of one robot."""

    header_id: int = -1
    timestamp: datetime | None = None
    opened: datetime | None = None
    """Timestamp of the message that opened the session."""
    late: tuple[int, datetime] | None = None
    missed: int = 0
    """Messages that were sent, by the gaps of headerId, and never came."""
    restarts: int = 0

    def judge(self, header_id: int, timestamp: datetime) -> Verdict:
        """Judge a message, and remember it."""
        last = self.timestamp
        if last is None:
            return self._open(header_id, timestamp)
        if header_id == self.header_id and timestamp == last:
            return Verdict.REPEATED
        if header_id == 0:
            return self._begin_again(timestamp)
        newer = timestamp > last or (timestamp == last and header_id > self.header_id)
        if newer and header_id <= self.header_id:
            self.restarts += 1
            return self._open(header_id, timestamp)
        if newer or header_id == self.header_id + 1:
            self.missed += header_id - self.header_id - 1
            return self._take(header_id, timestamp)
        return self._late(header_id, timestamp)

    def _begin_again(self, timestamp: datetime) -> Verdict:
        if timestamp == self.opened:
            return Verdict.REPEATED
        self.restarts += self.header_id != GREATEST_HEADER_ID
        return self._open(0, timestamp)

    def _late(self, header_id: int, timestamp: datetime) -> Verdict:
        before, self.late = self.late, (header_id, timestamp)
        if before is not None and header_id == before[0] + 1 and timestamp >= before[1]:
            self.restarts += 1
            return self._open(header_id, timestamp)
        return Verdict.LATE

    def _open(self, header_id: int, timestamp: datetime) -> Verdict:
        self.opened = timestamp
        return self._take(header_id, timestamp)

    def _take(self, header_id: int, timestamp: datetime) -> Verdict:
        self.header_id = header_id
        self.timestamp = timestamp
        self.late = None
        return Verdict.TAKEN


SAMPLES = 8


class ClockSkew:
    """Compares timestamps of messages with the time of their arrival.

    A delay on the way can only make a robot's clock look slower, so the greatest of the last differences is
    the best estimate.
    """

    __slots__ = ("_differences",)

    def __init__(self) -> None:
        self._differences: deque[float] = deque(maxlen=SAMPLES)

    def measure(self, sent: datetime, arrived: datetime) -> None:
        """Take in one message."""
        self._differences.append((sent - arrived).total_seconds())

    @property
    def seconds(self) -> float | None:
        """Robot's clock minus ours, s; None before the first message."""
        return max(self._differences, default=None)
