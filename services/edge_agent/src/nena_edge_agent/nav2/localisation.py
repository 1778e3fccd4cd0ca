"""The robot's localisation: its newest pose, whether poses still arrive, and the initial position."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from nena_edge_agent.driver.port import STANDING, Pose, PoseReport, PositionInitialized, VelocityReport
from nena_edge_agent.nav2.commands import Report
from nena_edge_agent.nav2.poses import (
    PoseReading,
    localized,
    near,
)
from nena_edge_agent.nav2.robot_base import STALE
from nena_edge_agent.nav2.settings import LocalisationSettings, RosSettings
from nena_shared.log import get_logger

log = get_logger(__name__)

CLOCK_JUMP = 10_000_000_000
"""Nanoseconds; a stamp older by more means that the robot's clock was set back."""


class Localisation:
    """Keeps the robot's pose; poses may be repeated and out of order."""

    def __init__(self, settings: RosSettings, map_id: str) -> None:
        self._settings = settings
        self._map_id = map_id
        self._reading: PoseReading | None = None
        self._nearer: Pose | None = None
        self._velocity: tuple[float, float] | None = None
        self._velocity_at = -math.inf
        self._logged_frame: str | None = None

    @property
    def known(self) -> bool:
        """Return whether a pose was received."""
        return self._reading is not None

    def on_reading(self, reading: PoseReading, *, old: bool = False) -> Pose | None:
        """Handle a pose; return the position if it is new and in the frame of the settings.

        ``old``: newer positions arrive continuously from another source, and the pose does not replace them.
        """
        if reading.frame.removeprefix("/") != self._settings.frame:
            if reading.frame != self._logged_frame:
                self._logged_frame = reading.frame
                log.warning("ignoring poses in another frame", frame=reading.frame, ours=self._settings.frame)
            return None
        # Two subscriptions, latched and volatile, may deliver the same pose twice.
        # A much older stamp is that of a clock that was set back (or a simulation that was restarted).
        newest = self._reading
        if newest is not None and (reading == newest or 0 < newest.stamp - reading.stamp < CLOCK_JUMP):
            return None
        self._reading = reading
        self._nearer = self._nearer if old else None
        return self._nearer or self._pose_of(reading)

    def on_nearer(self, x: float, y: float, yaw: float, frame: str) -> Pose | None:
        """Handle a position (m, rad) newer than the pose, whose covariance stays valid; return it.

        Return None, and ignore it, if it is in another frame or no pose was received.
        """
        if self._reading is None or frame.removeprefix("/") != self._settings.frame:
            return None
        self._nearer = Pose(x, y, yaw, self._map_id)
        return self._nearer

    @property
    def velocity(self) -> VelocityReport:
        """Return the newest velocity of the odometry."""
        return VelocityReport(*(self._velocity or (None, None)))

    def on_velocity(self, velocity: tuple[float, float], now: float) -> bool:
        """Handle a velocity, m/s forward and rad/s; return whether the robot has just started or stopped."""
        previous, self._velocity, self._velocity_at = self._velocity, velocity, now
        return previous is None or _is_moving(previous) is not _is_moving(velocity)

    def forget_stale_velocity(self, now: float) -> bool:
        """Forget a velocity that no odometry has confirmed for a second; return whether there was one."""
        if self._velocity is None or now - self._velocity_at <= STALE:
            return False
        self._velocity = None
        return True

    def report(self) -> PoseReport | None:
        """Return the newest pose with the newest velocity; none before the first pose."""
        if self._reading is None:
            return None
        vx, omega = self._velocity or (None, None)
        sure = localized(self._reading, self._settings.localisation)
        problem = "" if sure else _describe_spread(self._reading)
        pose = self._nearer or self._pose_of(self._reading)
        return PoseReport(pose, localized=sure, vx=vx, omega=omega, problem=problem)

    def report_lost(self, problem: str, *, moves: bool) -> PoseReport | None:
        """Return the newest pose as no longer valid; ``moves``: its velocity is still valid."""
        report = self.report()
        if report is None:
            return None
        vx, omega = (report.vx, report.omega) if moves else (None, None)
        return replace(report, localized=False, vx=vx, omega=omega, problem=problem)

    def keep_velocity(self, before: Localisation) -> None:
        """Take over the odometry's velocity from ``before``."""
        self._velocity, self._velocity_at = before._velocity, before._velocity_at

    def _pose_of(self, reading: PoseReading) -> Pose:
        return Pose(reading.x, reading.y, reading.yaw, self._map_id)


SAME = 0.001
"""Distance between two poses that count as the same, m or rad."""
REPEATED_AFTER = 1.0
"""Seconds after which an unchanged report is worth repeating: the pose still arrives."""


class Repetition:
    """Recognises reports of a standing robot that say what the last one said; times are monotonic seconds."""

    def __init__(self) -> None:
        self._last: PoseReport | None = None
        self._at = -math.inf

    def repeats(self, report: PoseReport, now: float) -> bool:
        """Return whether ``report`` repeats one of the last second."""
        last = self._last
        if last is not None and now - self._at < REPEATED_AFTER:
            same = replace(report, pose=last.pose) == last and report.pose.map_id == last.pose.map_id
            if same and near(report.pose, last.pose, xy=SAME, theta=SAME):
                return True
        self._last, self._at = report, now
        return False


class LocaliserWatch:
    """Detects that the localisation has died, restarted or been deactivated, which invalidates its pose.

    A localisation that is missing in two checks has died. A publisher that appears next to another one is a
    restart of it: DDS lists a crashed publisher for another 20 s. The localisation may also have died before
    the first check, which waits for Nav2's responses: then only its pose shows that it was running.
    """

    def __init__(self) -> None:
        self._publishers: frozenset[str] = frozenset()
        self._heard = self._missed = self._inactive = False

    def on_pose(self) -> None:
        """Record that the localisation has published a pose."""
        self._heard = True

    def find_problem(self, publishers: frozenset[str], *, inactive: bool) -> str | None:
        """Handle the endpoint IDs of the pose's publishers.

        Return why the pose is invalid, None if it is still valid.
        """
        previous, was_missed, was_inactive = self._publishers, self._missed, self._inactive
        ran = bool(previous) or self._heard
        self._missed, self._inactive = ran and not publishers, inactive
        if self._missed and not was_missed:
            return None  # all of Nav2 may be stopping, and that is reported first
        self._publishers, self._heard = publishers, False
        if self._missed:
            return "the localisation is not running: nothing publishes its pose"
        # A restarted AMCL publishes nothing before an initial pose; the latched old one is gone with it.
        if previous and publishers - previous:
            return "the localisation was restarted; its earlier pose is no longer used"
        if inactive and not was_inactive:
            return "the localisation is not active"
        return None


def _describe_spread(reading: PoseReading) -> str:
    """Describe the uncertainty of the localisation; a negative variance is treated as 0."""
    deviations = [math.sqrt(max(0.0, variance)) for variance in (reading.x_variance, reading.y_variance)]
    turn = math.sqrt(max(0.0, reading.yaw_variance))
    return f"the localisation is uncertain: position ± {max(deviations):.2f} m, heading ± {turn:.2f} rad"


def _is_moving(velocity: tuple[float, float]) -> bool:
    return any(abs(part) >= STANDING for part in velocity)


@dataclass(frozen=True, slots=True)
class PublishInitialPose:
    """Publish the pose for the localisation; it may be lost on the way."""

    pose: Pose


@dataclass(slots=True)
class _Attempt:
    pose: Pose
    given: int
    again_at: float


class InitialPosition:
    """One initial position at a time; a newer one replaces an older one, and one answer applies to both."""

    def __init__(self, settings: LocalisationSettings) -> None:
        self._settings = settings
        self._attempt: _Attempt | None = None
        self._latest: Pose | None = None

    @property
    def busy(self) -> bool:
        """Return whether an initial position is not confirmed yet."""
        return self._attempt is not None

    def start(self, pose: Pose, now: float) -> list[PublishInitialPose | Report]:
        """Set an initial position; poses received before it do not confirm it."""
        self._latest = None
        # amcl subscribes best effort (Fast DDS), and loses what it gets while it is unconfigured.
        self._attempt = _Attempt(pose, 1, now + self._settings.initial_wait)
        return [PublishInitialPose(pose)]

    def on_pose(self, pose: Pose) -> list[PublishInitialPose | Report]:
        """Handle a pose of the localisation that is newer than all before."""
        attempt = self._attempt
        self._latest = pose
        # AMCL takes an initial pose within 0.24 s (Jazzy, 1.3), and answers with a pose only.
        if attempt is None or not near(
            pose,
            attempt.pose,
            xy=self._settings.initial_xy_tolerance,
            theta=self._settings.initial_theta_tolerance,
        ):
            return []
        self._attempt = None
        return [Report(PositionInitialized(succeeded=True, description=""))]

    def tick(self, now: float) -> list[PublishInitialPose | Report]:
        """Resend the pose if there was no answer, or give up."""
        attempt = self._attempt
        if attempt is None or now < attempt.again_at:
            return []
        if attempt.given < self._settings.initial_attempts:
            attempt.given += 1
            attempt.again_at = now + self._settings.initial_wait
            return [PublishInitialPose(attempt.pose)]
        self._attempt = None
        return [Report(PositionInitialized(succeeded=False, description=self._describe_failure(attempt)))]

    def _describe_failure(self, attempt: _Attempt) -> str:
        if self._latest is None:
            return (
                f"the localisation has sent no pose after {attempt.given} initial positions: "
                "is it running, and does it receive laser scans?"
            )
        return (
            f"the localisation stays at x {self._latest.x:.2f} m, y {self._latest.y:.2f} m, "
            f"heading {self._latest.theta:.2f} rad after {attempt.given} initial positions: "
            "is the position on the map, and is its frame the localisation's?"
        )


LONGEST_GAP = 1.0
"""Maximum interval between two velocities for integrating the distance between them, seconds."""
SILENT_WAY = 1.0
"""Distance, m or rad, within which a working localisation always sends a pose."""


class PoseWatch:
    """Requests and checks poses; ``timeout`` and ``wait`` are in seconds, times are monotonic seconds."""

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
        """Record that a pose was received."""
        self._pose_at, self._promised_at, self._way, self.lost = now, None, 0.0, False

    def on_velocity(self, speed: float, omega: float, now: float) -> None:
        """Handle a velocity of the odometry, m/s and rad/s."""
        seconds, self._heard_at = now - self._heard_at, now
        if seconds <= LONGEST_GAP and math.isfinite(speed + omega):
            self._way += max(abs(speed), abs(omega)) * seconds

    def on_answer(self, now: float) -> None:
        """Record that the localisation has accepted the request for a pose."""
        if self._promised_at is None:
            self._promised_at = now

    def wants_pose(self, *, driving: bool, unsure: bool, now: float) -> bool:
        """Return whether to request a pose, and update ``lost``; ``unsure``: the newest one is unreliable."""
        if self._pose_at is None:
            return False
        if not driving and not unsure and not self.lost:
            self._pose_at = now  # at standstill it may stay silent
            return False
        if now - self._pose_at < self._timeout:
            return False
        # AMCL publishes after update_min_d or update_min_a: silence is normal at rest, not on the way.
        promised = self._promised_at is not None and now - self._promised_at >= self._wait
        self.lost = self.lost or promised or self._way >= SILENT_WAY
        if now - self._asked_at < self._wait:
            return False
        self._asked_at = now
        return True
