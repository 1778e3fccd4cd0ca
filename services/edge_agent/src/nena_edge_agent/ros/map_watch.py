"""Listens to the robot's ``/map`` and tells what it looks like, for those who show where the robot is."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Callable
from math import atan2
from typing import TYPE_CHECKING, Any, Self

from nena_edge_agent.driver.plant_frame import PlantFrame
from nena_edge_agent.occupancy_image import occupancy_image
from nena_shared.fleet_api.plant import PNG_LIMIT, SIDE_LIMIT, RobotMap
from nena_shared.log import get_logger
from nena_shared.plant.geometry import MapPose, MapTransform

if TYPE_CHECKING:
    from nena_edge_agent.ros.session import RosSession
    from nena_edge_agent.settings import EdgeAgentSettings

log = get_logger(__name__)

CELLS_LIMIT = 64 * 1024 * 1024
"""Cells of a grid that are looked at."""


class MapWatch:
    """A guest of the robot's nodes; ``tell`` gets each map that looks or lies otherwise than the last."""

    def __init__(self, topic: str, map_id: str, transform: MapTransform) -> None:
        """``transform`` says how the plant lies on the robot's map ``map_id``."""
        self._topic = topic
        self._map_id = map_id
        self._transform = transform
        self._digest = ""
        self.tell: Callable[[RobotMap], None] = lambda _: None

    @classmethod
    def of(cls, settings: EdgeAgentSettings) -> Self:
        """Make the watch of a robot with these settings."""
        frame = PlantFrame.of(settings.map_transforms)
        return cls(settings.ros.names.map, settings.map_id, frame.on(settings.map_id))

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Subscribe on a new node."""
        from nav_msgs.msg import OccupancyGrid  # noqa: PLC0415 - the loopback needs no ROS

        from nena_edge_agent.ros.nav2_node import LATCHED  # noqa: PLC0415

        session.subscribe(node, OccupancyGrid, self._topic, LATCHED, read=self.read, handle=self._heard)

    def read(self, grid: Any) -> RobotMap | None:  # noqa: ANN401
        """Make the map of a nav_msgs/OccupancyGrid; None: it is the same as before.

        Raises:
            ValueError: it is too large, or no grid.

        """
        info, cells = grid.info, memoryview(grid.data).tobytes()
        if len(cells) > CELLS_LIMIT:
            message = f"a map of {len(cells)} cells is too large to be shown"
            raise ValueError(message)
        corner, turn = info.origin.position, info.origin.orientation
        place = (
            corner.x,
            corner.y,
            turn.z,
            turn.w,
            info.resolution,
            info.width,
            self._map_id,
            self._transform,
        )
        digest = hashlib.blake2b(repr(place).encode() + cells, digest_size=16).hexdigest()
        if digest == self._digest:
            return None
        found = self._drawn(info, cells, digest)
        self._digest = digest
        return found

    def _drawn(self, info: Any, cells: bytes, digest: str) -> RobotMap:  # noqa: ANN401
        image = occupancy_image(cells, int(info.width), int(info.height), side_limit=SIDE_LIMIT)
        if len(image.png) > PNG_LIMIT:
            message = f"the picture of the map has {len(image.png)} bytes, which is too much to be sent"
            raise ValueError(message)
        corner, turn = info.origin.position, info.origin.orientation
        heading = 2 * atan2(float(turn.z), float(turn.w))
        place = self._transform.pose_to_plant(MapPose(float(corner.x), float(corner.y), heading))
        return RobotMap(
            map_id=self._map_id,
            digest=digest,
            resolution=self._transform.length_to_plant(float(info.resolution) * image.cells_per_pixel),
            x=place.x_m,
            y=place.y_m,
            theta=place.heading_rad,
            png=base64.b64encode(image.png),
        )

    def _heard(self, found: RobotMap | None) -> None:
        if found is not None:
            log.info("robot's map", map_id=found.map_id, size=found.size, bytes=len(found.png))
            self.tell(found)
