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

    FLEET = "fleet"
    ROBOT = "robot"


SPEAKERS: Final = {
    Topic.ORDER: Speaker.FLEET,
    Topic.INSTANT_ACTIONS: Speaker.FLEET,
    Topic.ZONE_SET: Speaker.FLEET,
    Topic.RESPONSES: Speaker.FLEET,
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
    place: str
    """All levels of the topic but the last: what one robot speaks under."""
    retained: bool
    codec: Codec
    payload: bytes
    message: Header | None
    problems: tuple[str, ...] = ()

    @property
    def speaker(self) -> Speaker:
        """Who says it."""
        return SPEAKERS[self.topic]

    @property
    def major_version(self) -> str:
        """The topic's level of the version, e.g. ``v2``."""
        return self.place.rsplit("/", LEVELS - 1)[-3]


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
    return Said(
        number=number,
        time=entry.time,
        robot=RobotKey(manufacturer, serial_number),
        topic=topic,
        place=entry.topic.rsplit("/", 1)[0],
        retained=entry.retain,
        codec=codec,
        payload=entry.payload,
        message=message,
        problems=problems,
    )


def speaker_of(topic: str) -> Speaker | None:
    """Tell who speaks on a topic; None where it is none of VDA 5050."""
    last = topic.rsplit("/", 1)[-1]
    return SPEAKERS[Topic(last)] if last in set(Topic) else None


def _codec(payload: bytes, major: str) -> Codec:
    """Choose by the header; else by the topic; else the newest one, which says what is wrong."""
    found = codec_of_header(payload)
    if found is None and major[:1] == "v" and major[1:].isdecimal():
        found = nearest_codec(f"{major[1:]}.999.0")
    return found or list(CODECS.values())[-1]
