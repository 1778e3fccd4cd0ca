"""What can be seen of the robot in the ROS graph, as plain data."""

from __future__ import annotations

from dataclasses import dataclass

from nena_edge_agent.ros.pose import PoseReading
from nena_edge_agent.ros.presence import Lifecycle


@dataclass(frozen=True, slots=True)
class Grid:
    """An occupancy grid: its frame, its lower left corner in m, its size in m."""

    frame: str
    x: float
    y: float
    width: float
    height: float

    def holds(self, x: float, y: float) -> bool:
        """Whether a place, in m, is on it; the grid is taken as not turned."""
        return 0 <= x - self.x <= self.width and 0 <= y - self.y <= self.height


@dataclass(frozen=True, slots=True)
class RosView:
    """What a node in the settings' domain and namespace sees within some seconds."""

    nodes: tuple[str, ...] = ()
    """Names of nodes that are neither ours nor hidden."""
    busy_domains: tuple[int, ...] = ()
    """Other domains in which there are nodes, of those that were looked at."""
    servers: int = 0
    """Publishers of the action's status in the namespace."""
    elsewhere: tuple[str, ...] = ()
    """Other namespaces in which the action's status is published."""
    goal_listeners: int = 0
    lifecycle: Lifecycle = Lifecycle.ABSENT
    pose: PoseReading | None = None
    grid: Grid | None = None
    clock_offset: float | None = None
    """Seconds that the newest odometry was stamped ahead of this program's clock; None: none came."""
