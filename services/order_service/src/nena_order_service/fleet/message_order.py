"""Tells new messages of a topic from repeated and overtaken ones (VDA 5050 3.0 section 7.2)."""

from __future__ import annotations

from datetime import datetime
from typing import Final

BELIEVED_COUNT: Final = 3
BELIEVED_AFTER: Final = 10.0
"""Messages in a row that look old, but rise among themselves, and seconds without any other one, from which
the sender has started anew with a wrong clock."""


class MessageOrder:
    """Judges the headers of one robot's messages on one topic.

    A message is old if neither its headerId nor its timestamp is beyond the last one's. A sender that starts
    anew counts from 0 with a later timestamp, which is no old message; one whose clock went back as well is
    believed after some messages, or at once after :meth:`restart`.
    """

    def __init__(self) -> None:
        self._last: tuple[int, datetime] | None = None
        self._last_at = 0.0
        self._last_old = -1
        self._old_in_a_row = 0

    def restart(self) -> None:
        """Take any message as new: the sender has connected anew."""
        self._last = None

    def is_new(self, header_id: int, timestamp: datetime, now: float) -> bool:
        """Tell whether the message that comes ``now`` is new; the next ones are compared with it then."""
        last = self._last
        if last is not None and header_id <= last[0] and timestamp <= last[1]:
            repeated = (header_id, timestamp) == last
            if repeated or not self._believed(header_id, now):
                return False
        self._last, self._last_at = (header_id, timestamp), now
        self._last_old, self._old_in_a_row = -1, 0
        return True

    def _believed(self, header_id: int, now: float) -> bool:
        self._old_in_a_row = self._old_in_a_row + 1 if header_id > self._last_old else 1
        self._last_old = header_id
        return self._old_in_a_row >= BELIEVED_COUNT and now - self._last_at >= BELIEVED_AFTER
