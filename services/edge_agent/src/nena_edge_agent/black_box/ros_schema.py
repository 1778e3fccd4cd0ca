"""Definitions of ROS message types, as MCAP files contain them (``ros2msg``)."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Final

SEPARATOR: Final = "=" * 80
_FIELD: Final = re.compile(
    r"^(?:([a-z][a-z0-9_]*)/(?:msg/)?)?([A-Z][A-Za-z0-9]*)(?:\[[^\]]*\])?\s", re.MULTILINE
)
"""A field with a message type: package, if it is another one, and name."""


def ros_schema(type_name: str) -> bytes:
    """Return the definition of a type, such as ``sensor_msgs/msg/Imu``, and of all types within it.

    Returns nothing if the installation lacks a definition: Foxglove then lists the topic without decoding it.
    """
    text = _definition(type_name)
    if text is None:
        return b""
    parts, known, waiting = [text], {type_name}, _types_in(text, type_name)
    while waiting:
        inner = waiting.pop(0)
        if inner in known:
            continue
        known.add(inner)
        found = _definition(inner)
        if found is None:
            return b""
        package, _, name = inner.split("/")
        parts.append(f"{SEPARATOR}\nMSG: {package}/{name}\n{found}")
        waiting += _types_in(found, inner)
    return "\n".join(parts).encode()


def _types_in(text: str, type_name: str) -> list[str]:
    own = type_name.split("/", 1)[0]
    return [f"{package or own}/msg/{name}" for package, name in _FIELD.findall(text)]


def _definition(type_name: str) -> str | None:
    for prefix in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        try:
            return Path(prefix, "share", f"{type_name}.msg").read_text(encoding="utf-8")
        except (OSError, ValueError):
            continue
    return None
