"""A drive to one goal, from its giving to the pose that confirms the arrival."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from nena_edge_agent.driver.map_port import MapGoal, MapPose
from nena_edge_agent.ros.pose import near

LATE_AT_MOST = 8.0
"""Seconds after an arrival in which poses that show the robot driving are taken for late ones."""
STANDS = 0.1
"""Metres, and radians, that poses of a robot that stands may differ by."""


@dataclass(slots=True)
class Drive:
    """The goal that the protocol core wants driven; times are monotonic seconds."""

    goal: MapGoal
    times_given: int = 0
    counted_from: int = 0
    """How often it had been given when Nav2 was last away; those do not count."""
    preempts: bool = False
    """Whether it was given while another goal was driven, whose result it may get."""
    interrupted: bool = False
    """Whether the controller was stopped on the way: the navigator may take that for success."""
    give_up_at: float | None = None
    goal_id: str | None = None
    reached_at: float | None = None
    pose_asked_at: float | None = None
    late_at: float = -inf
    """When a pose showed the robot driving last, though it is where it was to go."""
    _shown_driving: bool = False
    """Whether the last pose shows the robot driving."""

    @property
    def tries(self) -> int:
        """How often it was given since Nav2 is there."""
        return self.times_given - self.counted_from

    @property
    def may_be_undriven(self) -> bool:
        """Whether success may come from elsewhere than from arriving."""
        return self.preempts or self.interrupted

    def on_pose(self, pose: MapPose, before: MapPose, now: float) -> None:
        """Take notice of a pose and the one before it; on busy computers they come long after the arrival."""
        self._shown_driving = not near(pose, before, xy=STANDS, theta=STANDS)
        if self.reached_at is not None and self._shown_driving:
            self.late_at = min(now, self.reached_at + LATE_AT_MOST)

    def poses_are_late(self, now: float) -> bool:
        """Tell whether none has come since the arrival, though the last one shows the robot driving."""
        if self.reached_at is None or self.late_at != -inf:
            return False
        return self._shown_driving and now - self.reached_at < LATE_AT_MOST

    def pose_may_come(self, now: float, wait: float) -> bool:
        """Tell whether a pose may yet confirm the arrival: within ``wait`` s of it, or of a late one."""
        return self.reached_at is not None and now - max(self.reached_at, self.late_at) < wait
