"""The plant as hosts see and change it: plant model, paths, zone sets, maps of robots."""

from __future__ import annotations

import struct
from enum import StrEnum
from typing import Annotated, Final

from pydantic import AfterValidator, Base64Bytes, Field

from nena_shared.fleet_api.base import Resource
from nena_shared.vda5050.zone_set import ZoneSet


class PlantModelChange(Resource):
    """What has become of a plant model that was sent."""

    name: str
    changed: bool
    """Whether it is in use now; false: it was only checked."""
    points: int
    paths: int
    locations: int
    blocks: int
    vehicles: int
    warnings: tuple[str, ...] = ()


class PathStatus(Resource):
    """State of one path."""

    name: str
    source_point: str
    destination_point: str
    locked: bool
    """Whether new routes keep off it."""
    locked_in_plant_model: bool
    """The value unless a host has set another one."""


LONGEST_ID = 200
"""Characters of a zoneSetId here; the standard has no bound, a store and a path have."""


def _addressed(zone_set: ZoneSet) -> ZoneSet:
    name = zone_set.zone_set_id
    if not 1 <= len(name) <= LONGEST_ID or not name.isprintable() or "/" in name:
        message = f"zoneSetId must have 1 to {LONGEST_ID} printable characters and no '/'"
        raise ValueError(message)
    return zone_set


StoredZoneSet = Annotated[ZoneSet, AfterValidator(_addressed)]
"""A zone set that can be stored and queried by its ID."""


class ZoneSetPhase(StrEnum):
    """State of a zone set at one robot."""

    ENABLED = "ENABLED"
    DISABLED = "DISABLED"
    """It exists but is not in use."""
    MISSING = "MISSING"
    """It is not there."""
    UNKNOWN = "UNKNOWN"
    """The robot has sent no state."""


class ZoneSetAtVehicle(Resource):
    """A zone set at one robot."""

    vehicle: str
    phase: ZoneSetPhase
    note: str = ""
    """The last attempt and its result, as text."""


class ZoneSetStatus(Resource):
    """A zone set that a host has put here."""

    zone_set_id: str
    map_id: str
    zones: int
    enabled: bool
    """Whether robots are to use it."""
    deleted: bool
    """Whether robots are to delete it."""
    vehicles: tuple[ZoneSetAtVehicle, ...]
    """Robots that support zone sets; those of VDA 5050 2.x do not."""


class ZoneSetList(Resource):
    """All zone sets."""

    zone_sets: tuple[ZoneSetStatus, ...]


SIDE_LIMIT: Final = 2048
"""Pixels."""
PNG_LIMIT: Final = 2 * 1024 * 1024
"""Bytes."""
PAYLOAD_LIMIT: Final = 3 * 1024 * 1024
"""Bytes of the message."""

_PNG_HEAD: Final = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
_SIZE: Final = struct.Struct(">II")


def png_size(image: bytes) -> tuple[int, int] | None:
    """Read width and height in pixels from the head of a PNG image; None: it is none."""
    if not image.startswith(_PNG_HEAD) or len(image) < len(_PNG_HEAD) + _SIZE.size:
        return None
    width, height = _SIZE.unpack_from(image, len(_PNG_HEAD))
    return width, height


def _png(image: bytes) -> bytes:
    size = png_size(image)
    if size is None or len(image) > PNG_LIMIT or not all(0 < side <= SIDE_LIMIT for side in size):
        message = f"must be a PNG image of at most {SIDE_LIMIT} pixels a side and {PNG_LIMIT} bytes"
        raise ValueError(message)
    return image


class MapImage(Resource):
    """A map and its position: its lower left corner in m and rad in the plant's frame.

    The image is black; its opacity is the probability of an obstacle. Unknown areas are faint.
    """

    map_id: Annotated[str, Field(max_length=1024)]
    digest: Annotated[str, Field(pattern="^[0-9a-f]{16,64}$")]
    """Differs for each image and position."""
    resolution: Annotated[float, Field(gt=0)]
    """m per pixel."""
    x: float
    y: float
    theta: float
    png: Annotated[Base64Bytes, AfterValidator(_png)]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return png_size(self.png) or (0, 0)
