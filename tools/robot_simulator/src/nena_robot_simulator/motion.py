"""Motion in the plane: poses (REP 103), the map of the hall, and differential-drive kinematics."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

from nena_shared.ros import wrap


class Pose(NamedTuple):
    """A position (m) and a heading ``yaw`` (rad) in (-pi, pi]."""

    x: float
    y: float
    yaw: float

    def distance(self, other: Pose) -> float:
        """Return the distance between the two positions, m."""
        return math.hypot(other.x - self.x, other.y - self.y)

    def bearing(self, other: Pose) -> float:
        """Return the direction to the other position, rad."""
        return math.atan2(other.y - self.y, other.x - self.x)

    def then(self, other: Pose) -> Pose:
        """Transform ``other`` from the frame of this pose into the parent frame."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Pose(
            self.x + cos * other.x - sin * other.y,
            self.y + sin * other.x + cos * other.y,
            wrap(self.yaw + other.yaw),
        )

    def inverse(self) -> Pose:
        """Return the inverse transform: ``pose.then(pose.inverse())`` is the origin."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Pose(-cos * self.x - sin * self.y, sin * self.x - cos * self.y, wrap(-self.yaw))


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
        """Return whether a position (m) is on the map and free."""
        if not self.covers(x, y):
            return False
        return self._cell_of(x, y) == FREE

    def _cell_of(self, x: float, y: float) -> int:
        column, row = map(math.floor, self._in_cells(x, y))
        return self.cells[row * self.width + column]

    def forbids(self, x: float, y: float) -> bool:
        """Return whether a position is in this mask of a keep-out filter and its cell is closed."""
        return self.covers(x, y) and self._cell_of(x, y) == OCCUPIED

    def covers(self, x: float, y: float) -> bool:
        """Return whether a position (m) is on the map; NaN and infinity are not."""
        across, up = self._in_cells(x, y)
        return 0 <= across < self.width and 0 <= up < self.height

    def free_near(self, goal: Pose, tolerance: float, mask: GridMap | None = None) -> Pose | None:
        """Return the goal, or the nearest free position within ``tolerance`` metres, as NavFn does.

        A position that the ``mask`` of a keep-out filter forbids is not free. None if the goal is outside the
        map or too deep in a wall.
        """

        def is_free(place: Pose) -> bool:
            return self.is_free(place.x, place.y) and not (mask and mask.forbids(place.x, place.y))

        if not self.covers(goal.x, goal.y):
            return None
        if is_free(goal):
            return goal
        reach = math.ceil(tolerance / self.resolution)
        steps = [offset * self.resolution for offset in range(-reach, reach + 1)]
        places = [Pose(goal.x + dx, goal.y + dy, goal.yaw) for dx in steps for dy in steps]
        near = [p for p in places if p.distance(goal) <= tolerance and is_free(p)]
        return min(near, key=goal.distance, default=None)

    def _in_cells(self, x: float, y: float) -> tuple[float, float]:
        """Return the offset of a position from the origin in cells; may be infinite."""
        return (x - self.origin_x) / self.resolution, (y - self.origin_y) / self.resolution


def hall(*, min_x: float, min_y: float, max_x: float, max_y: float, resolution: float) -> GridMap:
    """Return the map of a hall with walls, two cells thick, just outside the given bounds (m)."""
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


TURN_IN_PLACE_ABOVE = math.radians(60.0)
"""Heading error above which the robot turns on the spot before driving, rad."""
AT_PLACE = 0.05
"""Distance to the target below which only the heading is corrected, m."""
HEADING_GAIN = 3.0
"""Yaw rate per heading error, 1/s; smoothed by the acceleration limit."""


LEAST_APPROACH = 0.05
"""Minimum speed when approaching a goal, m/s (``min_approach_linear_velocity``)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of the drive: m/s, m/s², rad/s, rad/s².

    ``approach``: distance (m) to the end of the path below which the speed falls with the distance, as with
    Regulated Pure Pursuit. ``deceleration``: what the base reaches if that is not ``acceleration``, on which
    the controller counts.
    """

    speed: float
    acceleration: float
    yaw_rate: float
    yaw_acceleration: float
    approach: float = 0.0
    deceleration: float | None = None


@dataclass(frozen=True, slots=True)
class Motion:
    """Pose and velocity of the robot: forward m/s, counter-clockwise rad/s."""

    pose: Pose
    speed: float = 0.0
    yaw_rate: float = 0.0

    @property
    def standing(self) -> bool:
        """Return whether the robot is at standstill."""
        return self.speed == 0.0 and self.yaw_rate == 0.0


def obey(motion: Motion, command: tuple[float, float], limits: Limits, dt: float) -> Motion:
    """Move for ``dt`` seconds with the commanded velocity (m/s, rad/s), as far as the limits allow."""
    brakes = abs(command[0]) < abs(motion.speed)
    change = limits.deceleration if brakes and limits.deceleration is not None else limits.acceleration
    speed = _approach_value(motion.speed, command[0], change * dt)
    yaw_rate = _approach_value(motion.yaw_rate, command[1], limits.yaw_acceleration * dt)
    heading = motion.pose.yaw + yaw_rate * dt / 2.0
    return replace(
        motion,
        pose=Pose(
            motion.pose.x + speed * math.cos(heading) * dt,
            motion.pose.y + speed * math.sin(heading) * dt,
            wrap(motion.pose.yaw + yaw_rate * dt),
        ),
        speed=speed,
        yaw_rate=yaw_rate,
    )


def command_to(pose: Pose, target: Pose, limits: Limits, *, behind: float = 0.0) -> tuple[float, float]:
    """Return the velocity (m/s, rad/s) with which a controller heads for ``target`` (same frame).

    ``behind`` is the length of the path beyond the target, m: above 0 the robot passes without a stop.
    """
    distance = pose.distance(target)
    if distance <= AT_PLACE and not behind:
        return 0.0, _turn_rate(wrap(target.yaw - pose.yaw), limits)
    error = wrap(pose.bearing(target) - pose.yaw)
    turn = _turn_rate(error, limits)
    if abs(error) > TURN_IN_PLACE_ABOVE:
        return 0.0, turn
    braking = math.sqrt(2.0 * limits.acceleration * (distance + behind))
    speed = min(limits.speed, braking)
    if distance + behind < limits.approach:
        share = (distance + behind) / limits.approach
        speed = min(speed, max(LEAST_APPROACH, limits.speed * share))
    return speed * math.cos(error), turn


def _turn_rate(error: float, limits: Limits) -> float:
    """Return a yaw rate that removes the error and still allows braking in time."""
    braking = math.sqrt(2.0 * limits.yaw_acceleration * abs(error))
    return math.copysign(min(limits.yaw_rate, HEADING_GAIN * abs(error), braking), error)


def _approach_value(value: float, wanted: float, most: float) -> float:
    """Change ``value`` towards ``wanted`` by at most ``most``."""
    return wanted if abs(wanted - value) <= most else value + math.copysign(most, wanted - value)
