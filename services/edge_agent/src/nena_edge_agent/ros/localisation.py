"""What the localisation says: the newest pose, whether it is sure, and the velocity beside it."""

from __future__ import annotations

import math

from nena_edge_agent.driver.map_port import MapPose, MapPoseReport
from nena_edge_agent.driver.port import STANDING, VelocityReport
from nena_edge_agent.ros.pose import PoseReading, localized
from nena_edge_agent.ros.settings import RosSettings
from nena_edge_agent.ros.standstill import STALE
from nena_shared.log import get_logger

log = get_logger(__name__)

CLOCK_JUMP = 10_000_000_000
"""Nanoseconds; a stamp older by more means that the robot's clock was set back."""


class Localisation:
    """Keeps what is known of the robot's place; poses come more than once and out of order."""

    def __init__(self, settings: RosSettings, map_id: str) -> None:
        self._settings = settings
        self._map_id = map_id
        self._reading: PoseReading | None = None
        self._nearer: MapPose | None = None
        self._velocity: tuple[float, float] | None = None
        self._velocity_at = -math.inf
        self._frame_told: str | None = None

    @property
    def known(self) -> bool:
        """Whether a pose has come."""
        return self._reading is not None

    def on_reading(self, reading: PoseReading, *, old: bool = False) -> MapPose | None:
        """Take a pose; gives where the robot is by it, where it is new, and in the frame of the settings.

        ``old``: a nearer place comes all the time, and stays.
        """
        if reading.frame.removeprefix("/") != self._settings.frame:
            self._tell_frame(reading.frame)
            return None
        if self._reading is not None and _is_past(reading, self._reading):
            return None
        self._reading = reading
        self._nearer = self._nearer if old else None
        return self._nearer or self._pose(reading)

    def on_nearer(self, x: float, y: float, yaw: float, frame: str) -> MapPose | None:
        """Take a place (m, rad) that is newer than that of the pose; how sure it is, the pose still says.

        None, and not taken, where it is in another frame or no pose has come.
        """
        if self._reading is None or frame.removeprefix("/") != self._settings.frame:
            return None
        self._nearer = MapPose(x, y, yaw, self._map_id)
        return self._nearer

    @property
    def velocity(self) -> VelocityReport:
        """The newest velocity of the odometry."""
        return VelocityReport(*(self._velocity or (None, None)))

    def on_velocity(self, velocity: tuple[float, float], now: float) -> bool:
        """Take m/s forward and rad/s; tells whether the robot has just begun or ceased to move."""
        before, self._velocity, self._velocity_at = self._velocity, velocity, now
        return before is None or _moves(before) is not _moves(velocity)

    def forget_stale_velocity(self, now: float) -> bool:
        """Forget a velocity that no odometry has confirmed for a second; return whether there was one."""
        if self._velocity is None or now - self._velocity_at <= STALE:
            return False
        self._velocity = None
        return True

    def report(self) -> MapPoseReport | None:
        """Give the newest pose with the newest velocity; none before the first pose."""
        if self._reading is None:
            return None
        vx, omega = self._velocity or (None, None)
        sure = localized(self._reading, self._settings.localisation)
        problem = "" if sure else _spread(self._reading)
        pose = self._nearer or self._pose(self._reading)
        return MapPoseReport(pose, localized=sure, vx=vx, omega=omega, problem=problem)

    def _pose(self, reading: PoseReading) -> MapPose:
        return MapPose(reading.x, reading.y, reading.yaw, self._map_id)

    def _tell_frame(self, frame: str) -> None:
        if frame != self._frame_told:
            self._frame_told = frame
            log.warning(
                "poses are dropped: they are in another frame", frame=frame, ours=self._settings.frame
            )


def _is_past(reading: PoseReading, newest: PoseReading) -> bool:
    return reading == newest or 0 < newest.stamp - reading.stamp < CLOCK_JUMP


def _spread(reading: PoseReading) -> str:
    """Say how unsure the localisation is; a variance below 0 is no measure of anything."""
    deviations = [math.sqrt(max(0.0, each)) for each in (reading.x_variance, reading.y_variance)]
    turn = math.sqrt(max(0.0, reading.yaw_variance))
    return f"the localisation gives its place to {max(deviations):.2f} m and its heading to {turn:.2f} rad"


def _moves(velocity: tuple[float, float]) -> bool:
    return any(abs(part) >= STANDING for part in velocity)
