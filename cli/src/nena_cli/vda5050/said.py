"""What a message of a conversation is: who said it, about which robot, and what it says."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Final

from nena_cli.vda5050.recording import Entry
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import KINDS, Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import CODECS, codec_of_header, nearest_codec

LEVELS: Final = 4
"""Levels of a topic that are read: major version, manufacturer, serial number, and what it is about."""


class Speaker(StrEnum):
    """Who says something."""

    FLEET_CONTROL = "fleet control"
    ROBOT = "robot"


SPEAKERS: Final = {
    Topic.ORDER: Speaker.FLEET_CONTROL,
    Topic.INSTANT_ACTIONS: Speaker.FLEET_CONTROL,
    Topic.ZONE_SET: Speaker.FLEET_CONTROL,
    Topic.RESPONSES: Speaker.FLEET_CONTROL,
    Topic.STATE: Speaker.ROBOT,
    Topic.VISUALIZATION: Speaker.ROBOT,
    Topic.CONNECTION: Speaker.ROBOT,
    Topic.FACTSHEET: Speaker.ROBOT,
}


@dataclass(frozen=True, slots=True)
class Said:
    """A message of a VDA 5050 topic, the ``number``-th of its conversation.

    ``message`` is None where it cannot be read; ``problems`` says why then.
    """

    number: int
    time: datetime
    robot: RobotKey
    topic: Topic
    major_version: str
    retained: bool
    codec: Codec
    message: Header | None
    problems: tuple[str, ...] = ()

    @property
    def speaker(self) -> Speaker:
        """Who says it."""
        return SPEAKERS[self.topic]


def understand(entry: Entry, number: int) -> Said | None:
    """Read the ``number``-th message; None for other topics, and for an empty one, which only clears."""
    levels = entry.topic.split("/")
    if len(levels) < LEVELS or levels[-1] not in set(Topic) or not entry.payload:
        return None
    major, manufacturer, serial_number, last = levels[-LEVELS:]
    topic = Topic(last)
    codec = _codec(entry.payload, major)
    message: Header | None = None
    problems: tuple[str, ...] = ()
    try:
        message = codec.decode(KINDS[topic], entry.payload)
    except MalformedMessageError as error:
        problems = error.problems
    robot = RobotKey(manufacturer, serial_number)
    return Said(number, entry.time, robot, topic, major, entry.retain, codec, message, problems)


def _codec(payload: bytes, major: str) -> Codec:
    """Choose by the header; else by the topic; else the newest one, which says what is wrong."""
    found = codec_of_header(payload)
    if found is None and major[:1] == "v" and major[1:].isdecimal():
        found = nearest_codec(f"{major[1:]}.999.0")
    return found or list(CODECS.values())[-1]
