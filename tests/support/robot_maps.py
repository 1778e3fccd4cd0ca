"""Maps of robots for tests."""

from __future__ import annotations

from base64 import b64encode
from typing import Any

from nena_edge_agent.extensions.maps.map_image import occupancy_image
from nena_shared.fleet_api.plant import SIDE_LIMIT, MapImage


def room(width: int = 40, height: int = 20) -> bytes:
    """Return the cells of an empty room with walls around it."""
    row = bytes([100]) + bytes(width - 2) + bytes([100])
    return bytes([100]) * width + row * (height - 2) + bytes([100]) * width


def robot_map(
    digest: str = "0123456789abcdef", *, width: int = 40, height: int = 20, unknown: int = 0, **fields: Any
) -> MapImage:
    """Return the map of such a room with cells of 0.5 m, changed by ``fields``.

    The ``unknown`` columns on the right have not been seen.
    """
    rows = (room(width, height)[at : at + width - unknown] for at in range(0, width * height, width))
    cells = b"".join(row + bytes([255]) * unknown for row in rows)
    png = occupancy_image(cells, width, height, side_limit=SIDE_LIMIT).png
    content = {"map_id": "hall", "resolution": 0.5, "x": 0.0, "y": 0.0, "theta": 0.0, **fields}
    return MapImage.model_validate({"digest": digest, "png": b64encode(png), **content})
