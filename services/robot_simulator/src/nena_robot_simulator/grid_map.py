"""The occupancy grid of the simulated place: an empty hall with walls around it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from nena_robot_simulator.pose import Pose

FREE = 0
OCCUPIED = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class GridMap:
    """Square cells in rows from the origin, the lower left corner, as in nav_msgs/OccupancyGrid; metres."""

    width: int
    height: int
    resolution: float
    origin_x: float
    origin_y: float
    cells: bytes

    def is_free(self, x: float, y: float) -> bool:
        """Tell whether the place in metres lies on the map and in no wall."""
        if not self.covers(x, y):
            return False
        column, row = map(math.floor, self._in_cells(x, y))
        return self.cells[row * self.width + column] == FREE

    def covers(self, x: float, y: float) -> bool:
        """Tell whether the place in metres lies on the map at all; NaN and infinity do not."""
        across, up = self._in_cells(x, y)
        return 0 <= across < self.width and 0 <= up < self.height

    def free_near(self, goal: Pose, tolerance: float) -> Pose | None:
        """Give the goal, or the free place nearest to it within ``tolerance`` metres, as NavFn does.

        None where the goal lies outside the map or too deep in a wall.
        """
        if not self.covers(goal.x, goal.y):
            return None
        if self.is_free(goal.x, goal.y):
            return goal
        reach = math.ceil(tolerance / self.resolution)
        steps = [offset * self.resolution for offset in range(-reach, reach + 1)]
        places = [Pose(goal.x + dx, goal.y + dy, goal.yaw) for dx in steps for dy in steps]
        near = [p for p in places if p.distance(goal) <= tolerance and self.is_free(p.x, p.y)]
        return min(near, key=goal.distance, default=None)

    def _in_cells(self, x: float, y: float) -> tuple[float, float]:
        """Give the way from the origin to a place in cells; it may be infinite."""
        return (x - self.origin_x) / self.resolution, (y - self.origin_y) / self.resolution


def hall(*, min_x: float, min_y: float, max_x: float, max_y: float, resolution: float) -> GridMap:
    """Make the map of a hall whose walls, two cells thick, stand just outside the given metres."""
    wall = 2
    inner_width = math.ceil((max_x - min_x) / resolution)
    inner_height = math.ceil((max_y - min_y) / resolution)
    width, height = inner_width + 2 * wall, inner_height + 2 * wall
    full_row = bytes([OCCUPIED]) * width
    side = bytes([OCCUPIED]) * wall
    row = side + bytes([FREE]) * inner_width + side
    return GridMap(
        width=width,
        height=height,
        resolution=resolution,
        origin_x=min_x - wall * resolution,
        origin_y=min_y - wall * resolution,
        cells=full_row * wall + row * inner_height + full_row * wall,
    )
