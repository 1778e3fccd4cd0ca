"""Messages of a conversation: sender, robot, topic and parsed content."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Final

from nena_conversations.recording import Entry
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import KINDS, Codec
from nena_shared.vda5050.command_reader import read_command
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.repair import Repair
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import CODECS, UnknownVersionError, codec_of_header, nearest_codec

LEVELS: Final = 4
"""Topic levels that are read: major version, manufacturer, serial number, topic name."""


class Sender(StrEnum):
    """Side that publishes a message."""

    FLEET = "fleet"
    ROBOT = "robot"


SENDERS: Final = {
    Topic.ORDER: Sender.FLEET,
    Topic.INSTANT_ACTIONS: Sender.FLEET,
    Topic.ZONE_SET: Sender.FLEET,
    Topic.RESPONSES: Sender.FLEET,
    Topic.STATE: Sender.ROBOT,
    Topic.VISUALIZATION: Sender.ROBOT,
    Topic.CONNECTION: Sender.ROBOT,
    Topic.FACTSHEET: Sender.ROBOT,
}


@dataclass(frozen=True, slots=True)
class ReceivedMessage:
    """A message of a VDA 5050 topic, the ``number``-th of its conversation.

    ``message`` is None if the payload is malformed; ``problems`` then holds the reasons.
    """

    number: int
    time: datetime
    robot: RobotKey
    topic: Topic
    topic_prefix: str
    """All topic levels but the last: common to the topics of one robot."""
    retained: bool
    codec: Codec
    payload: bytes
    message: Header | None
    problems: tuple[str, ...] = ()

    @property
    def sender(self) -> Sender:
        """Side that published the message."""
        return SENDERS[self.topic]

    @property
    def major_version(self) -> str:
        """Version level of the topic, e.g. ``v2``."""
        return self.topic_prefix.rsplit("/", LEVELS - 1)[-3]


def parse(entry: Entry, number: int) -> ReceivedMessage | None:
    """Parse the ``number``-th message; None for topics outside VDA 5050 and for empty (clearing) messages."""
    levels = entry.topic.split("/")
    if len(levels) < LEVELS or levels[-1] not in set(Topic) or not entry.payload:
        return None
    major, manufacturer, serial_number, last = levels[-LEVELS:]
    topic = Topic(last)
    codec = _codec_of(entry.payload, major)
    message: Header | None = None
    problems: tuple[str, ...] = ()
    try:
        message = codec.decode(KINDS[topic], entry.payload)
    except MalformedMessageError as error:
        problems = _deviations(entry, topic, major, codec) or error.problems
    return ReceivedMessage(
        number=number,
        time=entry.time,
        robot=RobotKey(manufacturer, serial_number),
        topic=topic,
        topic_prefix=entry.topic.rsplit("/", 1)[0],
        retained=entry.retain,
        codec=codec,
        payload=entry.payload,
        message=message,
        problems=problems,
    )


def _deviations(entry: Entry, topic: Topic, major: str, codec: Codec) -> tuple[str, ...]:
    """Return the deviations that the services repair on reading, in their words."""
    found: list[Repair] = []
    try:
        if SENDERS[topic] is Sender.ROBOT:
            reader = MessageReader(lambda _, repairs: found.extend(repairs))
            reader.read(KINDS[topic], entry.topic, entry.payload, major)
        else:
            found += read_command(KINDS[topic], codec, entry.payload, now=entry.time)[1]
    except (MalformedMessageError, UnknownVersionError):
        return ()
    return tuple(str(each._replace(field=f"{topic}.{each.field}")) for each in found)


def sender_of(topic: str) -> Sender | None:
    """Return the side that publishes on a topic; None for topics outside VDA 5050."""
    last = topic.rsplit("/", 1)[-1]
    return SENDERS[Topic(last)] if last in set(Topic) else None


def _codec_of(payload: bytes, major: str) -> Codec:
    """Choose the codec by header, else by topic, else the newest one, which then reports the problems."""
    found = codec_of_header(payload)
    if found is None and major[:1] == "v" and major[1:].isdecimal():
        # The newest minor of the topic's major, which is all that a topic names.
        found = nearest_codec(f"{major[1:]}.999.0")
    return found or list(CODECS.values())[-1]
