"""Poses in the plane: metres and radians, counter-clockwise, as REP 103 has it."""

from __future__ import annotations

import math
from typing import NamedTuple


class Pose(NamedTuple):
    """A place and a heading; ``yaw`` in (-pi, pi]."""

    x: float
    y: float
    yaw: float

    def distance(self, other: Pose) -> float:
        """Metres between the two places."""
        return math.hypot(other.x - self.x, other.y - self.y)

    def bearing(self, other: Pose) -> float:
        """Direction, in radians, in which the other place lies."""
        return math.atan2(other.y - self.y, other.x - self.x)

    def then(self, other: Pose) -> Pose:
        """Read ``other``, given in the frame of this pose, in the frame in which this pose is given."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Pose(
            self.x + cos * other.x - sin * other.y,
            self.y + sin * other.x + cos * other.y,
            wrap(self.yaw + other.yaw),
        )

    def inverse(self) -> Pose:
        """Give the pose that undoes this one: ``pose.then(pose.inverse())`` is the origin."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Pose(-cos * self.x - sin * self.y, sin * self.x - cos * self.y, wrap(-self.yaw))


def wrap(angle: float) -> float:
    """Bring an angle in radians into (-pi, pi]."""
    return math.pi - (math.pi - angle) % math.tau


def yaw_of(x: float, y: float, z: float, w: float) -> float | None:
    """Yaw of a quaternion of either sign; none when it is no unit quaternion (1 % off is forgiven)."""
    norm = math.hypot(x, y, z, w)
    if not math.isfinite(norm) or abs(norm - 1.0) > 0.01:  # noqa: PLR2004 - said in the docstring
        return None
    return wrap(math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
