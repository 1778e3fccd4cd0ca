"""The status array of Nav2's action, as plain data (action_msgs/GoalStatusArray)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class GoalStatus(IntEnum):
    """action_msgs/GoalStatus."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @classmethod
    def of(cls, number: int) -> GoalStatus:
        """Give the status of a number on the wire; UNKNOWN for a number that the definition does not have."""
        try:
            return cls(number)
        except ValueError:
            return cls.UNKNOWN

    @property
    def terminal(self) -> bool:
        """Whether the goal has ended; no other status follows."""
        return self >= GoalStatus.SUCCEEDED


@dataclass(frozen=True, slots=True)
class GoalEntry:
    """One goal of the array: its id in hexadecimal digits, and its status."""

    goal_id: str
    status: GoalStatus
