"""What the feedback of Nav2's action says of the drive, and how much of it is told on."""

from __future__ import annotations

import math
from dataclasses import dataclass

from nena_edge_agent.driver.port import DriveProgress

POSE_STEP = 0.05
"""Metres between two places that are told on."""
YAW_STEP = 0.1
"""Radians."""
PROGRESS_PERIOD = 1.0
"""Seconds between two reports of what is left."""
FRESH = 0.5
"""Seconds for which a pose of the feedback is better than one of the localisation, which comes seldom."""


@dataclass(frozen=True, slots=True)
class FeedbackReading:
    """One message: the place in m and rad of ``frame``, the way that is left in m and in places."""

    goal_id: str
    x: float
    y: float
    yaw: float
    frame: str
    left: float
    recoveries: int
    places_left: int = 1


class FeedbackFilter:
    """Lets pass what is news; times are monotonic seconds."""

    def __init__(self) -> None:
        self._heard_at = -math.inf
        self._heard_of = ""
        self._place = (math.inf, math.inf)
        self._yaw = 0.0
        self._progress_at = -math.inf
        self._progress: tuple[str, int] = ("", 0)

    def fresh(self, now: float) -> bool:
        """Tell whether feedback comes now."""
        return now - self._heard_at < FRESH

    def silent_for(self, goal_id: str | None, now: float) -> float:
        """Return the seconds since the last feedback of a goal; 0 where none has come of it yet."""
        return now - self._heard_at if goal_id is not None and goal_id == self._heard_of else 0.0

    def moved(self, reading: FeedbackReading, now: float) -> bool:
        """Tell whether the place is to be told on."""
        self._heard_at, self._heard_of = now, reading.goal_id
        here = (reading.x, reading.y)
        turned = abs(math.remainder(reading.yaw - self._yaw, math.tau))
        if math.dist(here, self._place) < POSE_STEP and turned < YAW_STEP:
            return False
        self._place, self._yaw = here, reading.yaw
        return True

    def progress(self, reading: FeedbackReading, map_id: str, now: float) -> DriveProgress | None:
        """Give what is to be told of the way that is left; a recovery is told at once."""
        drive = (reading.goal_id, reading.recoveries)
        if drive == self._progress and now - self._progress_at < PROGRESS_PERIOD:
            return None
        self._progress, self._progress_at = drive, now
        return DriveProgress(max(0.0, reading.left), reading.recoveries, map_id)
