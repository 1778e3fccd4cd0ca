"""Tells new messages of one topic from repeated and late ones, by headerId and timestamp.

VDA 5050 (3.0 section 7.2) counts headerId per topic and says nothing about restarts; in the field a sender
begins again at 0 or 1, and some robots have no clock worth the name. Rules, in this order:

1. the first message is taken;
2. the same headerId and timestamp as the last one taken: repeated;
3. headerId 0: a restart, unless it is the very message that opened this session (then it is repeated);
4. a greater timestamp, or the same one with a greater headerId: taken. Where the headerId went down, it is a
   restart;
5. the very next headerId, whatever the timestamp: taken (the sender's clock was set back);
6. anything else is late, but remembered: a message that continues a late one is taken, because then the
   sender lives there and it was our picture that was wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import Enum, auto

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
