"""Further services of Nav2's servers in the ROS graph, each only if its types are installed."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nav_msgs.msg import OccupancyGrid
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from nena_robot_simulator import faults, messages
from nena_robot_simulator.motion import FREE, OCCUPIED, GridMap
from nena_robot_simulator.robot import Robot
from nena_robot_simulator.servers import Server
from nena_robot_simulator.session import RosSession
from nena_shared.ros import interface

if TYPE_CHECKING:
    from collections.abc import Callable

    from nena_robot_simulator.server_endpoints import ServerEndpoints
    from nena_robot_simulator.settings import RobotSettings


NO_NAME, BAD_IMAGE, BAD_DESCRIPTION = 1, 2, 3
_ENTRY = re.compile(r"^(?P<key>[a-z_]+)\s*:\s*(?P<value>.*?)\s*(#.*)?$", re.MULTILINE)
_PGM = re.compile(rb"P5\s+(?:#.*\n)*(\d+)\s+(\d+)\s+(\d+)\s")
DARK = 127
"""Grey values below this are walls."""


class BadMapError(Exception):
    """The map cannot be used; ``result`` is a result code of nav2_msgs/srv/LoadMap."""

    def __init__(self, result: int) -> None:
        super().__init__(f"result {result}")
        self.result = result


def read_map(path: str) -> GridMap:
    """Read a map like map_server: a YAML file, and a greyscale image (PGM) beside it.

    A file that does not exist is a bad description, as in Nav2.

    Raises:
        BadMapError: the file does not exist or is not a map.
    """
    if not path:
        raise BadMapError(NO_NAME)
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        raise BadMapError(BAD_DESCRIPTION) from None
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
    # An image begins at the top, a map at the bottom.
    cells = b"".join(bytes(OCCUPIED if grey < DARK else FREE for grey in row) for row in reversed(rows))
    if len(cells) != width * height:
        raise BadMapError(BAD_IMAGE)
    return GridMap(width=width, height=height, resolution=resolution, origin_x=x, origin_y=y, cells=cells)


LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
TRANSFORMS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


def map_services(servers: ServerEndpoints, use: Callable[[GridMap], Any]) -> list[Any]:
    """Serve map_server's services; ``use`` switches to a map and returns its message."""
    kind = interface("nav2_msgs/srv/LoadMap")
    if kind is None:
        return []

    def load(request: Any, response: Any) -> None:  # noqa: ANN401
        try:
            found = read_map(request.map_url.removeprefix("file://"))
        except BadMapError as error:
            response.result = error.result
            return
        response.map, response.result = use(found), 0

    return [servers.serve(Server.MAPS, kind, "map_server/load_map", load)]


COSTMAPS = ("global_costmap", "local_costmap")


def costmap_services(
    session: RosSession, cleared: Callable[[str], None], shown: Callable[[Any], Any]
) -> None:
    """Serve the clearing and the reading of both costmaps; ``shown`` makes a message of its type."""
    clearing, reading = (interface(f"nav2_msgs/srv/{each}") for each in ("ClearEntireCostmap", "GetCostmap"))

    def clear(name: str, _request: object, _response: object) -> None:
        cleared(name)

    def read(_request: object, response: Any) -> None:  # noqa: ANN401
        response.map = shown(type(response.map))

    for name in COSTMAPS:
        if clearing is not None:
            session.serve(clearing, f"{name}/clear_entirely_{name}", partial(clear, name))
        if reading is not None:
            session.serve(reading, f"{name}/get_costmap", read)


def costmap_parameters(session: RosSession, footprint: str) -> None:
    """Serve the parameters of the local costmap; the response is empty unless all requested ones exist."""

    def answer(request: GetParameters.Request, response: GetParameters.Response) -> None:
        if footprint and set(request.names) == {"footprint"}:
            kind = ParameterType.PARAMETER_STRING
            response.values = [ParameterValue(type=kind, string_value=footprint)]

    session.serve(GetParameters, "local_costmap/local_costmap/get_parameters", answer)


def _of_costmap(topic: str) -> str:
    """Return the name of a costmap's topic: a relative one is in the namespace of its own node."""
    # Measured: without the mask from there, the planner plans through the zone.
    return topic if topic.startswith("/") else f"global_costmap/{topic}"


class Offers:
    """The endpoints of one robot."""

    def __init__(self, session: RosSession, robot: Robot, filter_info_topic: str | None) -> None:
        self._robot = robot
        self._session = session
        self._mask: Any = None
        if kind := interface("nav2_msgs/msg/CostmapFilterInfo"):
            topic = _of_costmap(filter_info_topic) if filter_info_topic else "zone_filter_info"
            session.subscribe(kind, topic, self._on_filter_info, LATCHED)
        self._transforms: Any = None
        self._transforms_kind: Any = interface("tf2_msgs/msg/TFMessage")
        if self._transforms_kind:
            self._transforms = session.publisher(self._transforms_kind, "tf", TRANSFORMS)
        self._collision: Any = None
        self._collision_stop: str | None = None
        self._collision_kind = interface("nav2_msgs/msg/CollisionMonitorState")
        if self._collision_kind:
            # As measured, not latched: a late subscriber does not learn that the robot is being stopped.
            self._collision = session.publisher(self._collision_kind, "collision_monitor_state", RELIABLE)
        if kind := interface("nav2_msgs/msg/SpeedLimit"):
            session.subscribe(kind, "speed_limit", self._on_speed_limit, RELIABLE)

    def _on_filter_info(self, message: Any) -> None:  # noqa: ANN401
        """Subscribe to the mask of a keep-out filter, like the costmaps."""
        # Type 0 is a keep-out filter; the others limit the speed.
        if self._mask is None and message.type == 0:
            topic = _of_costmap(message.filter_mask_topic)
            self._mask = self._session.subscribe(OccupancyGrid, topic, self._on_mask, LATCHED)

    def _on_mask(self, message: OccupancyGrid) -> None:
        info, origin = message.info, message.info.origin.position
        cells = memoryview(message.data).tobytes()
        size = {"width": info.width, "height": info.height, "resolution": info.resolution}
        self._robot.keep_out(GridMap(**size, origin_x=origin.x, origin_y=origin.y, cells=cells))

    def publish_transforms(self, settings: RobotSettings, nanoseconds: int) -> None:
        """Publish the transforms from map to odometry and from odometry to the robot."""
        if self._transforms is None or not self._transforms.get_subscription_count():
            return
        found = [(self._robot.odometry, settings.odom_frame, settings.base_frame)]
        if (origin := self._robot.map_to_odometry) is not None:
            found.append((origin, settings.map_frame, settings.odom_frame))
        transforms = [messages.transform_message(*each, nanoseconds) for each in found]
        self._transforms.publish(self._transforms_kind(transforms=transforms))

    def show_collision(self) -> None:
        """Publish the state of the collision monitor if it has changed.

        The monitor looks only while a server commands the base: a stop that ends while the robot has no goal
        stays its last word until the next one.
        """
        stop = self._robot.faults.get(faults.CollisionStop)
        polygon = stop.polygon if stop else None
        kind = self._collision_kind
        if kind is None or polygon == self._collision_stop or not self._robot.commanded:
            return
        self._collision_stop = polygon
        self._collision.publish(kind(action_type=int(polygon is not None), polygon_name=polygon or ""))

    def _on_speed_limit(self, message: Any) -> None:  # noqa: ANN401
        """Apply a limit like Regulated Pure Pursuit: one above the robot's own speed makes it faster."""
        limit = float(message.speed_limit)
        self._robot.limit_speed(limit, percentage=bool(message.percentage))
