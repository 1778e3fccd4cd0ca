"""What kind of failure has ended a mission: what may be tried next depends on it."""

from __future__ import annotations

from enum import StrEnum


class FailureKind(StrEnum):
    """How a mission has failed, and so how much is known of what the robot has done of it."""

    REFUSED = "REFUSED"
    """The robot has refused it, or has one already."""
    UNFIT = "UNFIT"
    """The robot could never take it, by its factsheet; nothing was sent."""
    NOT_TAKEN = "NOT_TAKEN"
    """It was sent again and again, and the robot never took it up."""
    DRIVE = "DRIVE"
    """The robot had it and could not go on, or gave it up; its operation is not done."""
    ACTION = "ACTION"
    """The robot has come to the end of the way, and its operation has FAILED there."""
    LOST = "LOST"
    """The robot had it, and knows nothing of it any more."""
    UNCLEAR = "UNCLEAR"
    """Nobody knows what the robot has done of it, or whether it still is at it."""
    NO_WAY = "NO_WAY"
    """There is no way to the destination now; nothing was sent."""
