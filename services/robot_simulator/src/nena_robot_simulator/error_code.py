"""Why a drive has failed, as the results of Nav2's actions say it (Jazzy)."""

from __future__ import annotations

from enum import IntEnum

THROUGH_POSES = 100
"""What the planner's codes, 200 and more, are higher by where a way over several places was asked for."""


class ErrorCode(IntEnum):
    """Codes that this robot gives by itself, of some dozens that Nav2 has."""

    NONE = 0
    """Also: the goal never started."""
    FAILED_TO_MAKE_PROGRESS = 105
    """The controller: the robot does not get on."""
    GOAL_OUTSIDE_MAP = 204
    GOAL_OCCUPIED = 206
    NO_VALID_PATH = 208
    NO_VIAPOINTS_GIVEN = 309
    """A goal over several places names none."""


def of_several(code: int) -> int:
    """Give a code as it is where a way over several places was asked for."""
    by_planner = code // THROUGH_POSES == ErrorCode.NO_VALID_PATH // THROUGH_POSES
    return code + THROUGH_POSES if by_planner else code
