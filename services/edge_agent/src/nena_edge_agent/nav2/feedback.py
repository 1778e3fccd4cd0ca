"""What Nav2's feedback shows: passed poses, the robot's position, the remaining distance, and silence."""

from __future__ import annotations

import math
from collections.abc import Sequence

from nena_edge_agent.driver.port import DriveGoal, DriveProgress, Pose
from nena_edge_agent.nav2.goals import FeedbackReading
from nena_edge_agent.nav2.poses import SAME, near

STOPPED_AFTER = 0.5
"""Seconds without feedback, which Nav2 sends every 10 ms, after which the controller is stopped."""
OBEYED_AFTER = 1.0
"""Seconds without feedback after which the drive fails if the robot has not slowed down."""
GIVEN_UP_AFTER = 2.0
"""Seconds without feedback after which the drive fails even if the robot has stopped."""
TURNED_AWAY = 0.3
"""Increase of the distance to a pose, m, at which the robot counts as turning away from it."""


class PassedPoses:
    """Tracks a goal through several poses; those after the next one are its ``ahead``."""

    def __init__(self) -> None:
        self._places: tuple[Pose, ...] = ()
        self._dropped = False
        self._closest = math.inf

    def begin_route(self, goal: DriveGoal) -> None:
        """Record the poses sent to navigation."""
        self._places = (goal.pose, *goal.ahead)
        self.advance_goal()

    def advance_goal(self) -> None:
        """Record that the next pose is now the goal."""
        self._dropped, self._closest = False, math.inf

    def covers(self, goal: DriveGoal) -> bool:
        """Return whether navigation already drives to ``goal`` and through the poses ahead of it."""
        wanted = (goal.pose, *goal.ahead)
        if len(self._places) <= 1 or len(wanted) > len(self._places):
            return False
        # Navigation drives through what it was sent: a route that ends elsewhere must be sent again.
        rest = self._places[-len(wanted) :]
        same = (near(pose, place, xy=SAME, theta=None) for pose, place in zip(wanted, rest, strict=True))
        return all(same)

    def on_places_left(self, goal: DriveGoal, places: int) -> None:
        """Record how many poses navigation has left to reach."""
        # The default tree removes poses within 0.7 m (RemovePassedGoals), and looks every 3 s.
        self._dropped = self._dropped or places <= len(goal.ahead)

    def is_missed(self, goal: DriveGoal, pose: Pose) -> bool:
        """Return whether the robot turns away from ``goal`` without having reached it."""
        if not goal.ahead or not self._dropped:
            return False
        away = math.dist((pose.x, pose.y), (goal.pose.x, goal.pose.y))
        self._closest = min(self._closest, away)
        return self._closest > goal.deviation_xy and away > self._closest + TURNED_AWAY


POSE_STEP = 0.05
"""Distance between two reported positions, m."""
YAW_STEP = 0.1
"""Radians."""
PROGRESS_PERIOD = 1.0
"""Seconds between two reports of the remaining distance."""
FRESH = 0.5
"""Seconds for which a pose from the feedback takes precedence over the localisation's, which are rarer."""


SILENCES = (STOPPED_AFTER, OBEYED_AFTER, GIVEN_UP_AFTER)
COUNTED = 0.2
"""Maximum time between two velocities that counts as silence, seconds; a longer gap delayed everything."""


class SilenceWatch:
    """Detects that the driving server no longer sends feedback; times are monotonic seconds.

    Once odometry has arrived, only time in which it arrives is counted: network, computer and this program
    work then, so only the server is silent. A goal without feedback so far is not watched: goals sent by
    topic may never have any.
    """

    def __init__(self) -> None:
        self._heard_at: float | None = None
        self._goal_id = ""
        self._odometry_at = -math.inf
        self._silent_for = 0.0
        self._reported = 0

    @property
    def by_odometry(self) -> bool:
        """Return whether odometry has arrived, so that :meth:`on_velocity` alone decides."""
        return self._odometry_at != -math.inf

    def on_feedback(self, goal_id: str, now: float) -> None:
        """Record feedback for one of our goals that has not ended."""
        self._heard_at, self._goal_id, self._silent_for, self._reported = now, goal_id, 0.0, 0

    def on_velocity(self, now: float, live: Sequence[str]) -> float:
        """Record that odometry has arrived; return the seconds of a silence to handle now, or 0.

        ``live`` are our goals that have not ended.
        """
        previous_at, self._odometry_at = self._odometry_at, now
        if self._heard_at is None or self._goal_id not in live:
            self._heard_at = None
            return 0.0
        self._silent_for += min(now - max(previous_at, self._heard_at), COUNTED)
        passed = sum(self._silent_for >= limit for limit in SILENCES)
        if passed <= self._reported:
            return 0.0
        self._reported = passed
        return self._silent_for

    def silent_for(self, now: float, live: Sequence[str]) -> float:
        """Return the seconds since the last feedback; 0 before the first of a goal."""
        return 0.0 if self._heard_at is None or self._goal_id not in live else now - self._heard_at


class FeedbackFilter:
    """Selects the feedback to report; times are monotonic seconds."""

    def __init__(self) -> None:
        self._received_at = -math.inf
        self._place = (math.inf, math.inf)
        self._yaw = 0.0
        self._progress_at = -math.inf
        self._progress: tuple[str, int] = ("", 0)

    def is_fresh(self, now: float) -> bool:
        """Return whether feedback with positions is arriving now."""
        return now - self._received_at < FRESH

    def has_moved(self, reading: FeedbackReading, now: float) -> bool:
        """Return whether to report the position."""
        self._received_at = now
        here = (reading.x, reading.y)
        turned = abs(math.remainder(reading.yaw - self._yaw, math.tau))
        if math.dist(here, self._place) < POSE_STEP and turned < YAW_STEP:
            return False
        self._place, self._yaw = here, reading.yaw
        return True

    def progress(self, reading: FeedbackReading, map_id: str, now: float) -> DriveProgress | None:
        """Return the remaining distance to report, None if there is nothing new.

        A recovery is reported at once.
        """
        drive = (reading.goal_id, reading.recoveries)
        if drive == self._progress and now - self._progress_at < PROGRESS_PERIOD:
            return None
        self._progress, self._progress_at = drive, now
        left = reading.left if reading.left > 0.0 else None  # Nav2 reports 0 while it has no path
        return DriveProgress(left, reading.recoveries, map_id)
