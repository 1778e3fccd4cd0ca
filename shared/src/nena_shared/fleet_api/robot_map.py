"""What a robot's own map looks like, as its agent has the broker keep it.

VDA 5050 moves maps to robots by name and does not show them; this message is NeNa's own. Its topic lies one
level below the robot's, where no filter of the standard reaches.
"""

from __future__ import annotations

import struct
from typing import Annotated, Final

from pydantic import AfterValidator, Base64Bytes, Field

from nena_shared.fleet_api.base import Resource
from nena_shared.vda5050.topics import RobotKey, TopicScheme

SIDE_LIMIT: Final = 2048
"""Pixels."""
PNG_LIMIT: Final = 2 * 1024 * 1024
"""Bytes."""
PAYLOAD_LIMIT: Final = 3 * 1024 * 1024
"""Bytes of the message."""

_BEHIND_ROBOT: Final = "/nena/map"
_PNG_HEAD: Final = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
_SIZE: Final = struct.Struct(">II")


def topic_of_map(scheme: TopicScheme, robot: RobotKey) -> str:
    """Give the topic of one robot's map."""
    return f"{scheme.interface_name}/{scheme.major_version}/{robot}{_BEHIND_ROBOT}"


def topics_of_maps(scheme: TopicScheme) -> str:
    """Give the filter for the maps of all robots."""
    return f"{scheme.interface_name}/{scheme.major_version}/+/+{_BEHIND_ROBOT}"


def robot_of_map(scheme: TopicScheme, topic: str) -> RobotKey | None:
    """Tell whose map ``topic`` is; None for a topic of another form."""
    prefix = f"{scheme.interface_name}/{scheme.major_version}/"
    levels = topic.removesuffix(_BEHIND_ROBOT).removeprefix(prefix).split("/")
    whole = (
        topic.startswith(prefix) and topic.endswith(_BEHIND_ROBOT) and len(levels) == len(RobotKey._fields)
    )
    return RobotKey(*levels) if whole else None


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


class RobotMap(Resource):
    """A map and where it lies: its lower left corner in m and rad in the plant's frame.

    The image is black; how opaque it is tells how sure something is there. What is unknown is faint.
    """

    map_id: Annotated[str, Field(max_length=1024)]
    digest: Annotated[str, Field(pattern="^[0-9a-f]{16,64}$")]
    """Another one for each other image or place."""
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
