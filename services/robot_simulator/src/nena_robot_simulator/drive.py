"""One drive: the way that the planner found, and Nav2's goal checker at its end."""

from __future__ import annotations

import math

from nena_robot_simulator.navigator import Progress, Target
from nena_robot_simulator.pose import Pose, wrap

XY_TOLERANCE = 0.25
"""Metres from the end of the way within which a goal counts as reached (``xy_goal_tolerance``)."""
YAW_TOLERANCE = 0.25
"""Radians from the goal's heading within which a goal counts as reached (``yaw_goal_tolerance``)."""
PLANNER_TOLERANCE = 0.5
"""Metres from an occupied goal at which the planner may end the way (NavFn's ``tolerance``)."""
PLAN_SPACING = 0.25
"""Metres between the poses of the published plan, as long as it has no more than ``PLAN_PARTS``."""
PLAN_PARTS = 10_000


class Drive:
    """The way to one target; ``end`` is None where the planner found none.

    ``abort_after`` is the part of the way, 0 to 1, after which the controller gives up.
    """

    def __init__(
        self, target: Target, start: Pose, end: Pose | None, *, abort_after: float | None = None
    ) -> None:
        self.target = target
        self.end = end
        self._abort_within = (
            None if abort_after is None else (1.0 - abort_after) * start.distance(target.pose)
        )
        self._at_place = False
        self._reached = False

    def move_to(self, pose: Pose) -> None:
        """Note that the robot is at ``pose`` now; the place counts once it has been met."""
        if self.end is None:
            return
        self._at_place = self._at_place or pose.distance(self.end) <= XY_TOLERANCE
        self._reached = self._at_place and abs(wrap(pose.yaw - self.end.yaw)) <= YAW_TOLERANCE

    def progress(self, pose: Pose) -> Progress:
        """Tell how the drive stands with the robot at ``pose``."""
        given_up = self._abort_within is not None and pose.distance(self.target.pose) <= self._abort_within
        if self.end is None or given_up:
            return Progress.FAILED
        return Progress.REACHED if self._reached else Progress.UNDERWAY

    def plan(self, pose: Pose) -> list[Pose]:
        """Give the straight way that is left, from ``pose`` to its end, heading along it and turned last."""
        if self.end is None:
            return []
        heading = pose.bearing(self.end)
        parts = max(1, math.ceil(min(pose.distance(self.end) / PLAN_SPACING, PLAN_PARTS)))
        dx, dy = (self.end.x - pose.x) / parts, (self.end.y - pose.y) / parts
        return [Pose(pose.x + i * dx, pose.y + i * dy, heading) for i in range(parts)] + [self.end]
