"""Robots' maps for tests: drawn with walls, written as map_saver does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

FREE, OCCUPIED, UNKNOWN = 254, 0, 205
CELL = 0.05
"""Side of a cell, m."""

Pixels = NDArray[np.uint8]


def hall(width: float, height: float, *, margin: float = 1.0) -> Pixels:
    """Return a hall with walls of 0.2 m in unknown surroundings; all in m, row 0 at the top."""
    columns, rows = round((width + 2 * margin) / CELL), round((height + 2 * margin) / CELL)
    image = np.full((rows, columns), UNKNOWN, dtype=np.uint8)
    edge, wall = round(margin / CELL), round(0.2 / CELL)
    image[edge - wall : rows - edge + wall, edge - wall : columns - edge + wall] = OCCUPIED
    image[edge : rows - edge, edge : columns - edge] = FREE
    return image


def block(  # noqa: PLR0917
    image: Pixels, x: float, y: float, width: float, height: float, value: int = OCCUPIED
) -> None:
    """Fill a rectangle; its upper left corner is ``x, y`` m from that of the image."""
    image[round(y / CELL) : round((y + height) / CELL), round(x / CELL) : round((x + width) / CELL)] = value


def warehouse() -> Pixels:
    """Return a hall of 30 m by 20 m with racks, aisles of 2.8 m, and open places at both ends."""
    image = hall(30, 20)
    for row in range(4):
        block(image, 7, 4 + row * 4, 18, 1.2)
    return image


def office() -> Pixels:
    """Return a corridor of 1.2 m with six rooms behind doors of 1.1 m."""
    image = hall(24, 11)
    for y in (5.7, 7.1):
        block(image, 1, y, 24, 0.2)
    for number in range(3):
        x = 1 + number * 8
        for y, height in ((1, 4.7), (7.3, 4.7)):
            block(image, x + 7.8, y, 0.2, height)
        for y in (5.7, 7.1):
            block(image, x + 3, y, 1.1, 0.2, FREE)
    return image


def write_map(folder: Path, pixels: Pixels, *, name: str = "site", **values: object) -> Path:
    """Write a map as map_saver does; ``values`` replace those of its YAML file."""
    Image.fromarray(pixels).save(folder / f"{name}.pgm")
    fields = {
        "image": f"{name}.pgm",
        "mode": "trinary",
        "resolution": CELL,
        "origin": "[0.0, 0.0, 0.0]",
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.25,
        **values,
    }
    path = folder / f"{name}.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in fields.items()), encoding="utf-8")
    return path
