"""One drive: the way that the planner found, and Nav2's goal checker at its end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from nena_robot_simulator.error_code import ErrorCode
from nena_robot_simulator.navigator import Progress, Target
from nena_robot_simulator.pose import Pose, wrap

XY_TOLERANCE = 0.25
"""Metres from the end of the way within which a goal counts as reached (``xy_goal_tolerance``)."""
YAW_TOLERANCE = 0.25
"""Radians from the goal's heading within which a goal counts as reached (``yaw_goal_tolerance``)."""
PLANNER_TOLERANCE = 0.5
"""Metres from an occupied goal at which the planner may end the way (NavFn's ``tolerance``)."""
PASSED_WITHIN = 0.7
"""Metres from a place on the way at which the tree takes it for passed (``RemovePassedGoals``)."""
PLAN_SPACING = 0.25
"""Metres between the poses of the published plan, as long as it has no more than ``PLAN_PARTS``."""
PLAN_PARTS = 10_000


class Drive:
    """The way to one target; ``end`` is None where the planner found none.

    ``abort_after`` is the part of the way, 0 to 1, after which the controller gives up; ``error_code`` says
    why the drive fails, where it does.
    """

    def __init__(
        self,
        target: Target,
        start: Pose,
        end: Pose | None,
        *,
        abort_after: float | None = None,
        error_code: int = ErrorCode.NONE,
    ) -> None:
        self.target = target
        self.end = end
        self.error_code = error_code
        self._via = list(target.via)
        whole = _length([start, *target.via, target.pose])
        self._abort_within = None if abort_after is None else (1.0 - abort_after) * whole
        self._at_place = False
        self._reached = False
        self.cancelled = False
        """Whether the controller's own goal was cancelled, which the behaviour tree takes for success."""

    @property
    def places_left(self) -> int:
        """How many places are not passed yet, the last one among them."""
        return len(self._via) + 1

    @property
    def next_place(self) -> Pose | None:
        """Where the robot is to drive to now; None: it is to stand."""
        if self.cancelled:
            return None
        return self._via[0] if self._via and self.end is not None else self.end

    @property
    def behind(self) -> float:
        """How far the way goes on behind :attr:`next_place`, m."""
        return _length([*self._via, self.end]) if self.end is not None else 0.0

    def left(self, pose: Pose) -> float:
        """Give the length of the way that is left for a robot at ``pose``, m."""
        return _length([pose, *self._via, self.target.pose])

    def move_to(self, pose: Pose) -> None:
        """Note that the robot is at ``pose`` now; the place counts once it has been met."""
        if self.end is None:
            return
        while self._via and pose.distance(self._via[0]) <= PASSED_WITHIN:
            del self._via[0]
        self._at_place = self._at_place or (not self._via and pose.distance(self.end) <= XY_TOLERANCE)
        self._reached = self._at_place and abs(wrap(pose.yaw - self.end.yaw)) <= YAW_TOLERANCE

    def progress(self, pose: Pose) -> Progress:
        """Tell how the drive stands with the robot at ``pose``."""
        if self.cancelled:
            return Progress.REACHED
        given_up = self._abort_within is not None and self.left(pose) <= self._abort_within
        if self.end is None or given_up:
            return Progress.FAILED
        return Progress.REACHED if self._reached else Progress.UNDERWAY

    def plan(self, pose: Pose) -> list[Pose]:
        """Give the way that is left, straight from ``pose`` over each place to its end, turned last."""
        if self.end is None:
            return []
        corners = [pose, *self._via, self.end]
        most = max(1, PLAN_PARTS // (len(corners) - 1))
        parts = (_straight(start, end, most) for start, end in pairwise(corners))
        return [place for part in parts for place in part] + [self.end]


def _straight(start: Pose, end: Pose, most: int) -> list[Pose]:
    """Give at most ``most`` poses from ``start`` to before ``end``, heading along the way."""
    heading = start.bearing(end)
    parts = max(1, math.ceil(min(start.distance(end) / PLAN_SPACING, most)))
    dx, dy = (end.x - start.x) / parts, (end.y - start.y) / parts
    return [Pose(start.x + i * dx, start.y + i * dy, heading) for i in range(parts)]


def _length(way: Sequence[Pose]) -> float:
    return sum(start.distance(end) for start, end in pairwise(way))
