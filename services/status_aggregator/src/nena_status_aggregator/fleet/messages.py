"""Kinds of messages, and the order of messages on one topic.

VDA 5050 (3.0, 7.2) counts headerId per topic and does not define restarts; some senders start again at 0 or
1, and some robots have no usable clock. Rules, in this order:

1. The first message is new.
2. The same headerId and timestamp as the last new message: repeated, if the content is the same, too. If
   timestamps cannot be read and the headerId never changes, new: the robot may be idle.
3. headerId 0: a restart, unless it is the message that started this session (then it is repeated).
4. A later timestamp, or the same one with a greater headerId: new. If the headerId decreased, it is a
   restart.
5. The next headerId, whatever the timestamp: new (the sender's clock was set back).
6. Anything else is late, but remembered: a message that continues a late one is new, because then the sender
   continues there. If the headerId never changes, timestamps continue it.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from enum import Enum, StrEnum, auto


class MessageKind(StrEnum):
    """Kinds of messages that the aggregator reads. A metric label, therefore bounded."""

    CONNECTION = "connection"
    STATE = "state"
    VISUALIZATION = "visualization"
    FACTSHEET = "factsheet"
    ROBOT_MAP = "robotMap"
    ORDER_STATUS = "orderStatus"
    VEHICLE_STATUS = "vehicleStatus"
    PLANT_MODEL = "plantModel"
    SERVICE_STATUS = "serviceStatus"
    PERIPHERAL_STATUS = "peripheralStatus"


GREATEST_HEADER_ID = 2**32 - 1
NO_TIME = datetime.min.replace(tzinfo=UTC)
"""Instead of a timestamp that cannot be read."""


class Verdict(Enum):
    """A message compared with those before it."""

    NEW = auto()
    REPEATED = auto()
    LATE = auto()


@dataclass(slots=True)
class Sequence:
    """Detects repeated and late messages of one topic of one robot by headerId and timestamp."""

    header_id: int = -1
    timestamp: datetime | None = None
    opened: datetime | None = None
    """Timestamp of the first message of this session."""
    late: tuple[int, datetime] | None = None
    content: object = None
    """The last new message, or whatever else tells messages with the same header apart."""
    counts: bool = False
    """Whether the header has ever changed."""
    missed: int = 0
    """Messages lost, by gaps in headerId."""
    restarts: int = 0

    def assess_message(self, header_id: int, timestamp: datetime, content: object = None) -> Verdict:
        """Classify a message and remember it."""
        verdict = self._assess_header(header_id, timestamp, content)
        if verdict is Verdict.NEW:
            self.content = content
        return verdict

    def _assess_header(self, header_id: int, timestamp: datetime, content: object) -> Verdict:
        last = self.timestamp
        if last is None:
            return self._open_sequence(header_id, timestamp)
        if header_id == self.header_id and timestamp == last:
            ordered = self.counts or timestamp != NO_TIME
            return Verdict.REPEATED if ordered and content == self.content else Verdict.NEW
        self.counts = True
        if header_id == 0 and timestamp == self.opened:
            return Verdict.REPEATED
        newer = timestamp > last or (timestamp == last and header_id > self.header_id)
        if header_id == 0 or (newer and header_id <= self.header_id):
            # headerId is a uint32: 0 after the greatest one is the next number, no restart.
            self.restarts += header_id != 0 or self.header_id != GREATEST_HEADER_ID
            return self._open_sequence(header_id, timestamp)
        if newer or header_id == self.header_id + 1:
            self.missed += header_id - self.header_id - 1
            return self._accept_message(header_id, timestamp)
        return self._assess_late(header_id, timestamp)

    def _assess_late(self, header_id: int, timestamp: datetime) -> Verdict:
        # Two late messages in a row: the sender restarted with its clock set back, and goes on there.
        previous, self.late = self.late, (header_id, timestamp)
        if previous is not None and (
            (header_id == previous[0] + 1 and timestamp >= previous[1])
            or (header_id == previous[0] == self.header_id and timestamp > previous[1])
        ):
            self.restarts += 1
            return self._open_sequence(header_id, timestamp)
        return Verdict.LATE

    def _open_sequence(self, header_id: int, timestamp: datetime) -> Verdict:
        self.opened = timestamp
        return self._accept_message(header_id, timestamp)

    def _accept_message(self, header_id: int, timestamp: datetime) -> Verdict:
        self.header_id = header_id
        self.timestamp = timestamp
        self.late = None
        return Verdict.NEW
