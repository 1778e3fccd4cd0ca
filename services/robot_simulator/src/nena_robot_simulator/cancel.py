"""Which goals a CancelGoal request means (action_msgs/srv/CancelGoal)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from uuid import UUID

from nena_robot_simulator.status_array import GoalEntry, Snapshot

ANY_GOAL = UUID(int=0)
"""The goal id of a request that names no goal."""


class CancelCode(IntEnum):
    """Return codes of action_msgs/srv/CancelGoal."""

    NONE = 0
    REJECTED = 1
    UNKNOWN_GOAL_ID = 2
    GOAL_TERMINATED = 3


@dataclass(frozen=True, slots=True)
class CancelAnswer:
    """What the service answers, and the goals that change to CANCELING."""

    code: CancelCode
    goals: Snapshot = ()


def answer(goals: Snapshot, goal_id: UUID, stamp_ns: int) -> CancelAnswer:
    """Decide on a request; ``stamp_ns`` is UTC in nanoseconds, 0 for none.

    A goal without a stamp means that goal alone. Without a goal, or with a stamp, all goals are meant that
    were accepted up to the stamp (no stamp: all of them), and then no match is no error.
    """
    if goal_id != ANY_GOAL and stamp_ns == 0:
        return _one(goals, goal_id)
    return CancelAnswer(
        CancelCode.NONE,
        tuple(g for g in goals if g.cancelable and (g.goal_id == goal_id or _up_to(g, stamp_ns))),
    )


def _one(goals: Snapshot, goal_id: UUID) -> CancelAnswer:
    found = next((goal for goal in goals if goal.goal_id == goal_id), None)
    if found is None:
        return CancelAnswer(CancelCode.UNKNOWN_GOAL_ID)
    if not found.cancelable:
        return CancelAnswer(CancelCode.GOAL_TERMINATED)
    return CancelAnswer(CancelCode.NONE, (found,))


def _up_to(goal: GoalEntry, stamp_ns: int) -> bool:
    return stamp_ns == 0 or goal.accepted_ns <= stamp_ns
