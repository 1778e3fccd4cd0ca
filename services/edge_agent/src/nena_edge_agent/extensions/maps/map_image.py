"""The robot's map topic, converted to a small PNG whose colour the viewer chooses."""

from __future__ import annotations

import base64
import hashlib
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import atan2
from typing import TYPE_CHECKING, Any, Final

from nena_edge_agent.driver.plant_frame import PlantFrame
from nena_shared.fleet_api.plant import PNG_LIMIT, SIDE_LIMIT, MapImage
from nena_shared.log import get_logger
from nena_shared.plant.geometry import MapPose

if TYPE_CHECKING:
    from nena_edge_agent.nav2.session import RosSession


UNKNOWN: Final = 255
"""-1 as a byte: unexplored."""
SURE: Final = 100
"""Certainly occupied."""
UNKNOWN_OPACITY: Final = 40

_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
# 0026: all black; the opacity says what is there, so that the panel chooses the colour by its theme.
_PALETTE: Final = bytes(3 * 256)
_OPACITIES: Final = bytes(
    UNKNOWN_OPACITY if value > SURE else round(value / SURE * 255) for value in range(256)
)
_RANKS: Final = bytes((value + 1) % 256 if value <= SURE or value == UNKNOWN else 0 for value in range(256))
"""Unknown 0, free 1, certainly occupied 101; merged cells get the maximum."""
_VALUES: Final = bytes((rank - 1) % 256 for rank in range(256))


@dataclass(frozen=True, slots=True)
class OccupancyImage:
    """A PNG image, and the width of each pixel in cells."""

    png: bytes
    cells_per_pixel: int


def occupancy_image(cells: bytes, width: int, height: int, *, side_limit: int) -> OccupancyImage:
    """Draw the cells of a nav_msgs/OccupancyGrid: rows from the lower left, 0 to 100, or -1 for unknown.

    If a side has more than ``side_limit`` cells, several are merged into one pixel with their maximum.

    Raises:
        ValueError: there are not ``width`` times ``height`` cells, or none.
    """
    if width < 1 or height < 1 or len(cells) != width * height:
        raise ValueError(f"{len(cells)} cells do not make a grid of {width} by {height}")
    # 0026: bounded, however large the grid is; merged cells show their maximum, so no wall is lost.
    factor = -(-max(width, height) // side_limit)
    rows = list(_pixel_rows(cells, width, factor))
    header = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, 3, 0, 0, 0)
    # 0026: written with zlib alone, as robots have no imaging library. A PNG begins with the top row.
    lines = b"".join(b"\0" + row for row in reversed(rows))
    chunks = ((b"IHDR", header), (b"PLTE", _PALETTE), (b"tRNS", _OPACITIES), (b"IDAT", zlib.compress(lines)))
    return OccupancyImage(
        _SIGNATURE + b"".join(_png_chunk(*each) for each in (*chunks, (b"IEND", b""))), factor
    )


def _pixel_rows(cells: bytes, width: int, factor: int) -> Iterator[bytes]:
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


def _png_chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


log = get_logger(__name__)

CELLS_LIMIT = 64 * 1024 * 1024
"""Maximum number of cells of a grid; a larger one is refused."""


class MapWatch:
    """A node extension that calls ``on_map`` for each map whose content or position has changed."""

    def __init__(
        self,
        topic: str,
        map_id: Callable[[], str],
        frame: PlantFrame,
        on_map: Callable[[MapImage], None] = lambda _: None,
    ) -> None:
        """Prepare; ``map_id`` returns the robot's map ID, ``frame`` converts from that map to the plant."""
        self._topic = topic
        self._map_id = map_id
        self._frame = frame
        self._digest = ""
        self._handle_map = on_map

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Subscribe on a new node."""
        from nav_msgs.msg import OccupancyGrid  # noqa: PLC0415 - the loopback needs no ROS

        from nena_edge_agent.nav2.session import LATCHED  # noqa: PLC0415

        session.subscribe(node, OccupancyGrid, self._topic, LATCHED, read=self.read, handle=self._on_map)

    def read(self, grid: Any) -> MapImage | None:  # noqa: ANN401
        """Convert a nav_msgs/OccupancyGrid; return None if it is unchanged.

        Raises:
            ValueError: it is too large, or not a grid.
        """
        info, cells = grid.info, memoryview(grid.data).tobytes()
        if len(cells) > CELLS_LIMIT:
            raise ValueError(f"a map of {len(cells)} cells is too large to publish")
        corner, turn = info.origin.position, info.origin.orientation
        map_id = self._map_id()
        transform = self._frame.on(map_id)
        place = (
            corner.x,
            corner.y,
            turn.z,
            turn.w,
            info.resolution,
            info.width,
            map_id,
            transform,
        )
        digest = hashlib.blake2b(repr(place).encode() + cells, digest_size=16).hexdigest()
        if digest == self._digest:
            return None
        found = self._draw_map(info, cells, digest, map_id)
        self._digest = digest
        return found

    def _draw_map(self, info: Any, cells: bytes, digest: str, map_id: str) -> MapImage:  # noqa: ANN401
        transform = self._frame.on(map_id)
        image = occupancy_image(cells, int(info.width), int(info.height), side_limit=SIDE_LIMIT)
        if len(image.png) > PNG_LIMIT:
            raise ValueError(
                f"the picture of the map has {len(image.png)} bytes, which is too large to publish"
            )
        corner, turn = info.origin.position, info.origin.orientation
        heading = 2 * atan2(float(turn.z), float(turn.w))
        place = transform.pose_to_plant(MapPose(float(corner.x), float(corner.y), heading))
        return MapImage(
            map_id=map_id,
            digest=digest,
            resolution=transform.length_to_plant(float(info.resolution) * image.cells_per_pixel),
            x=place.x_m,
            y=place.y_m,
            theta=place.heading_rad,
            png=base64.b64encode(image.png),
        )

    def _on_map(self, found: MapImage | None) -> None:
        if found is not None:
            log.info("robot's map", map_id=found.map_id, size=found.size, bytes=len(found.png))
            self._handle_map(found)
