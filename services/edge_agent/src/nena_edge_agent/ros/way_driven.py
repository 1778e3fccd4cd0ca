"""The places that one goal leads over, and whether the robot leaves one of them out."""

from __future__ import annotations

import math

from nena_edge_agent.driver.map_port import MapGoal, MapPose
from nena_edge_agent.ros.pose import near

SAME = 0.001
"""Metres that two places of the same node may differ by."""
TURNED_AWAY = 0.3
"""Metres by which a robot is further from a place than it was, when it does not drive to it any more."""


class WayDriven:
    """Follows a goal over several places; those behind the one that is wanted next are its ``ahead``."""

    def __init__(self) -> None:
        self._places: tuple[MapPose, ...] = ()
        self._let_go = False
        self._closest = math.inf

    def begin(self, goal: MapGoal) -> None:
        """Note which places navigation is given."""
        self._places = (goal.pose, *goal.ahead)
        self.go_on()

    def go_on(self) -> None:
        """Note that the next place is wanted now."""
        self._let_go, self._closest = False, math.inf

    def covers(self, goal: MapGoal) -> bool:
        """Tell whether navigation, as it is, drives to ``goal`` and over what is ahead of it."""
        wanted = (goal.pose, *goal.ahead)
        if len(self._places) <= 1 or len(wanted) > len(self._places):
            return False
        rest = self._places[-len(wanted) :]
        same = (near(one, other, xy=SAME, theta=None) for one, other in zip(wanted, rest, strict=True))
        return all(same)

    def left(self, goal: MapGoal, places: int) -> None:
        """Note how many places navigation still means to drive to."""
        self._let_go = self._let_go or places <= len(goal.ahead)

    def missed(self, goal: MapGoal, pose: MapPose) -> bool:
        """Tell whether the robot turns away from ``goal`` without having been there."""
        if not goal.ahead or not self._let_go:
            return False
        away = math.dist((pose.x, pose.y), (goal.pose.x, goal.pose.y))
        self._closest = min(self._closest, away)
        return self._closest > goal.deviation_xy and away > self._closest + TURNED_AWAY
