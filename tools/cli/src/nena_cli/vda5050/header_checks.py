"""Headers: their ids rise by one on each topic, their time does not go back (section 7.2)."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from typing import Final

from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_cli.vda5050.said import Said
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.topics import RobotKey, Topic

COUNT: Final = 2**32


class HeaderChecks:
    """Follows the headers of one robot's conversation, topic by topic."""

    def __init__(self) -> None:
        self._last: dict[Topic, tuple[int, datetime]] = {}

    def check(self, said: Said, message: Header) -> Iterator[Problem]:
        """Compare a message with the one before it on the same topic."""
        if said.codec.major_version != said.major_version:
            text = f"the topic says {said.major_version}, the header {message.version}"
            yield Rule.VERSION, Severity.ERROR, text
        named = RobotKey(message.manufacturer, message.serial_number)
        if named != said.robot:
            yield Rule.ADDRESS, Severity.ERROR, f"the topic is that of {said.robot}, the header names {named}"
        last = self._last.get(said.topic)
        if said.topic is Topic.CONNECTION or said.retained:
            return  # wills and kept messages have headers of another time
        self._last[said.topic] = message.header_id, message.timestamp
        if last:
            yield from _compare(message, *last)


def _compare(message: Header, last_id: int, last_time: datetime) -> Iterator[Problem]:
    expected = (last_id + 1) % COUNT
    if message.header_id not in (expected, 0):
        text = f"headerId {message.header_id} comes after {last_id}: messages are missing or out of order"
        yield Rule.HEADER_ID, Severity.WARNING, text
    if message.timestamp < last_time:
        text = f"timestamp {message.timestamp:%H:%M:%S.%f} comes after {last_time:%H:%M:%S.%f}"
        yield Rule.TIMESTAMP, Severity.WARNING, text
