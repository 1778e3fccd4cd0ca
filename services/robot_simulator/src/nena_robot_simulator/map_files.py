"""Reads maps as map_server does: a YAML file and a greyscale image (PGM) beside it."""

from __future__ import annotations

import re
from pathlib import Path

from nena_robot_simulator.motion import FREE, OCCUPIED, GridMap

NO_FILE, BAD_IMAGE, BAD_DESCRIPTION = 1, 2, 3
_ENTRY = re.compile(r"^(?P<key>[a-z_]+)\s*:\s*(?P<value>.*?)\s*(#.*)?$", re.MULTILINE)
_PGM = re.compile(rb"P5\s+(?:#.*\n)*(\d+)\s+(\d+)\s+(\d+)\s")
DARK = 127
"""Grey values below are walls."""


class BadMapError(Exception):
    """The map cannot be used; ``result`` is that of nav2_msgs/srv/LoadMap."""

    def __init__(self, result: int) -> None:
        super().__init__(f"result {result}")
        self.result = result


def read_map(path: str) -> GridMap:
    """Read a map.

    Raises:
        BadMapError: it is not there, or no map.

    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise BadMapError(NO_FILE) from None
    entries = {found["key"]: found["value"] for found in _ENTRY.finditer(text)}
    try:
        resolution = float(entries["resolution"])
        x, y, *_ = (float(each) for each in entries["origin"].strip("[]").split(","))
        image = Path(path).parent / entries["image"]
    except (KeyError, ValueError):
        raise BadMapError(BAD_DESCRIPTION) from None
    try:
        content = image.read_bytes()
    except OSError:
        raise BadMapError(BAD_IMAGE) from None
    header = _PGM.match(content)
    if header is None:
        raise BadMapError(BAD_IMAGE)
    width, height = int(header[1]), int(header[2])
    rows = [content[header.end() + at * width :][:width] for at in range(height)]
    cells = b"".join(bytes(OCCUPIED if grey < DARK else FREE for grey in row) for row in reversed(rows))
    if len(cells) != width * height:
        raise BadMapError(BAD_IMAGE)
    return GridMap(width=width, height=height, resolution=resolution, origin_x=x, origin_y=y, cells=cells)
