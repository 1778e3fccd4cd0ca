"""Messages of a conversation: sender, robot, topic and parsed content."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import datetime
from enum import StrEnum
from typing import Final

from pydantic_core import from_json, to_json

from nena_conversations.recording import Entry
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import KINDS, Codec
from nena_shared.vda5050.command_reader import read_command
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.repair import Repair, version_number
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import (
    CODECS,
    UnknownVersionError,
    nearest_codec,
    reader_for,
)

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
    version: str
    """Version that the header names, else the topic: ``2.1.0``, ``2.x``."""
    unsupported: str | None
    """Reason why the message is not read in the version that it names; its topic may name another one."""
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
    stated, level = _stated_version(entry.payload), _LEVEL.match(major)
    of_header = nearest_codec(stated) if stated else None
    # The newest minor of the topic's major, which is all that a topic names.
    of_topic = nearest_codec(f"{level[1]}.999.0") if level else None
    version = stated or (f"{level[1]}.x" if level else "unknown")
    # Without any version, the newest codec reports the problems; rules of 1.x are numbered as in 2.0.
    codec = of_header or of_topic or list(CODECS.values())[0 if stated or level else -1]
    unsupported = None
    if of_header is None and (stated or (level and of_topic is None)):
        unsupported = f"VDA 5050 {version.partition('.')[0]}.x is not supported"
        if of_topic:
            unsupported += f"; read as {codec.version}, because the topic has {major}"
            entry = replace(entry, payload=to_json({**from_json(entry.payload), "version": codec.version}))
    message: Header | None = None
    problems: tuple[str, ...] = ()
    if of_topic or not unsupported:
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
        version=version,
        unsupported=unsupported,
        problems=problems,
    )


def _deviations(entry: Entry, topic: Topic, major: str, codec: Codec) -> tuple[str, ...]:
    """Return the deviations that the services repair on reading, in their words."""
    found: list[Repair] = []
    robot = RobotKey(*entry.topic.split("/")[-3:-1])
    try:
        if SENDERS[topic] is Sender.ROBOT:
            reader = MessageReader(lambda _, repairs: found.extend(repairs))
            reader.read(KINDS[topic], entry.topic, entry.payload, major, robot)
        else:
            of_topic = reader_for(codec.version, major)
            found += read_command(KINDS[topic], of_topic, entry.payload, now=entry.time, robot=robot)[1]
    except MalformedMessageError as error:
        return error.problems
    except UnknownVersionError:
        return ()
    return tuple(str(each._replace(field=f"{topic}.{each.field}")) for each in found)


def sender_of(topic: str) -> Sender | None:
    """Return the side that publishes on a topic; None for topics outside VDA 5050."""
    last = topic.rsplit("/", 1)[-1]
    return SENDERS[Topic(last)] if last in set(Topic) else None


_LEVEL: Final = re.compile(r"v(\d{1,3})(?!\d)", re.ASCII | re.IGNORECASE)
"""Start of a topic level with a major version: ``v2``, also ``v2.0.0``."""


def _stated_version(payload: bytes) -> str | None:
    """Return the version in a header, completed to three numbers; None if it names none."""
    try:
        content = from_json(payload)
    except ValueError:
        return None
    return version_number(content.get("version")) if isinstance(content, dict) else None
