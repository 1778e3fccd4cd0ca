"""Checks that every message published in any test fits the official schema of its version.

In this process each call of :meth:`Codec.encode` is checked; messages of separate processes are checked where
no other client publishes. Without the schemas nothing is checked.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import pytest

from nena_shared.mqtt import Inbound
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import nearest_codec, version_of
from support.reference import is_there
from support.schemas import schema_problems

LEVELS = 4
"""Levels of a topic that name the robot and the subject."""


class Publications:
    """Schema violations of the messages written since the last check."""

    def __init__(self) -> None:
        self.problems: list[str] = []
        self.count = 0
        self._seen: set[int] = set()

    def look(self, version: str, topic: Topic, payload: bytes) -> None:
        """Check a message, unless the same one was checked before."""
        self.count += 1
        if (known := hash((version, topic, payload))) in self._seen:
            return
        self._seen.add(known)
        found = schema_problems(version, topic, payload)
        self.problems += [f"{topic} of {version}: {each} in {payload[:300]!r}" for each in found]

    def take(self) -> list[str]:
        """Return and clear the violations."""
        found, self.problems = self.problems, []
        return found


@contextmanager
def watched() -> Iterator[Publications]:
    """Check all messages encoded in this process until the block ends."""
    publications, encode = Publications(), Codec.encode
    if not is_there("vda5050-schemas"):
        yield publications
        return

    def checked(self: Codec, message: Header) -> bytes:
        payload = encode(self, message)
        topic = next(topic for topic, kind in self.kinds.items() if isinstance(message, kind))
        publications.look(self.version, topic, payload)
        return payload

    patch = pytest.MonkeyPatch()
    patch.setattr(Codec, "encode", checked)
    yield publications
    patch.undo()


def robots_problems(messages: Iterable[Inbound]) -> list[str]:
    """Return :func:`problems_in` of the robots' messages only, as tests may send them anything."""
    said = (Topic.STATE, Topic.CONNECTION, Topic.FACTSHEET, Topic.VISUALIZATION)
    return problems_in(each for each in messages if each.topic.rsplit("/", 1)[-1] in said)


def problems_in(messages: Iterable[Inbound]) -> list[str]:
    """Return the schema violations of published messages."""
    publications = Publications()
    if not is_there("vda5050-schemas"):
        return []
    for each in messages:
        levels = each.topic.split("/")
        version = version_of(each.payload)
        codec = nearest_codec(version) if version else None
        if codec and len(levels) >= LEVELS and levels[-1] in set(Topic):
            publications.look(codec.version, Topic(levels[-1]), each.payload)
    return publications.take()
