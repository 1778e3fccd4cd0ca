"""Read messages of robots and fleet controls, with repairs where the meaning is certain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, TypeVar

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD, Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.records import RECORDED, parse, read_record, record_of
from nena_shared.vda5050.repair import (
    EVERYWHERE,
    Repair,
    RepairKind,
    Repairs,
    Scope,
    repair,
    repairs_of,
    version_number,
    without_mark,
    written,
)
from nena_shared.vda5050.versions import load_codecs, reader_for, reader_of

TOPICS_REMEMBERED = 20_000

M = TypeVar("M", bound=Header)
Report = Callable[[str, tuple[Repair, ...]], None]
"""Receives the topic of a message that deviates from the standard, and its repairs."""


def _ignore(_topic: str, _repairs: tuple[Repair, ...]) -> None:
    pass


@dataclass(slots=True)
class _KnownReader:
    """Version and deviations of the last message on a topic."""

    version: str
    """As written in the header."""
    codec: Codec
    deviations: frozenset[str]
    """Paths of the repaired fields; checked first in the next message."""


class MessageReader:
    """Reads the messages of many robots.

    The version of each topic is remembered, which is faster than looking for it in each message. A message
    that violates the standard is repaired if that is safe, and reported to ``report``; a ``strict`` reader
    rejects it.
    """

    def __init__(self, report: Report = _ignore, *, strict: bool = False) -> None:
        load_codecs()
        self._report = report
        self._strict = strict
        self._known: dict[str, _KnownReader] = {}
        """Keyed by topic."""
        self.undated = False
        """Whether the last message had no readable timestamp; its time of arrival was used instead."""

    def read(self, kind: type[M], topic: str, payload: bytes, major_version: str) -> M:
        """Read a message in the version of its header (section 7.2).

        Raises:
            MalformedMessageError: the message violates the standard and cannot be repaired.
        """
        self.undated = False
        known = self._known.get(topic)
        if known is not None and known.deviations:
            message = self._repaired(kind, topic, payload, major_version)
            if message is not None:
                return message
        if known is not None:
            try:
                message = _read(kind, known.codec, payload)
            except MalformedMessageError:
                del self._known[topic]  # its version may have changed
            else:
                if message.version == known.version:
                    known.deviations = EVERYWHERE
                    return message
        return self._read_unexpected(kind, topic, payload, major_version)

    def _read_unexpected(self, kind: type[M], topic: str, payload: bytes, major_version: str) -> M:
        """Read a message whose version is not known yet or has changed."""
        codec = reader_of(payload, major_version)
        try:
            message = _read(kind, codec, payload)
        except MalformedMessageError:
            repaired = None if self._strict else self._repaired(kind, topic, payload, major_version)
            if repaired is None:
                raise
            return repaired
        self._learn(topic, _KnownReader(message.version, codec, EVERYWHERE))
        return message

    def _repaired(self, kind: type[M], topic: str, payload: bytes, major_version: str) -> M | None:
        """Repair and read a message; None if nothing deviates, or it is not a JSON object.

        Raises:
            MalformedMessageError: the message cannot be repaired.
        """
        found: Repairs = {}
        if len(payload) > MAXIMUM_PAYLOAD:
            return None
        try:
            content, exact = parse(without_mark(payload, found))
        except ValueError:
            return None
        if not isinstance(content, dict):
            return None
        codec = reader_for(version_number(content.get("version")), major_version)
        # NaN may be in any field, so check all of them
        usual = self._usual(topic) if exact else EVERYWHERE
        try:
            message = self._repaired_with(kind, codec, content, found, usual)
        except (ArithmeticError, ValueError, RecursionError) as error:
            if isinstance(error, MalformedMessageError):
                raise
            return None
        if message is not None:
            self._learn(topic, _KnownReader(message.version, codec, frozenset(path for path, _ in found)))
            self.undated = any(kind is RepairKind.TIME_OF_ARRIVAL for _, kind in found)
            self._report(topic, repairs_of(found))
        return message

    def _usual(self, topic: str) -> frozenset[str]:
        known = self._known.get(topic)
        return known.deviations if known else EVERYWHERE

    def _repaired_with(
        self, kind: type[M], codec: Codec, content: dict[str, Any], found: Repairs, usual: frozenset[str]
    ) -> M | None:
        """Repair the fields in ``usual`` first, and all others only if that is not enough."""
        form = codec.forms.get(kind)
        if form is None:
            return None
        now = datetime.now(UTC)
        for only in (usual, EVERYWHERE) if usual else (EVERYWHERE,):
            repair(form, content, found, version=codec.version, now=now, scope=Scope.REPORT, only=only)
            try:
                if found:
                    return _read_repaired(kind, codec, content)
            except MalformedMessageError:
                if only is EVERYWHERE:
                    raise
        return None

    def _learn(self, topic: str, known: _KnownReader) -> None:
        if topic not in self._known and len(self._known) >= TOPICS_REMEMBERED:
            self._known.clear()
        before = self._known.get(topic)
        self._known[topic] = known
        if (before is None or before.version != known.version) and (unknown := _unknown_version(known)):
            self._report(topic, (unknown,))


def _read(kind: type[M], codec: Codec, payload: bytes) -> M:
    """Read a message strictly, in the version of ``codec``."""
    return read_record(kind, codec, payload) if kind in RECORDED else codec.decode(kind, payload)


def _read_repaired(kind: type[M], codec: Codec, content: dict[str, Any]) -> M | None:
    """Read a repaired message; None if a value cannot be written as JSON."""
    record = record_of(kind, codec, content) if kind in RECORDED else None
    if record is not None:
        return record
    again = written(content)
    return None if again is None else _read(kind, codec, again)


def _unknown_version(known: _KnownReader) -> Repair | None:
    """Return the deviation of an unsupported minor version, which is read as the nearest supported one."""
    minor, read_as = known.version.split(".")[:2], known.codec.version.split(".")[:2]
    if minor == read_as:
        return None
    return Repair("version", RepairKind.UNKNOWN_VERSION, f"{known.version}, read as {known.codec.version}")
