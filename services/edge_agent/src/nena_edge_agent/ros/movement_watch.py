"""Whether a robot that drives for a goal gets on: Nav2 tries for minutes before it gives a goal up."""

from __future__ import annotations

import math

from nena_edge_agent.driver.map_port import MapPose
from nena_edge_agent.ros.pose import near

REACH = 0.1
"""Metres, or radians, that count as movement."""
LONGEST_GAP = 1.0
"""Seconds between two velocities over which the way in between can be reckoned."""


class MovementWatch:
    """Follows odometry and poses; ``patience`` is in seconds, times are monotonic seconds."""

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._moved_at: float | None = None
        self._heard_at = -math.inf
        self._way = self._turn = 0.0
        self._anchor: MapPose | None = None

    def on_velocity(self, speed: float, omega: float, now: float) -> None:
        """Take a velocity in m/s and rad/s."""
        seconds, self._heard_at = now - self._heard_at, now
        if seconds > LONGEST_GAP or not math.isfinite(speed + omega):
            return
        self._way += speed * seconds
        self._turn += omega * seconds
        if abs(self._way) >= REACH or abs(self._turn) >= REACH:
            self._way, self._turn = 0.0, 0.0
            self._moved_at = now

    def on_pose(self, pose: MapPose, now: float) -> None:
        """Take a pose of the localisation."""
        if self._anchor is None or not near(pose, self._anchor, xy=REACH, theta=REACH):
            self._anchor, self._moved_at = pose, now

    def blocked(self, *, driving: bool, now: float) -> bool:
        """Tell whether the robot has stood for too long, with a goal under way all the time."""
        if not driving or self._moved_at is None:
            self._moved_at = now
        return now - self._moved_at >= self._patience
