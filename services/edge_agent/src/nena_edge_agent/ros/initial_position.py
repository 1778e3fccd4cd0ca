"""Telling the localisation where the robot is, and seeing that it has understood.

The topic is best effort at the localisation's end, so the pose is given a number of times until a pose comes
back that is newer than all before and near enough. Events and time go in, commands come out.
"""

from __future__ import annotations

from dataclasses import dataclass

from nena_edge_agent.driver.map_port import MapPose
from nena_edge_agent.driver.port import PositionInitialized
from nena_edge_agent.ros.commands import Report
from nena_edge_agent.ros.pose import near
from nena_edge_agent.ros.settings import LocalisationSettings


@dataclass(frozen=True, slots=True)
class PublishInitialPose:
    """Publish the pose for the localisation; it may be lost on the way."""

    pose: MapPose


@dataclass(slots=True)
class _Attempt:
    pose: MapPose
    given: int
    again_at: float


class InitialPosition:
    """One initial position at a time; a newer one replaces an older one, and one answer stands for both."""

    def __init__(self, settings: LocalisationSettings) -> None:
        self._settings = settings
        self._attempt: _Attempt | None = None
        self._latest: MapPose | None = None

    @property
    def busy(self) -> bool:
        """Whether an answer is owed."""
        return self._attempt is not None

    def ask(self, pose: MapPose, now: float) -> list[PublishInitialPose | Report]:
        """Begin; poses that came before do not count, however near they are."""
        self._latest = None
        self._attempt = _Attempt(pose, 1, now + self._settings.initial_wait)
        return [PublishInitialPose(pose)]

    def on_pose(self, pose: MapPose) -> list[PublishInitialPose | Report]:
        """Take a pose of the localisation, newer by its stamp than every one before."""
        attempt = self._attempt
        self._latest = pose
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
        """Give the pose again where no answer came, or give up."""
        attempt = self._attempt
        if attempt is None or now < attempt.again_at:
            return []
        if attempt.given < self._settings.initial_attempts:
            attempt.given += 1
            attempt.again_at = now + self._settings.initial_wait
            return [PublishInitialPose(attempt.pose)]
        self._attempt = None
        return [Report(PositionInitialized(succeeded=False, description=self._failure(attempt)))]

    def _failure(self, attempt: _Attempt) -> str:
        if self._latest is None:
            return (
                f"the localisation has sent no pose after {attempt.given} initial positions: "
                "is it running, and does it get laser scans?"
            )
        return (
            f"the localisation stays at x {self._latest.x:.2f} m, y {self._latest.y:.2f} m, "
            f"heading {self._latest.theta:.2f} rad after {attempt.given} initial positions: "
            "is the position on the map, and is its frame the localisation's?"
        )
