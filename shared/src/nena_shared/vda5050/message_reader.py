"""Reads what robots say, in the version that each of them speaks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.versions import reader_of

TOPICS_REMEMBERED = 20_000


class Versioned(Protocol):
    """A message that says in which version it is written."""

    @property
    def version(self) -> str:
        """Major, minor and patch number."""


M = TypeVar("M", bound=Versioned)
Decode = Callable[[Codec, bytes], M]
"""Reads a message of a codec's version; raises MalformedMessageError."""


class MessageReader:
    """Expects of each topic the version that it had before, and so needs not look for it in every message."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[str, Codec]] = {}
        """The version as the last message wrote it, and its codec, by topic."""

    def read(self, decode: Decode[M], topic: str, payload: bytes, major_version: str) -> M:
        """Read a message.

        Raises:
            MalformedMessageError: it is none, in the version that it names.

        """
        known = self._known.get(topic)
        if known is not None:
            version, codec = known
            try:
                message = decode(codec, payload)
            except MalformedMessageError:
                del self._known[topic]  # perhaps it speaks another version now
            else:
                if message.version == version:
                    return message
        return self._read_anew(decode, topic, payload, major_version)

    def _read_anew(self, decode: Decode[M], topic: str, payload: bytes, major_version: str) -> M:
        codec = reader_of(payload, major_version)
        message = decode(codec, payload)
        if len(self._known) >= TOPICS_REMEMBERED:
            self._known.clear()
        self._known[topic] = message.version, codec
        return message
