"""Reads the messages of fleet control to a robot, repaired where their meaning is certain."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from datetime import datetime
from typing import Any, Final, TypeVar

from pydantic_core import from_json

from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD, Codec
from nena_shared.vda5050.malformed import MalformedMessageError, quoted
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.repair import (
    Repair,
    RepairKind,
    Repairs,
    Scope,
    names_in,
    repair,
    repair_map,
    repairs_of,
    respell,
    version_number,
    without_mark,
    written,
)
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import nearest_codec

H = TypeVar("H", bound=Header)

_WITHOUT_EFFECT: Final = ("NodeId", "Description", "Descriptor")
"""Ends of the names of fields that a robot need not know to execute an order."""


def read_command(
    kind: type[H], codec: Codec, payload: bytes, *, now: datetime, robot: RobotKey, maps: Collection[str] = ()
) -> tuple[H, tuple[Repair, ...]]:
    """Read a message of a fleet control, repaired if its meaning is certain; return what was repaired.

    Args:
        kind: the kind of message.
        codec: the version of the robot.
        payload: the message.
        now: time of arrival.
        robot: the robot of the topic.
        maps: the robot's maps; the only one replaces a missing mapId, and one in other letters is corrected.

    Raises:
        MalformedMessageError: it violates the standard and cannot be repaired; names only what remains.
    """
    try:
        command = codec.decode(kind, payload)
    except MalformedMessageError:
        again, repairs = _repaired_command(kind, codec, payload, now=now, robot=robot, maps=maps)
        if again is None:
            raise
    else:
        nodes = command.nodes if isinstance(command, Order) and maps else ()
        has_maps = all(node.node_position is None or node.node_position.map_id in maps for node in nodes)
        if has_maps and RobotKey(command.manufacturer, command.serial_number) == robot:
            return command, ()
        again, repairs = _repaired_command(kind, codec, payload, now=now, robot=robot, maps=maps)
        if again is None:
            return command, ()
    try:
        return codec.decode(kind, again), repairs_of(repairs)
    except MalformedMessageError as malformed:
        if ("headerId", RepairKind.REPLACED) in repairs:
            malformed.references.pop("headerId", None)  # ours, not the sender's
        raise


def _repaired_command(
    kind: type[Header], codec: Codec, payload: bytes, *, now: datetime, robot: RobotKey, maps: Collection[str]
) -> tuple[bytes | None, Repairs]:
    """Return the message with what could be repaired; None if that is nothing."""
    repairs: Repairs = {}
    form = codec.forms.get(kind)
    if form is None or len(payload) > MAXIMUM_PAYLOAD:
        return None, repairs
    try:
        content = from_json(without_mark(payload, repairs))
        if not isinstance(content, dict):
            return None, repairs
        content = respell(form, content, repairs)
        _let_topic_decide(kind, codec, content, repairs)
        for name, own in (("manufacturer", robot.manufacturer), ("serialNumber", robot.serial_number)):
            _complete(content, name, own, repairs)
            if str(content[name]) != own and str(content[name]).casefold() == own.casefold():
                repairs[name, RepairKind.LETTER_CASE] = quoted(content[name])
                content[name] = own
        nodes = content.get("nodes")
        for node in nodes if isinstance(nodes, list) else ():
            if isinstance(node, dict) and isinstance(node.get("nodePosition"), dict):
                repair_map(node["nodePosition"], maps, repairs, "nodes.nodePosition")
        _complete_edges(content, repairs)
        repair(form, content, repairs, version=codec.version, now=now, scope=Scope.COMMAND)
    except (ArithmeticError, ValueError, RecursionError):
        return None, repairs
    return (written(content) if repairs else None), repairs


def _complete_edges(content: dict[str, Any], repairs: Repairs) -> None:
    """Set missing ends of edges: each is between the nodes at its place in the order (section 6.1.1)."""
    nodes, edges = content.get("nodes"), content.get("edges")
    if not (isinstance(nodes, list) and isinstance(edges, list) and len(edges) == len(nodes) - 1):
        return
    for edge, *ends in zip(edges, nodes, nodes[1:], strict=False):
        for name, node in zip(("startNodeId", "endNodeId"), ends, strict=True):
            if isinstance(edge, dict) and isinstance(node, dict) and isinstance(node.get("nodeId"), str):
                _complete(edge, name, node["nodeId"], repairs, at="edges.")


def _complete(content: dict[str, Any], name: str, meant: str, repairs: Repairs, at: str = "") -> None:
    """Set a field that is missing, null or empty."""
    if content.get(name) in (None, ""):
        repairs[f"{at}{name}", RepairKind.REPLACED] = quoted(content[name]) if name in content else "missing"
        content[name] = meant


def _let_topic_decide(kind: type[Header], codec: Codec, content: dict[str, Any], repairs: Repairs) -> None:
    """Read a message whose header has another major version in the topic's version (section 4.2)."""
    stated = version_number(content.get("version"))
    if stated is None or f"v{stated.partition('.')[0]}" == codec.major_version:
        return
    content["version"] = codec.version
    repairs["version", RepairKind.UNKNOWN_VERSION] = f"{stated}, read as {codec.version}"
    other = nearest_codec(stated)
    if other is None or kind not in other.forms:
        return
    # to ignore a field that only the other version has would change the meaning
    foreign = names_in(other.forms[kind]) - names_in(codec.forms[kind])
    used = dict.fromkeys(name for name in _keys_in(content) if name in foreign)
    if telling := [name for name in used if not name.endswith(_WITHOUT_EFFECT)]:
        problem = (
            f"is a field of {other.version}; use topics of {other.major_version} or send {codec.version}"
        )
        raise MalformedMessageError(
            kind.__name__, [f"{name}: {problem}" for name in telling], written(content) or b""
        )


def _keys_in(value: object) -> Iterator[str]:
    if isinstance(value, dict):
        yield from value
    for part in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from _keys_in(part)
