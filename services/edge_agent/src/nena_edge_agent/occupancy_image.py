"""Convert an occupancy grid to a small PNG whose colour the viewer chooses."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

UNKNOWN: Final = 255
"""-1 as a byte: unexplored."""
SURE: Final = 100
"""Something is there for certain."""
UNKNOWN_OPACITY: Final = 40

_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_PALETTE: Final = bytes(3 * 256)
_OPACITIES: Final = bytes(
    UNKNOWN_OPACITY if value > SURE else round(value / SURE * 255) for value in range(256)
)
_RANKS: Final = bytes((value + 1) % 256 if value <= SURE or value == UNKNOWN else 0 for value in range(256))
"""Unknown 0, free 1, surely occupied 101: the greater one counts where cells are drawn together."""
_VALUES: Final = bytes((rank - 1) % 256 for rank in range(256))


@dataclass(frozen=True, slots=True)
class OccupancyImage:
    """A PNG image, and how many cells each of its pixels is wide."""

    png: bytes
    cells_per_pixel: int


def occupancy_image(cells: bytes, width: int, height: int, *, side_limit: int) -> OccupancyImage:
    """Draw the cells of a nav_msgs/OccupancyGrid: rows from the lower left, 0 to 100, or -1 for unknown.

    Where a side has more than ``side_limit`` cells, several make one pixel, which shows what is most surely
    occupied of them.

    Raises:
        ValueError: there are not ``width`` times ``height`` cells, or none.

    """
    if width < 1 or height < 1 or len(cells) != width * height:
        message = f"{len(cells)} cells are no grid of {width} by {height}"
        raise ValueError(message)
    factor = -(-max(width, height) // side_limit)
    rows = list(_rows(cells, width, factor))
    header = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, 3, 0, 0, 0)
    lines = b"".join(b"\0" + row for row in reversed(rows))
    chunks = ((b"IHDR", header), (b"PLTE", _PALETTE), (b"tRNS", _OPACITIES), (b"IDAT", zlib.compress(lines)))
    return OccupancyImage(_SIGNATURE + b"".join(_chunk(*each) for each in (*chunks, (b"IEND", b""))), factor)


def _rows(cells: bytes, width: int, factor: int) -> Iterator[bytes]:
    """Return the rows of pixels, the lowest first."""
    if factor == 1:
        yield from (cells[at : at + width] for at in range(0, len(cells), width))
        return
    ranks = cells.translate(_RANKS)
    for start in range(0, len(cells), width * factor):
        several = [
            ranks[at : at + width] for at in range(start, min(start + width * factor, len(cells)), width)
        ]
        row = several[0] if len(several) == 1 else bytes(map(max, *several))
        row += bytes(-width % factor)
        yield bytes(map(max, *(row[at::factor] for at in range(factor)))).translate(_VALUES)


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
