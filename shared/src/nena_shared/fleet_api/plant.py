"""Plant model, paths, zone sets and robots' maps in the API."""

from __future__ import annotations

import struct
from enum import StrEnum
from typing import Annotated, Final

from pydantic import AfterValidator, Base64Bytes, BeforeValidator, Field
from pydantic_core import to_json

from nena_shared.fleet_api.base import ObjectName, PageSize, Request, Resource
from nena_shared.fleet_api.stops import Person, SetBy
from nena_shared.vda5050.zone_set import ZoneSet, ZoneType


class PlantModelChange(Resource):
    """Result of uploading a plant model."""

    name: str
    changed: bool
    """Whether it is now in use; false: it was only validated."""
    points: int
    paths: int
    locations: int
    blocks: int
    vehicles: int
    warnings: tuple[str, ...] = ()


class PathStatus(Resource):
    """State of a path."""

    name: str
    source_point: str
    destination_point: str
    locked: bool
    """Whether new routes avoid it."""
    locked_in_plant_model: bool
    """Value in the plant model, used unless a host sets another one."""
    stop: str | None = None
    """The stop whose area locks it; None: no stop."""
    locked_by: SetBy | None = None
    """Who has locked it; None: nobody, or before it was recorded."""


class PathsQuery(Resource):
    """Filter and page of paths."""

    locked: bool | None = None
    """None: locked and unlocked ones."""
    limit: PageSize | None = None
    """None: all paths, as a map needs them."""
    after: ObjectName | None = None


class PathPage(Resource):
    """A page of paths, in the order of the plant model."""

    paths: tuple[PathStatus, ...]
    next: str | None = None
    """Value of ``after`` for the next page; None: this is the last one."""


class PathLockPreviewQuery(Resource):
    """Paths that are to be locked together with the named one."""

    also: Annotated[tuple[ObjectName, ...], Field(max_length=100)] = ()


class PathLockPreview(Resource):
    """What a lock would leave without a route to its destinations, among what has one now."""

    vehicles: tuple[str, ...]
    """Vehicles with an order, from the ends of their bases."""
    orders: tuple[str, ...]
    """The orders of these vehicles, and of the 300 most urgent orders in the queue those that no vehicle
    could execute."""


class PathLockRequest(Request):
    """Request to lock or unlock a path."""

    locked: bool
    by: Person | None = None
    """Name of the person; None: the user of the request's token."""


LONGEST_ID = 200
"""Maximum length of a zoneSetId, characters; the standard has no limit, but database and URLs have."""


def _addressed(zone_set: ZoneSet) -> ZoneSet:
    name = zone_set.zone_set_id
    if not 1 <= len(name) <= LONGEST_ID or not name.isprintable() or "/" in name:
        raise ValueError(f"zoneSetId must have 1 to {LONGEST_ID} printable characters and no '/'")
    return zone_set


StoredZoneSet = Annotated[ZoneSet, AfterValidator(_addressed)]
"""A zone set that can be stored and queried by its ID."""


def _zone_set_from_json(value: object) -> ZoneSet:
    # VDA 5050's objects are strict: as Python objects, enumerations and tuples would have to be such already
    return value if isinstance(value, ZoneSet) else ZoneSet.model_validate_json(to_json(value))


ZoneSetRequest = Annotated[StoredZoneSet, BeforeValidator(_zone_set_from_json)]
"""A zone set in a request: the zoneSet object of VDA 5050 (3.0 section 7.6)."""


class ZoneSetPhase(StrEnum):
    """State of a zone set on a robot."""

    ENABLED = "ENABLED"
    DISABLED = "DISABLED"
    """Stored, but not in use."""
    MISSING = "MISSING"
    """Not stored on the robot."""
    UNKNOWN = "UNKNOWN"
    """No state received from the robot."""


class ZoneSetAtVehicle(Resource):
    """A zone set on a robot."""

    vehicle: str
    phase: ZoneSetPhase
    note: str = ""
    """Last attempt and its result, as text."""


class ZoneOutline(Resource):
    """Type and corners of a zone."""

    zone_id: str
    zone_type: ZoneType
    vertices: tuple[tuple[float, float], ...]
    """x and y of the corners, m in the project-wide frame of the map."""


class ZoneSetStatus(Resource):
    """A zone set stored by a host."""

    zone_set_id: str
    map_id: str
    zones: int
    """Number of zones."""
    outlines: tuple[ZoneOutline, ...]
    enabled: bool
    """Whether robots should use it."""
    deleted: bool
    """Whether robots should delete it."""
    vehicles: tuple[ZoneSetAtVehicle, ...]
    """Robots that support zone sets; those of VDA 5050 2.x do not."""


class ZoneSetList(Resource):
    """All zone sets."""

    zone_sets: tuple[ZoneSetStatus, ...]


# 0026: robots let several cells of larger grids share a pixel
SIDE_LIMIT: Final = 2048
"""Pixels."""
PNG_LIMIT: Final = 2 * 1024 * 1024
"""Bytes."""
# Base64 makes the largest image a third longer
PAYLOAD_LIMIT: Final = 3 * 1024 * 1024
"""Maximum size of the message, bytes."""

# signature, then length and name of the first chunk, which is always the header with the size
_PNG_HEAD: Final = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
_SIZE: Final = struct.Struct(">II")


def png_size(image: bytes) -> tuple[int, int] | None:
    """Return width and height in pixels of a PNG image; None if it is not one."""
    if not image.startswith(_PNG_HEAD) or len(image) < len(_PNG_HEAD) + _SIZE.size:
        return None
    width, height = _SIZE.unpack_from(image, len(_PNG_HEAD))
    return width, height


def _png(image: bytes) -> bytes:
    size = png_size(image)
    if size is None or len(image) > PNG_LIMIT or not all(0 < side <= SIDE_LIMIT for side in size):
        raise ValueError(f"must be a PNG image of at most {SIDE_LIMIT} pixels a side and {PNG_LIMIT} bytes")
    return image


class MapImage(Resource):
    """A robot's grid map, with the pose of its lower left corner: m and rad in the plant frame.

    The image is black; its opacity is the probability of an obstacle. Unknown areas are faint.
    """

    map_id: Annotated[str, Field(max_length=1024)]
    digest: Annotated[str, Field(pattern="^[0-9a-f]{16,64}$")]
    """Changes with image and pose."""
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
