"""Goals of bt_navigator's actions: status array, error codes and cancel requests."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from uuid import UUID

from nena_shared.ros import GoalStatus


class Action(StrEnum):
    """The actions of bt_navigator and of the controller; the value is the name in the ROS graph."""

    TO_POSE = "navigate_to_pose"
    THROUGH_POSES = "navigate_through_poses"
    FOLLOW_PATH = "follow_path"
    """Of controller_server; the others are of bt_navigator."""


THROUGH_POSES = 100
"""Offset of the planner's codes (200 and above) for NavigateThroughPoses."""


class ErrorCode(IntEnum):
    """The error codes of Nav2's action results (Jazzy) that this robot uses."""

    NONE = 0
    """No error, or the goal never started."""
    CONTROLLER_TF = 102
    """From the controller: the robot's position is unknown."""
    FAILED_TO_MAKE_PROGRESS = 105
    """From the controller: the robot is stuck."""
    PLANNER_TF = 202
    """From the planner: a frame, or the robot's position, is unknown."""
    START_OUTSIDE_MAP = 203
    GOAL_OUTSIDE_MAP = 204
    NO_VALID_PATH = 208
    NO_VIAPOINTS_GIVEN = 309
    """A NavigateThroughPoses goal without poses."""


def of_several(code: int) -> int:
    """Return the NavigateThroughPoses counterpart of a code."""
    by_planner = code // THROUGH_POSES == ErrorCode.NO_VALID_PATH // THROUGH_POSES
    return code + THROUGH_POSES if by_planner else code


# As in rcl (goal_state_machine.c): a goal may still succeed or abort while it is being cancelled.
_NEXT: dict[GoalStatus, frozenset[GoalStatus]] = {
    GoalStatus.EXECUTING: frozenset(
        (GoalStatus.CANCELING, GoalStatus.SUCCEEDED, GoalStatus.ABORTED),
    ),
    GoalStatus.CANCELING: frozenset(
        (GoalStatus.SUCCEEDED, GoalStatus.CANCELED, GoalStatus.ABORTED),
    ),
}
"""State machine of a goal after acceptance; statuses without an entry are terminal."""


class GoalTransitionError(Exception):
    """Invalid status transition of a goal; a bug in this program."""

    def __init__(self, goal_id: UUID, old: GoalStatus, new: GoalStatus) -> None:
        super().__init__(f"goal {goal_id} cannot go from {old.name} to {new.name}")
        self.goal_id = goal_id
        self.old = old
        self.new = new


@dataclass(frozen=True, slots=True)
class GoalEntry:
    """A goal in the array; ``accepted_ns`` is UTC in nanoseconds by the robot's clock.

    ``error_code`` is only in the goal's result, not in the array; 0: no error.
    """

    goal_id: UUID
    accepted_ns: int
    status: GoalStatus
    error_code: int = 0

    @property
    def ended(self) -> bool:
        """Whether the status is terminal."""
        return self.status not in _NEXT

    @property
    def cancelable(self) -> bool:
        """Whether the goal can be cancelled; a goal that is CANCELING already cannot."""
        return self.status is GoalStatus.EXECUTING


Snapshot = tuple[GoalEntry, ...]


class StatusArray:
    """The goals in order of acceptance, and the arrays not published yet.

    ``retention`` is in seconds from the terminal status (``action_server_result_timeout``).
    """

    def __init__(self, retention: float) -> None:
        self._retention = retention
        self._goals: dict[UUID, GoalEntry] = {}
        self._ended_at: dict[UUID, float] = {}
        self._unpublished: list[Snapshot] = []

    def __getitem__(self, goal_id: UUID) -> GoalStatus:
        """Return the status of a goal; KeyError if it is unknown or expired."""
        return self._goals[goal_id].status

    def entries(self, now: float) -> Snapshot:
        """Return the goals kept at ``now`` (monotonic seconds)."""
        # rcl publishes nothing when a goal expires. It counts from the end since 9.2.8, not from acceptance.
        for goal_id in [known for known, ended in self._ended_at.items() if now - ended >= self._retention]:
            del self._goals[goal_id], self._ended_at[goal_id]
        return tuple(self._goals.values())

    def forget_all(self) -> None:
        """Remove all goals without publishing, like a restarted server."""
        self._goals.clear()
        self._ended_at.clear()
        self._unpublished.clear()

    def accept(self, goal_id: UUID, accepted_ns: int, now: float) -> None:
        """Add a goal; accept-and-execute shows it as EXECUTING at once."""
        self._goals[goal_id] = GoalEntry(goal_id, accepted_ns, GoalStatus.EXECUTING)
        self._publish_entries(now)

    def cancel(self, goal_ids: Iterable[UUID], now: float) -> None:
        """Set goals to CANCELING, all in one array."""
        for goal_id in goal_ids:
            self._change_status(goal_id, GoalStatus.CANCELING)
        self._publish_entries(now)

    def find(self, goal_id: UUID, now: float) -> GoalEntry | None:
        """Return a goal kept at ``now``."""
        return next((goal for goal in self.entries(now) if goal.goal_id == goal_id), None)

    def end(self, goal_id: UUID, status: GoalStatus, now: float, error_code: int = 0) -> None:
        """Set a goal to a terminal status, with the error code of its result.

        Raises:
            GoalTransitionError: the goal's state machine has no such step.
        """
        self._change_status(goal_id, status, error_code)
        self._ended_at[goal_id] = now
        self._publish_entries(now)

    def take_unpublished(self) -> list[Snapshot]:
        """Return the new arrays since the last call, oldest first."""
        taken, self._unpublished = self._unpublished, []
        return taken

    def _change_status(self, goal_id: UUID, status: GoalStatus, error_code: int = 0) -> None:
        old = self._goals[goal_id]
        if status not in _NEXT.get(old.status, ()):
            raise GoalTransitionError(goal_id, old.status, status)
        self._goals[goal_id] = GoalEntry(goal_id, old.accepted_ns, status, error_code)

    def _publish_entries(self, now: float) -> None:
        self._unpublished.append(self.entries(now))


ANY_GOAL = UUID(int=0)
"""The goal ID of a request without a goal."""


class CancelCode(IntEnum):
    """Return codes of action_msgs/srv/CancelGoal."""

    NONE = 0
    REJECTED = 1
    UNKNOWN_GOAL_ID = 2
    GOAL_TERMINATED = 3


@dataclass(frozen=True, slots=True)
class CancelAnswer:
    """The response of the service, and the goals that change to CANCELING."""

    code: CancelCode
    goals: Snapshot = ()


def answer_cancel(goals: Snapshot, goal_id: UUID, stamp_ns: int) -> CancelAnswer:
    """Answer a CancelGoal request; ``stamp_ns`` is UTC in nanoseconds, 0 for none.

    A goal without a stamp selects only that goal. Without a goal, or with a stamp, all goals accepted up to
    the stamp are selected (no stamp: all goals), and no match is not an error.
    """
    if goal_id != ANY_GOAL and stamp_ns == 0:
        return _cancel_one(goals, goal_id)
    return CancelAnswer(
        CancelCode.NONE,
        tuple(g for g in goals if g.cancelable and (g.goal_id == goal_id or _up_to(g, stamp_ns))),
    )


def _cancel_one(goals: Snapshot, goal_id: UUID) -> CancelAnswer:
    found = next((goal for goal in goals if goal.goal_id == goal_id), None)
    if found is None:
        return CancelAnswer(CancelCode.UNKNOWN_GOAL_ID)
    # rcl returns this code also for a goal that is CANCELING already.
    if not found.cancelable:
        return CancelAnswer(CancelCode.GOAL_TERMINATED)
    return CancelAnswer(CancelCode.NONE, (found,))


def _up_to(goal: GoalEntry, stamp_ns: int) -> bool:
    return stamp_ns == 0 or goal.accepted_ns <= stamp_ns
