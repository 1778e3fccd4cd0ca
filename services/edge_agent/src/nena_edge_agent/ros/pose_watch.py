"""Whether poses still come from the localisation of a robot that drives.

AMCL is silent while the robot stands, so silence alone says nothing: a pose is asked for first. Lost is a
robot whose localisation promises one and does not send it, or that goes on and on without one.
"""

from __future__ import annotations

import math

LONGEST_GAP = 1.0
"""Seconds between two velocities over which the way in between can be reckoned."""
SILENT_WAY = 1.0
"""Metres, or radians, that a localisation that works does not let pass without a pose."""


class PoseWatch:
    """Asks and judges; ``timeout`` and ``wait`` are in seconds, times are monotonic seconds."""

    def __init__(self, *, timeout: float, wait: float) -> None:
        self._timeout = timeout
        self._wait = wait
        self._pose_at: float | None = None
        self._asked_at = -math.inf
        self._promised_at: float | None = None
        self._heard_at = -math.inf
        self._way = 0.0
        self.lost = False

    def on_pose(self, now: float) -> None:
        """Note that a pose has come."""
        self._pose_at, self._promised_at, self._way, self.lost = now, None, 0.0, False

    def on_velocity(self, speed: float, omega: float, now: float) -> None:
        """Take a velocity of the odometry: m/s and rad/s."""
        seconds, self._heard_at = now - self._heard_at, now
        if seconds <= LONGEST_GAP and math.isfinite(speed + omega):
            self._way += max(abs(speed), abs(omega)) * seconds

    def on_answer(self, now: float) -> None:
        """Note that the localisation has taken the request for a pose."""
        if self._promised_at is None:
            self._promised_at = now

    def look(self, *, driving: bool, unsure: bool, now: float) -> bool:
        """Tell whether a pose is to be asked for; ``unsure``: the newest one is not to be trusted."""
        if self._pose_at is None:
            return False
        if not driving and not unsure and not self.lost:
            self._pose_at = now  # at standstill it may stay silent
            return False
        if now - self._pose_at < self._timeout:
            return False
        promised = self._promised_at is not None and now - self._promised_at >= self._wait
        self.lost = self.lost or promised or self._way >= SILENT_WAY
        if now - self._asked_at < self._wait:
            return False
        self._asked_at = now
        return True
