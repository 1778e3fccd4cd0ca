"""Reports of the robot's base: standstill, movement, battery, and stops by Nav2's collision monitor."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nena_edge_agent.driver.port import STANDING, BatteryReport, CollisionReport, Pose
from nena_edge_agent.nav2.offers import COLLISION_MONITOR, interface
from nena_edge_agent.nav2.poses import near
from nena_edge_agent.nav2.settings import BatteryScale
from nena_shared.log import get_logger

if TYPE_CHECKING:
    from nena_edge_agent.nav2.session import RosSession


HOLD = 0.2
"""Seconds at standstill before a robot counts as standing."""
STALE = 1.0
"""Seconds after which odometry is outdated."""
SLOWING = 0.02
"""Decrease of the velocity that counts as slowing down, m/s or rad/s."""


def without_noise(velocity: tuple[float, float], noise: float) -> tuple[float, float]:
    """Return the velocity (m/s, rad/s) with each part at or below ``noise`` as 0."""
    speed, omega = velocity
    return (0.0 if abs(speed) <= noise else speed, 0.0 if abs(omega) <= noise else omega)


class Standstill:
    """Detects standstill by odometry; times are monotonic seconds."""

    def __init__(self) -> None:
        self._heard_at: float | None = None
        self._since: float | None = None
        self._lowest = math.inf
        self.speed = self.omega = 0.0
        """The newest velocity, m/s and rad/s."""
        self.slowed_at = -math.inf
        """When the robot last became slower."""

    def on_velocity(self, speed: float, omega: float, now: float) -> None:
        """Handle a velocity in m/s and rad/s."""
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

    @property
    def moving(self) -> bool:
        """Return whether the newest velocity, which may be outdated, is that of a moving robot."""
        return self._heard_at is not None and self._since is None

    def known(self, now: float) -> bool:
        """Return whether fresh odometry is available."""
        return self._heard_at is not None and now - self._heard_at <= STALE

    def stands(self, now: float) -> bool:
        """Return whether fresh odometry shows that the robot has been at standstill for a while."""
        return self.known(now) and self._since is not None and now - self._since >= HOLD


REACH = 0.1
"""Distance that counts as movement, metres or radians."""
AWAY = 0.5
"""Distance that a robot must drive after recoveries to count as moving again, metres (Nav2 backs up 0.3 m).
"""
TURNED = 4.0
"""Turning on the spot that counts as movement, radians at most; Nav2's recoveries turn repeatedly."""
LONGEST_GAP = 1.0
"""Maximum interval between two velocities for integrating the distance between them, seconds."""


class MovementWatch:
    """Detects a blocked robot by odometry and poses; ``timeout`` and times are in (monotonic) seconds.

    Nav2's recoveries (spin, back up, wait) are not progress: after one, and after turning by ``TURNED``, a
    robot counts as moving only once it has left its place.
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._moved_at: float | None = None
        self._heard_at = -math.inf
        self._way = self._turn = 0.0
        self._x = self._y = self._yaw = 0.0
        self._spot: tuple[float, float] = (0.0, 0.0)
        self._turned = 0.0
        self._recoveries = 0
        self._recovering = False
        self._anchor: Pose | None = None
        self._pose_spot: Pose | None = None

    def on_velocity(self, speed: float, omega: float, now: float) -> None:
        """Handle a velocity in m/s and rad/s."""
        seconds, self._heard_at = now - self._heard_at, now
        if seconds > LONGEST_GAP or not math.isfinite(speed + omega):
            return
        self._yaw += omega * seconds
        self._x += speed * seconds * math.cos(self._yaw)
        self._y += speed * seconds * math.sin(self._yaw)
        self._way += speed * seconds
        self._turn += omega * seconds
        if math.dist((self._x, self._y), self._spot) >= AWAY:
            self._record_progress(now)
        elif abs(self._way) >= REACH or abs(self._turn) >= REACH:
            self._turned += abs(self._turn)
            self._way, self._turn = 0.0, 0.0
            self._record_movement(now)

    def on_pose(self, pose: Pose, now: float) -> None:
        """Handle a pose of the localisation."""
        stirred = self._anchor is None or not near(pose, self._anchor, xy=REACH, theta=REACH)
        self._anchor = pose if stirred else self._anchor
        if self._pose_spot is None or not near(pose, self._pose_spot, xy=AWAY, theta=None):
            self._record_progress(now)
        elif stirred:
            self._record_movement(now)

    def on_recoveries(self, count: int) -> None:
        """Handle the number of recoveries that navigation has counted in the current drive."""
        if count > self._recoveries:
            self._recovering = True
            self._spot = (self._x, self._y)
            self._pose_spot = self._anchor
        self._recoveries = count

    def blocked(self, *, driving: bool, now: float) -> bool:
        """Return whether the robot has been at standstill for too long with an active goal."""
        if not driving or self._moved_at is None:
            self._record_progress(now)
        return self._moved_at is not None and now - self._moved_at >= self._timeout

    def _record_progress(self, now: float) -> None:
        """Record that the robot has left its earlier position."""
        self._moved_at, self._recovering, self._turned = now, False, 0.0
        self._spot, self._pose_spot = (self._x, self._y), self._anchor

    def _record_movement(self, now: float) -> None:
        """Record that the robot has moved, possibly only on the spot."""
        if not self._recovering and self._turned < TURNED:
            self._moved_at = now


log = get_logger(__name__)


STATUS_CHARGING = 1
SUSPICIOUS_FRACTION = 1.5
"""A fraction above this is a sign that the driver sends percent."""


@dataclass(frozen=True, slots=True)
class BatteryReading:
    """The content of a battery message: ``percentage`` in the driver's scale, V, A; NaN if not measured."""

    percentage: float
    voltage: float
    current: float
    status: int


class Battery:
    """Converts readings to reports; a scale that looks wrong is reported once and never guessed."""

    def __init__(self, scale: BatteryScale) -> None:
        self._scale = scale
        self._warned = False

    def report(self, reading: BatteryReading) -> BatteryReport | None:
        """Return the report for a reading; none if the charge was not measured."""
        if not math.isfinite(reading.percentage):
            return None
        # sensor_msgs/BatteryState defines 0 to 1; many drivers send 0 to 100.
        if self._scale == "fraction" and reading.percentage > SUSPICIOUS_FRACTION and not self._warned:
            self._warned = True
            log.warning(
                "the battery's percentage is above 1: if the robot sends percent, "
                "set ros.battery_scale to percent",
                percentage=reading.percentage,
            )
        percent = reading.percentage * (100.0 if self._scale == "fraction" else 1.0)
        return BatteryReport(
            state_of_charge=min(100.0, max(0.0, percent)),
            charging=reading.status == STATUS_CHARGING,
            voltage=_if_measured(reading.voltage),
            current=_if_measured(reading.current),
        )


def _if_measured(value: float) -> float | None:
    return value if math.isfinite(value) else None


STOP = 1
"""Value of ``action_type`` while the robot is stopped; at higher values, it is slowed down."""


class CollisionMonitor:
    """Reports each change in the state of Nav2's collision monitor.

    It publishes changes only, and does not latch them: until the first one, its state is unknown.
    """

    def __init__(self, topic: str, on_report: Callable[[CollisionReport], None]) -> None:
        self._topic = topic
        self._on_report = on_report

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Subscribe on a new node."""
        from nena_edge_agent.nav2.session import RELIABLE  # noqa: PLC0415 - needs rclpy

        self._node, self._reported = node, False
        kind = interface(COLLISION_MONITOR)
        session.subscribe(node, kind, self._topic, RELIABLE, read=report_of, handle=self._on_collision)

    def report_silent(self) -> None:
        """Report a monitor that has not published its state yet."""
        # Volatile, and only on change while commands flow (Jazzy, 1.3.13): a late subscriber knows nothing.
        if not self._reported and self._node.count_publishers(self._topic):
            self._reported = True
            self._on_report(CollisionReport(stops=None, polygon=""))

    def _on_collision(self, report: CollisionReport) -> None:
        self._reported = True
        log.info("collision monitor", stops=report.stops, polygon=report.polygon)
        self._on_report(report)


def report_of(message: Any) -> CollisionReport:  # noqa: ANN401
    """Read a nav2_msgs/CollisionMonitorState."""
    return CollisionReport(stops=message.action_type == STOP, polygon=message.polygon_name)
