"""Keep-out areas, published as a mask for Nav2's costmaps."""

from __future__ import annotations

import array
import asyncio
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from nena_edge_agent.driver.port import Area, KeepOutReport, SessionState
from nena_edge_agent.nav2.offers import FILTER_INFO, interface
from nena_edge_agent.nav2.presence import DISCOVERY
from nena_edge_agent.nav2.settings import RosNames, RosSettings
from nena_shared.log import get_logger

if TYPE_CHECKING:
    from nena_edge_agent.nav2.session import RosSession

log = get_logger(__name__)

CELLS_LIMIT = 4_000_000
"""Maximum number of cells of a mask; beyond it, the cells become larger."""
CLOSED = 100
"""Value of a cell that must not be entered."""
KEEP_OUT = 0
"""Type of the filter in nav2_msgs/CostmapFilterInfo."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Mask:
    """Square cells in rows from the lower left corner, as in nav_msgs/OccupancyGrid: m."""

    x: float
    y: float
    resolution: float
    width: int
    height: int
    cells: bytes


NOTHING = Mask(0.0, 0.0, 1.0, 1, 1, b"\0")


def mask_of(polygons: Sequence[Sequence[Point]], resolution: float) -> Mask:
    """Return the mask of all cells that a polygon touches; it extends no further than the polygons."""
    points = [point for polygon in polygons for point in polygon]
    if not points:
        return NOTHING
    least_x, least_y = min(x for x, _ in points), min(y for _, y in points)
    wide, high = max(x for x, _ in points) - least_x, max(y for _, y in points) - least_y
    # The last term is for an area without width: its rows alone could be too many.
    cell = max(resolution, math.sqrt(wide * high / CELLS_LIMIT), max(wide, high) / CELLS_LIMIT)
    width, height = int(wide / cell) + 1, int(high / cell) + 1
    rows = [bytearray(width) for _ in range(height)]
    for polygon in polygons:
        corners = [((x - least_x) / cell, (y - least_y) / cell) for x, y in polygon]
        sides = list(pairwise([*corners, corners[0]]))
        _fill_areas(rows, sides)
        _draw_sides(rows, sides)
    return Mask(least_x, least_y, cell, width, height, b"".join(rows))


def _fill_areas(rows: list[bytearray], sides: list[tuple[Point, Point]]) -> None:
    """Close the cells whose centre is inside."""
    for number, row in enumerate(rows):
        middle = number + 0.5
        cuts = sorted(
            x1 + (middle - y1) * (x2 - x1) / (y2 - y1)
            for (x1, y1), (x2, y2) in sides
            if (y1 > middle) != (y2 > middle)
        )
        for start, end in zip(cuts[::2], cuts[1::2], strict=False):
            first, last = math.ceil(start - 0.5), math.floor(end - 0.5)
            if first <= last:
                row[first : last + 1] = bytes([CLOSED]) * (last + 1 - first)


def _draw_sides(rows: list[bytearray], sides: Iterable[tuple[Point, Point]]) -> None:
    """Close the cells that a side crosses: a narrow area may contain no cell's centre."""
    for (x1, y1), (x2, y2) in sides:
        steps = int(2 * math.dist((x1, y1), (x2, y2))) + 1
        for step in range(steps + 1):
            share = step / steps
            column, row = int(x1 + share * (x2 - x1)), int(y1 + share * (y2 - y1))
            rows[min(row, len(rows) - 1)][min(column, len(rows[0]) - 1)] = CLOSED


NO_COSTMAPS = ("_", "rosbag2_")
"""Beginnings of the names of nodes that only show or record messages: command line tools, recorders."""


def unused_mask(node: Any, names: RosNames, *own: str) -> str:  # noqa: ANN401 - rclpy carries no types
    """Return why no node in the graph plans around the mask once it is published; empty if one does.

    A node has to subscribe to both topics: programs that display a mask do not need its description. ``own``
    are names of nodes that do not count.
    """
    info, mask = (node.resolve_topic_name(topic) for topic in (names.zone_filter_info, names.zone_mask))
    informed = _subscribed_nodes(node, info, own)
    if informed & _subscribed_nodes(node, mask, own) or (informed and not node.count_publishers(mask)):
        return ""
    if informed:
        return f"a node subscribes to {info}, but not to the mask {mask} that it names"
    text = f"no node subscribes to {info}; set the costmap's filter_info_topic to this name"
    misplaced = misplaced_filter(node, names)
    return f"{text}, with the leading '/': now it is {misplaced}" if misplaced else text


def misplaced_filter(node: Any, names: RosNames) -> str:  # noqa: ANN401
    """Return the topic on which a costmap waits for a mask in vain; empty if none does.

    A costmap's node has a namespace of its own, in which Nav2 looks for a name without a leading '/'.
    """
    # Seen in Jazzy, 1.3.13: the planner logs "Filter mask was not received", and drives through the area.
    space, _, name = node.resolve_topic_name(names.zone_filter_info).rpartition("/")
    topics = (topic for topic, _ in node.get_topic_names_and_types())
    ours = (topic for topic in topics if topic.startswith(f"{space}/") and topic.endswith(f"_costmap/{name}"))
    return next((topic for topic in ours if node.count_subscribers(topic)), "")


def _subscribed_nodes(node: Any, topic: str, own: Collection[str]) -> set[tuple[str, str]]:  # noqa: ANN401
    """Return namespace and name of each node that subscribes to a topic."""
    return {
        (subscription.node_namespace, subscription.node_name)
        for subscription in node.get_subscriptions_info_by_topic(topic)
        if subscription.node_name not in own and not subscription.node_name.startswith(NO_COSTMAPS)
    }


class KeepOutMask:
    """Publishes the mask and its description, latched, once the robot has areas to avoid."""

    def __init__(self, settings: RosSettings) -> None:
        self._settings = settings
        self._mask: Mask | None = None
        self._wanted: list[tuple[Point, ...]] = []
        """Areas of the newest mask, drawn or pending."""
        self._session: RosSession | None = None
        self._node: Any = None
        self._unused_since: float | None = None
        self._masks: Any = None
        self._info: Any = None

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Use a new node; publish on it once there is a mask."""
        self._session, self._node, self._masks, self._unused_since = session, node, None, None
        if self._mask is not None:
            self._publish_mask(self._mask)

    async def show(self, areas: Collection[Area], map_id: str) -> None:
        """Publish the areas of one map as the only ones to avoid.

        If all areas are on other maps, the mask is empty: costmaps take it before the map changes. A thread
        draws the mask, because a large one takes 0.1 s. It is not published if it is replaced meanwhile.
        """
        if not areas and self._mask is None and not self._wanted:
            return
        polygons = [area.points for area in areas if area.map_id == map_id]
        self._wanted = polygons
        mask = await asyncio.to_thread(mask_of, polygons, self._settings.nav2.mask_resolution)
        if polygons is not self._wanted:
            return
        self._mask = mask
        log.info("keep-out mask", areas=len(polygons), width=self._mask.width, height=self._mask.height)
        if self._session is not None and self._session.state is SessionState.ACTIVE:
            self._publish_mask(self._mask)

    def check_use(self, now: float) -> KeepOutReport | None:
        """Return whether a node plans around the mask; None if that is not known yet, or none is published.

        ``now`` is the monotonic time in s.
        """
        if self._masks is None or self._session is None or self._session.state is not SessionState.ACTIVE:
            self._unused_since = None
            return None
        problem = unused_mask(self._node, self._settings.names, self._settings.node_name)
        if not problem:
            self._unused_since = None
            return KeepOutReport("")
        # DDS needs a while to match the costmaps with new publishers.
        self._unused_since = now if self._unused_since is None else self._unused_since
        return KeepOutReport(problem) if now - self._unused_since >= DISCOVERY else None

    def _publish_mask(self, mask: Mask) -> None:
        if self._masks is None:  # a robot whose plant never closes an area needs no publishers
            from nav_msgs.msg import OccupancyGrid  # noqa: PLC0415 - the loopback needs no ROS

            from nena_edge_agent.nav2.session import LATCHED  # noqa: PLC0415

            names = self._settings.names
            self._grid, self._info = OccupancyGrid, interface(FILTER_INFO)
            self._masks = self._node.create_publisher(OccupancyGrid, names.zone_mask, LATCHED)
            self._infos = self._node.create_publisher(self._info, names.zone_filter_info, LATCHED)
        grid = self._grid()
        grid.header.frame_id = self._settings.frame
        grid.info.resolution, grid.info.width, grid.info.height = mask.resolution, mask.width, mask.height
        grid.info.origin.position.x, grid.info.origin.position.y = mask.x, mask.y
        grid.data = array.array("b", mask.cells)
        self._masks.publish(grid)
        topic = self._masks.topic_name
        # Costmaps read the mask from the topic that this latched message names (KeepoutFilter).
        info = self._info(type=KEEP_OUT, filter_mask_topic=topic, base=0.0, multiplier=1.0)
        info.header.frame_id = self._settings.frame
        self._infos.publish(info)
