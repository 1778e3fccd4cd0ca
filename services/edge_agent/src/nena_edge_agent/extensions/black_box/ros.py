"""ROS topics in the black box: messages as they arrive, and the definitions of their types."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from nena_edge_agent.actions.messages import UnknownTypeError, class_of
from nena_edge_agent.extensions.black_box.settings import RecordedTopic
from nena_shared.clock import Clock
from nena_shared.extensions.black_box.ring import Channel, Ring
from nena_shared.log import get_logger

if TYPE_CHECKING:
    from nena_edge_agent.nav2.session import RosSession

log = get_logger(__name__)

SEPARATOR: Final = "=" * 80
_FIELD: Final = re.compile(
    r"^(?:([a-z][a-z0-9_]*)/(?:msg/)?)?([A-Z][A-Za-z0-9]*)(?:\[[^\]]*\])?\s", re.MULTILINE
)
"""A field with a message type: package, if it is another one, and name."""


class RosTopicRecorder:
    """A node extension that puts the serialised messages of topics into the ring, in the ROS thread."""

    def __init__(self, topics: Iterable[RecordedTopic], ring: Ring, clock: Clock) -> None:
        self._topics = tuple(topics)
        self._ring = ring
        self._clock = clock

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401, ARG002
        """Subscribe on a new node; a topic whose type is not installed is logged and left out."""
        from nena_edge_agent.nav2.session import SENSOR  # noqa: PLC0415 - the loopback needs no ROS

        for topic in self._topics:
            try:
                kind = class_of(topic.type)
            except UnknownTypeError as error:
                log.warning("topic not recorded", topic=topic.topic, reason=str(error))
                continue
            name = node.resolve_topic_name(topic.topic)
            add = partial(self._add_message, Channel(name, topic.type))
            # Best effort and volatile matches each publisher (measured); raw: the file keeps CDR (0061).
            node.create_subscription(kind, topic.topic, add, SENSOR, raw=True)

    def _add_message(self, channel: Channel, message: bytes) -> None:
        self._ring.add(channel, message, self._clock.monotonic())


def ros_schema(type_name: str) -> bytes:
    """Return the definition of a type, such as ``sensor_msgs/msg/Imu``, and of all types within it.

    Returns nothing if the installation lacks a definition: Foxglove then lists the topic without decoding it.
    """
    text = _definition_of(type_name)
    if text is None:
        return b""
    parts, known, waiting = [text], {type_name}, _types_in(text, type_name)
    while waiting:
        inner = waiting.pop(0)
        if inner in known:
            continue
        known.add(inner)
        found = _definition_of(inner)
        if found is None:
            return b""
        package, _, name = inner.split("/")
        parts.append(f"{SEPARATOR}\nMSG: {package}/{name}\n{found}")
        waiting += _types_in(found, inner)
    return "\n".join(parts).encode()


def _types_in(text: str, type_name: str) -> list[str]:
    own = type_name.split("/", 1)[0]
    return [f"{package or own}/msg/{name}" for package, name in _FIELD.findall(text)]


def _definition_of(type_name: str) -> str | None:
    # ROS from Python wheels lies in the environment of the interpreter.
    for prefix in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        try:
            return Path(prefix, "share", f"{type_name}.msg").read_text(encoding="utf-8")
        except (OSError, ValueError):
            continue
    return None
