"""Whether the robot stands, by its odometry."""

from __future__ import annotations

import math

from nena_edge_agent.driver.port import STANDING

HOLD = 0.2
"""Seconds that it must have been standing."""
STALE = 1.0
"""Seconds after which odometry says nothing any more."""
SLOWING = 0.02
"""m/s or rad/s by which the velocity has to fall to count as slowing down."""


class Standstill:
    """Follows velocities; times are monotonic seconds."""

    def __init__(self) -> None:
        self._heard_at: float | None = None
        self._since: float | None = None
        self._lowest = math.inf
        self.speed = self.omega = 0.0
        """The newest velocity, m/s and rad/s."""
        self.slowed_at = -math.inf
        """When the robot last became slower."""

    def on_velocity(self, speed: float, omega: float, now: float) -> None:
        """Take a velocity in m/s and rad/s."""
        self._heard_at = now
        self.speed, self.omega = speed, omega
        fastest = max(abs(speed), abs(omega))
        if fastest < self._lowest - SLOWING:
            self.slowed_at = now
        if fastest < self._lowest - SLOWING or fastest > self._lowest + SLOWING:
            self._lowest = fastest
        if abs(speed) < STANDING and abs(omega) < STANDING:
            self._since = now if self._since is None else self._since
        else:
            self._since = None

    def known(self, now: float) -> bool:
        """Whether odometry is there, and fresh."""
        return self._heard_at is not None and now - self._heard_at <= STALE

    def stands(self, now: float) -> bool:
        """Whether fresh odometry says that the robot has been standing for a while."""
        return self.known(now) and self._since is not None and now - self._since >= HOLD
