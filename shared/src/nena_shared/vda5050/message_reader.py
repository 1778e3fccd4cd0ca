"""Read messages of robots and fleet controls, with repairs where the meaning is certain."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, lru_cache
from typing import Any, TypeVar

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD, Codec
from nena_shared.vda5050.malformed import QUOTED, MalformedMessageError, quoted, repeated_key
from nena_shared.vda5050.records import (
    RECORDED,
    changed,
    encoded,
    parse,
    parse_members,
    read_record,
    record_of,
)
from nena_shared.vda5050.repair import (
    EVERYWHERE,
    POSITIONS,
    SUBSTITUTES,
    Repair,
    RepairKind,
    Repairs,
    Scope,
    repair,
    repair_order_id,
    repair_position,
    repairs_of,
    respell,
    version_number,
    without_mark,
    written,
)
from nena_shared.vda5050.shape import fields_of
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.units import units_in_doubt
from nena_shared.vda5050.versions import (
    CODECS,
    codec_for,
    load_codecs,
    nearest_codec,
    reader_for,
    reader_of,
    version_of,
)

TOPICS_REMEMBERED = 20_000
DEVIATIONS_REMEMBERED = 100
"""Messages in a row without a deviation after which it is forgotten; at most twice as many."""

M = TypeVar("M", bound=Header)
Report = Callable[[str, tuple[Repair, ...]], None]
"""Receives the topic of a message that deviates from the standard, and its repairs."""


@dataclass(slots=True)
class _KnownReader:
    """Version of the last message on a topic, and its recent deviations."""

    version: str
    """As written in the header."""
    codec: Codec
    deviations: frozenset[str]
    """Paths of repaired fields; in the next message only these are repaired, if that is enough."""
    seen: frozenset[str] = EVERYWHERE
    """Those in the last ``messages`` messages."""
    messages: int = 0

    def note(self, paths: frozenset[str]) -> None:
        """Count a message with deviations at ``paths``; forget the others from time to time."""
        self.messages += 1
        if not paths <= self.seen:
            self.seen |= paths
        # whole windows instead of a count for each path: a deviation lasts for one to two of them
        if self.messages == DEVIATIONS_REMEMBERED:
            self.deviations, self.seen, self.messages = self.seen, EVERYWHERE, 0


class MessageReader:
    """Reads the messages of many robots.

    The version of each topic is remembered, which is faster than looking for it in each message. A message
    that violates the standard is repaired if that is safe, and reported to ``report``; a ``strict`` reader
    rejects it.
    """

    def __init__(self, report: Report = lambda _topic, _repairs: None, *, strict: bool = False) -> None:
        load_codecs()
        self._only_map = ""
        """The map on which robots are that report none; empty: such a map is not known."""
        self._nodes: frozenset[str] = frozenset()
        self._node_by_letters: dict[str, str] = {}
        self._report = report
        self._strict = strict
        self._readers: dict[str, _KnownReader] = {}
        """Keyed by topic."""
        self._nameless: set[str] = set()
        """Topics of robots that leave out the orderId of orders, not only where there is none."""
        self._in_degrees: set[str] = set()
        """Robots whose headings are in degrees, by their topics without the last level."""
        self.undated = False
        """Whether the last message had no readable timestamp; its time of arrival was used instead."""
        self.substituted: tuple[Repair, ...] = ()
        """What the last message does not say in the standard's words, and was read as the safest value."""

    def know_plant(self, only_map: str, nodes: Iterable[str]) -> None:
        """Note what the plant decides: the only map (empty: it has none or several), the names of nodes."""
        self._only_map, self._nodes = only_map, frozenset(nodes)
        counted = Counter(name.casefold() for name in self._nodes)
        self._node_by_letters = {
            letters: name for name in self._nodes if counted[letters := name.casefold()] == 1
        }

    def codec_of(self, version: str) -> Codec:
        """Return the codec for answers to the sender of a message that was read, by its ``version``."""
        codec = nearest_codec(version)
        assert codec, "it was read in one of its major version"  # noqa: S101 - for the type
        return codec

    def read(
        self, kind: type[M], topic: str, payload: bytes, major_version: str, robot: RobotKey | None = None
    ) -> M:
        """Read a message in the version of its header (section 7.2).

        The header of another robot than that of the topic, ``robot``, is reported.

        Raises:
            MalformedMessageError: the message violates the standard and cannot be repaired.
        """
        self.undated, self.substituted = False, ()
        message = self._read(kind, topic, payload, major_version)
        found: list[Repair] = []
        # compared here, as a call for each message would cost as much as the rest of this
        if robot is not None and (
            message.serial_number != robot.serial_number or message.manufacturer != robot.manufacturer
        ):
            found += _other_names(message, robot)
        reader = self._readers.get(topic)
        # at the first message and each window: this takes longer than reading the message
        if reader is not None and not reader.messages:
            found += units_in_doubt(message)
            if key := repeated_key(payload):
                found.append(Repair(key, RepairKind.REPEATED_KEY, "twice"))
        if kind is State and (last := message.last_node_id) not in self._nodes and not self._strict:  # type: ignore[attr-defined] # it is a state
            node = self._node_by_letters.get(last.casefold())
            if node is not None:
                found.append(Repair("lastNodeId", RepairKind.LETTER_CASE, quoted(last)))
                message = changed(message, last_node_id=node)
        if found:
            self._report(topic, tuple(found))
        return message

    def _read(self, kind: type[M], topic: str, payload: bytes, major_version: str) -> M:
        reader = self._readers.get(topic)
        # a robot that deviates does so in every state: trying the strict reader first would read each twice
        deviations = reader.deviations if reader is not None else EVERYWHERE
        if kind in RECORDED and (deviations or self._is_in_degrees(topic)):
            message = self._repaired(kind, topic, payload, major_version, deviations)
            if message is not None and not self._lacks_map(message):
                return message
        if reader is not None:
            try:
                message = _read_strictly(kind, reader.codec, payload)
            except MalformedMessageError:
                pass  # its version may have changed
            else:
                if message.version == reader.version and not self._lacks_map(message):
                    reader.note(EVERYWHERE)
                    return message
        return self._read_unexpected(kind, topic, payload, major_version)

    def _read_unexpected(self, kind: type[M], topic: str, payload: bytes, major_version: str) -> M:
        """Read a message whose version is not known yet or has changed."""
        codec = reader_of(payload, major_version)
        try:
            message = _read_strictly(kind, codec, payload)
        except MalformedMessageError:
            repaired = None
            if not self._strict:
                repaired = self._repaired(kind, topic, payload, major_version, EVERYWHERE)
            if repaired is None:
                raise
            return repaired
        if self._lacks_map(message):
            return self._repaired(kind, topic, payload, major_version, EVERYWHERE) or message
        self._learn_repairs(topic, _KnownReader(message.version, codec, EVERYWHERE))
        return message

    def _lacks_map(self, message: Header) -> bool:
        position = getattr(message, "mobile_robot_position", None) if self._only_map else None
        if position is None or position.map_id == self._only_map or self._strict:
            return False
        return position.map_id.casefold() in ("", self._only_map.casefold())

    def _repaired(
        self, kind: type[M], topic: str, payload: bytes, major_version: str, only: frozenset[str]
    ) -> M | None:
        """Repair and read a message, all fields if those in ``only`` are not enough.

        Returns None if no field in ``only`` deviates, or the message is not a JSON object.

        Raises:
            MalformedMessageError: the message cannot be repaired.
        """
        repairs: Repairs = {}
        if len(payload) > MAXIMUM_PAYLOAD:
            return None
        try:
            content = _parse(kind, without_mark(payload, repairs), major_version, repairs, only)
            if not isinstance(content, dict):
                return None
            stated = version_number(content.get("version"))
            codec = reader_for(stated, major_version)
            _check_form(kind, content, major_version)
            # Robots copy 1.3.2, the example in the schemas of 2.x, or send the version of their software:
            # for another major version, the topic decides (VDA 5050 3.0, 4.2).
            if stated and f"v{stated.partition('.')[0]}" != major_version:
                content["version"] = codec.version
                repairs["version", RepairKind.UNKNOWN_VERSION] = f"{stated}, read as {codec.version}"
            if kind is State and topic not in self._nameless and not repair_order_id(content, repairs):
                self._nameless.add(topic)
            if kind in RECORDED:
                self._repair_position(topic, content, repairs)
            message = _repaired_in(kind, codec, content, repairs, only)
        except MalformedMessageError:
            if only:
                return self._repaired(kind, topic, payload, major_version, EVERYWHERE)
            raise
        except (ArithmeticError, ValueError, RecursionError):
            return None
        if message is not None:
            self._learn_deviations(topic, message.version, codec, repairs)
            self.undated = ("timestamp", RepairKind.TIME_OF_ARRIVAL) in repairs
            found = repairs_of(repairs)
            self.substituted = tuple(repair for repair in found if repair.kind in SUBSTITUTES)
            self._report(topic, found)
        return message

    def sighting(self, topic: str, payload: bytes, major_version: str) -> State | None:
        """Return what an unreadable state says about the robot itself, such as its position.

        Its order is unknown: required fields that cannot be read are empty. None if the payload is not a JSON
        object. The form is that of the header's version or, if that has no position, of the topic's or
        another major version.
        """
        stated, state = version_of(payload), None
        majors = dict.fromkeys([major_version, *(CODECS[version].major_version for version in CODECS)])
        newest = (reader_for(None, major) for major in majors)
        for codec in (nearest_codec(stated) if stated else None, *newest):
            state = state if codec is None else self._sighting_in(codec, topic, payload)
            if state and state.mobile_robot_position:
                break
        return state

    def _sighting_in(self, codec: Codec, topic: str, payload: bytes) -> State | None:
        if len(payload) > MAXIMUM_PAYLOAD:
            return None
        try:
            # a text in another encoding, such as Latin-1, does not hide the position
            content = parse(without_mark(payload, {}).decode(errors="replace").encode())
            if not isinstance(content, dict):
                return None
            content["version"], at = codec.version, datetime.now(UTC)
            self._repair_position(topic, content, {})
            repair(codec.forms[State], content, {}, version=codec.version, now=at, scope=Scope.SIGHTING)
            return _read_repaired(State, codec, content)
        except (MalformedMessageError, ArithmeticError, ValueError, RecursionError):
            return None

    def _is_in_degrees(self, topic: str) -> bool:
        return bool(self._in_degrees) and topic.rpartition("/")[0] in self._in_degrees

    def _repair_position(self, topic: str, content: dict[str, Any], repairs: Repairs) -> None:
        known = self._is_in_degrees(topic)
        if repair_position(content, repairs, in_degrees=known, only_map=self._only_map) and not known:
            if len(self._in_degrees) >= TOPICS_REMEMBERED:
                self._in_degrees.clear()  # learnt again with a heading beyond a full turn
            self._in_degrees.add(topic.rpartition("/")[0])

    def _learn_deviations(self, topic: str, version: str, codec: Codec, repairs: Repairs) -> None:
        paths = frozenset([path for path, _ in repairs])
        reader = self._readers.get(topic)
        if reader is not None:
            if version == reader.version and paths <= reader.deviations:
                reader.note(paths)
                return
            paths |= reader.deviations
        self._learn_repairs(topic, _KnownReader(version, codec, paths))

    def _learn_repairs(self, topic: str, reader: _KnownReader) -> None:
        if topic not in self._readers and len(self._readers) >= TOPICS_REMEMBERED:
            self._readers.clear()  # learnt again with the next messages
            self._nameless.clear()
        previous = self._readers.get(topic)
        self._readers[topic] = reader
        if previous is not None and previous.version == reader.version:
            return
        # a version that differs in its patch number only has the same messages, and is no deviation
        if reader.version.split(".")[:2] != reader.codec.version.split(".")[:2]:
            received = f"{reader.version}, read as {reader.codec.version}"
            self._report(topic, (Repair("version", RepairKind.UNKNOWN_VERSION, received),))


def _other_names(message: Header, robot: RobotKey) -> Iterator[Repair]:
    """Yield what the header says of another robot than the topic, which decides."""
    for field, said, meant in (
        ("serialNumber", message.serial_number, robot.serial_number),
        ("manufacturer", message.manufacturer, robot.manufacturer),
    ):
        if said and said != meant:
            alike = said.casefold() == meant.casefold()
            yield Repair(field, RepairKind.LETTER_CASE if alike else RepairKind.REPLACED, quoted(said))


def _read_strictly(kind: type[M], codec: Codec, payload: bytes) -> M:
    """Read a message strictly, in the version of ``codec``."""
    return read_record(kind, codec, payload) if kind in RECORDED else codec.decode(kind, payload)


def _check_form(kind: type[Header], content: dict[str, Any], major_version: str) -> None:
    """Raise MalformedMessageError for a message in the form of another major version than its topic's."""
    if content and content.keys().isdisjoint(_members_of(kind)):
        names = ", ".join(map(quoted, content))
        problem = f"message: has no field of a message of this topic, but {names[:QUOTED]}"
        raise MalformedMessageError(kind.__name__, [problem])
    own, others = _telling_members(kind, major_version)
    if content.keys().isdisjoint(others) or not content.keys().isdisjoint(own):
        return
    name = next(name for name in others if name in content)
    problem = (
        f"message: has {name}, a field of VDA 5050 {others[name]}.x, but is on a topic of {major_version}: "
        f"let the robot use topics of v{others[name]}, or messages of {major_version[1:]}.x"
    )
    raise MalformedMessageError(kind.__name__, [problem])


@cache
def _members_of(kind: type[Header]) -> frozenset[str]:
    """Return the members of a message in all versions."""
    forms = (codec_for(version).forms.get(kind) for version in CODECS)
    return frozenset(name for form in forms if form for field in fields_of(form) for name in field.wire)


@cache
def _telling_members(kind: type[Header], major_version: str) -> tuple[frozenset[str], dict[str, str]]:
    """Return the members that only this major version has, and others' with their major version."""
    own: set[str] = set()
    others: dict[str, str] = {}
    for codec in map(codec_for, CODECS):
        form = codec.forms.get(kind)
        names = [name for field in fields_of(form) for name in field.wire] if form else []
        if codec.major_version == major_version:
            own.update(names)
        else:
            others |= dict.fromkeys(names, codec.major_version[1:])
    return frozenset(own - others.keys()), {name: others[name] for name in others if name not in own}


@lru_cache(maxsize=10_000)
def _members_read_for(paths: frozenset[str]) -> frozenset[str]:
    """Return the members of a message that a repair of the fields at ``paths`` reads."""
    members = {path.partition(".")[0] for path in paths}
    lists = {"nodeStates", "edgeStates"} if "orderId" in members else set()
    return frozenset(members | lists | POSITIONS | {"version", "orderId"})


def _parse(
    kind: type[Header], text: bytes, major_version: str, repairs: Repairs, only: frozenset[str]
) -> Any:  # noqa: ANN401 - JSON
    """Parse the members in ``only``, or all with the names of the standard."""
    if only:
        return parse_members(text, _members_read_for(only))
    form = reader_for(None, major_version).forms.get(kind)
    return respell(form, parse(text), repairs) if form else parse(text)


def _repaired_in(
    kind: type[M], codec: Codec, content: dict[str, Any], repairs: Repairs, only: frozenset[str]
) -> M | None:
    """Repair the fields in ``only``, or all, and read the message; None if none of them deviates."""
    form = codec.forms.get(kind)
    if form is None:
        return None
    at = datetime.now(UTC)
    repair(form, content, repairs, version=codec.version, now=at, scope=Scope.REPORT, only=only)
    return _read_repaired(kind, codec, content) if repairs else None


def _read_repaired(kind: type[M], codec: Codec, content: dict[str, Any]) -> M | None:
    """Read a repaired message; None if a value cannot be written as JSON."""
    again = encoded(content)
    if again is None:
        record = record_of(kind, codec, content) if kind in RECORDED else None
        if record is not None:
            return record
        again = written(content)
    return None if again is None else _read_strictly(kind, codec, again)
