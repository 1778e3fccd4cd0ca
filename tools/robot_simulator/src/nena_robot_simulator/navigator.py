"""The navigator: an action server of bt_navigator without its behaviour tree, and the drive to a target.

The server follows Nav2's SimpleActionServer: one current goal, one pending goal, one loop.

- A goal that arrives while another one is running is pending until the next cycle, then takes over without a
  stop; the old goal ends ABORTED.
- While a goal is pending, a cancel request is checked on it only. This is a race in Nav2, which an
  agent must handle.
- Cancelling halts the behaviour tree first, which takes a moment; then all goals end at once.
- A goal that takes over in the cycle in which the tree ends gets the old drive's result,
  another race in Nav2.
- bt_navigator has two such servers, of which only one drives: a goal for the other one ends ABORTED at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from itertools import pairwise
from typing import NamedTuple
from uuid import UUID

from nena_robot_simulator.goals import ErrorCode, StatusArray
from nena_robot_simulator.motion import Pose
from nena_shared.ros import GoalStatus, wrap


@dataclass(frozen=True, slots=True)
class Goal:
    """A NavigateToPose goal, or with ``via`` a NavigateThroughPoses goal, in ``frame_id``."""

    goal_id: UUID
    pose: Pose
    frame_id: str
    via: tuple[Pose, ...] = ()
    tree: str = ""
    """File of the behaviour tree; empty: the default one."""


class Target(NamedTuple):
    """The target of a goal in the map frame, through the poses of ``via``."""

    goal_id: UUID
    pose: Pose
    via: tuple[Pose, ...] = ()


class Progress(Enum):
    """Progress of the drive to the target."""

    UNDERWAY = auto()
    REACHED = auto()
    FAILED = auto()


class Navigator:
    """Accepts goals and decides when and with which status each one ends.

    ``resolve`` transforms a pose from a frame to the map frame, or returns None if the frame is unknown or
    the robot is not localised. ``halting`` returns the seconds that halting the behaviour tree takes,
    ``barred`` whether the other server drives. All times are monotonic seconds.
    """

    def __init__(
        self,
        *,
        goals: StatusArray,
        resolve: Callable[[Pose, str], Pose | None],
        halting: Callable[[], float],
        barred: Callable[[], bool] = lambda: False,
    ) -> None:
        self.goals = goals
        self._resolve = resolve
        self._halting = halting
        self._barred = barred
        self._active = True
        self._current: Goal | None = None
        self._pending: Goal | None = None
        self._path: tuple[Pose, ...] | None = None
        self._began_at = 0.0
        self._halted_at: float | None = None
        self._code_when_halted = 0

    @property
    def active(self) -> bool:
        """Whether the lifecycle node is active and accepts goals."""
        return self._active

    @property
    def busy(self) -> bool:
        """Whether a goal is active."""
        return self._current is not None

    @property
    def driving(self) -> bool:
        """Whether the robot drives for a goal or is being halted."""
        return self._path is not None

    @property
    def target(self) -> Target | None:
        """The current target; None: stop."""
        if self._current is None or self._path is None or self._halted_at is not None:
            return None
        return Target(self._current.goal_id, self._path[-1], self._path[:-1])

    @property
    def began_at(self) -> float:
        """Time of acceptance of the current goal."""
        return self._began_at

    def set_active(self, *, active: bool) -> None:
        """Activate or deactivate the lifecycle node; goals end once the tree is halted."""
        self._active = active

    def restart(self) -> None:
        """Restart like a crashed process; its goals disappear without an end."""
        self.goals.forget_all()
        self._current = self._pending = self._path = self._halted_at = None

    def abort(self, now: float) -> None:
        """End all goals at once: another action drives from now on."""
        self._terminate_all(now)

    def take(self, goal: Goal, accepted_ns: int, now: float) -> bool:
        """Accept a goal; return False if the server is inactive."""
        if not self._active:
            return False
        self.goals.accept(goal.goal_id, accepted_ns, now)
        if self._current is None:
            self._current, self._began_at = goal, now
            return True
        if self._pending is not None:
            self._terminate_goal(self._pending, now)
        # simple_action_server.hpp has one pending slot; the goal in it gives way to a newer one.
        self._pending = goal
        return True

    def tick(self, now: float, progress: Progress, error_code: int = 0) -> None:
        """Run one cycle.

        ``progress`` is towards :attr:`target`, ``error_code`` is the reason of a failure, also of a plan that
        is tried again: a goal that is cancelled then has it in its result.
        """
        if self._current is None:
            return
        if self._halted_at is not None:
            if now >= self._halted_at:
                self._terminate_all(now, self._code_when_halted)
        elif self._path is None:
            self._begin_goal(self._current, now)
        # As in is_cancel_requested of Nav2: a pending goal hides the request to cancel the current one.
        elif self._cancel_requested(self._pending or self._current):
            self._halted_at, self._code_when_halted = now + self._halting(), error_code
        else:
            current = self._preempt_goal(self._current, now)
            if progress is not Progress.UNDERWAY:
                self._finish_goal(current, progress, now, error_code)

    def _cancel_requested(self, asked: Goal) -> bool:
        return not self._active or self.goals[asked.goal_id] is GoalStatus.CANCELING

    def _preempt_goal(self, current: Goal, now: float) -> Goal:
        """Replace the current goal by the pending one; with an invalid pose, the robot keeps its old path."""
        if self._pending is None:
            return current
        if self._pending.tree != current.tree:  # the running tree is not replaced
            self._terminate_goal(self._pending, now)
            self._pending = None
            return current
        self.goals.end(current.goal_id, GoalStatus.ABORTED, now)
        self._current, self._pending, self._began_at = self._pending, None, now
        # Nav2 makes a goal current before it transforms its pose, so a failure leaves the old path.
        self._path = self._path_of(self._current) or self._path
        return self._current

    def _begin_goal(self, goal: Goal, now: float) -> None:
        """Start from standstill; a goal with an invalid pose ends at once."""
        # The two navigators share one mutex (behavior_tree_navigator.hpp).
        self._path = None if self._barred() else self._path_of(goal)
        if self._path is None:
            self._finish_goal(goal, Progress.FAILED, now)

    def _path_of(self, goal: Goal) -> tuple[Pose, ...] | None:
        """Return the poses of a goal in the map frame; None if one of them is unknown."""
        places = [self._resolve(place, goal.frame_id) for place in (*goal.via, goal.pose)]
        found = tuple(place for place in places if place is not None)
        return found if len(found) == len(places) else None

    def _finish_goal(self, goal: Goal, progress: Progress, now: float, error_code: int = 0) -> None:
        if progress is Progress.REACHED:
            self.goals.end(goal.goal_id, GoalStatus.SUCCEEDED, now)
        else:
            self._terminate_goal(goal, now, error_code)
        self._current, self._pending, self._path, self._began_at = self._pending, None, None, now

    def _terminate_all(self, now: float, error_code: int = 0) -> None:
        ending = [goal for goal in (self._current, self._pending) if goal is not None]
        self._current = self._pending = self._path = self._halted_at = None
        for goal in ending:
            self._terminate_goal(goal, now, error_code)

    def _terminate_goal(self, goal: Goal, now: float, error_code: int = 0) -> None:
        """End a goal without success: CANCELED if a client requested it, else ABORTED."""
        asked = self.goals[goal.goal_id] is GoalStatus.CANCELING
        status = GoalStatus.CANCELED if asked else GoalStatus.ABORTED
        self.goals.end(goal.goal_id, status, now, error_code)


XY_TOLERANCE = 0.25
"""Distance from the end of the path within which a goal counts as reached (``xy_goal_tolerance``), m."""
YAW_TOLERANCE = 0.25
"""Deviation from the goal's heading within which it counts as reached, rad (``yaw_goal_tolerance``)."""
PASSED_WITHIN = 0.7
"""Distance from a pose at which the tree counts it as passed, m (``RemovePassedGoals``)."""
FOLLOWED_WITHIN = 0.2
"""Distance from a pose of a path at which the controller heads for the next one, m."""
PLAN_SPACING = 0.25
"""Distance between the poses of the published plan, m, unless it would exceed ``PLAN_PARTS``."""
PLAN_PARTS = 10_000


# Nav2's default tree: spin 1.57 rad, wait 5 s, back up 0.3 m.
RECOVERY = ((1.6, 0.0, 1.0), (5.0, 0.0, 0.0), (2.0, -0.15, 0.0))
"""Recoveries of a robot without a path, in turn: seconds, m/s, rad/s (spin, wait, back up)."""
# Measured: 12 to 15 recoveries in 17 to 21 s.
RECOVERY_PERIOD = 1.35
"""Seconds between two counts of ``number_of_recoveries``."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """The recoveries of a robot without a path: ``seconds`` of its own time, ``pace`` to one of ours."""

    began_at: float
    seconds: float
    pace: float = 1.0

    def over(self, now: float) -> bool:
        """Return whether the behaviour tree fails."""
        return self._time_spent(now) >= self.seconds

    def count(self, now: float) -> int:
        """Return the number of recoveries so far."""
        return int(min(self._time_spent(now), self.seconds) / RECOVERY_PERIOD)

    def _time_spent(self, now: float) -> float:
        return (now - self.began_at) * self.pace

    def command(self, now: float) -> tuple[float, float]:
        """Return the velocity of the current recovery, m/s and rad/s."""
        rest = self._time_spent(now) % sum(seconds for seconds, _, _ in RECOVERY)
        for seconds, speed, yaw_rate in RECOVERY:
            if rest < seconds:
                return speed, yaw_rate
            rest -= seconds
        return 0.0, 0.0


@dataclass(frozen=True, slots=True)
class DriveFailure:
    """How a drive fails."""

    error_code: int = ErrorCode.NONE
    abort_after: float | None = None
    """Fraction of the path, 0 to 1, after which the controller gives up."""
    recovery: Recovery | None = None
    """Recoveries before the drive fails, if there is no path."""


NO_FAILURE = DriveFailure()


class Drive:
    """The drive to one target; ``end`` is None if the planner found no path."""

    def __init__(
        self,
        target: Target,
        start: Pose,
        end: Pose | None,
        *,
        failure: DriveFailure = NO_FAILURE,
        tolerances: tuple[float, float] = (XY_TOLERANCE, YAW_TOLERANCE),
        passed_within: float = PASSED_WITHIN,
    ) -> None:
        self.target = target
        self._passed_within = passed_within
        self.end = end
        self.error_code = failure.error_code
        self.recovery = failure.recovery
        self._tolerances = tolerances
        self._via = list(target.via)
        whole = _length_of([start, *target.via, target.pose])
        self._abort_within = None if failure.abort_after is None else (1.0 - failure.abort_after) * whole
        self._at_place = False
        self._reached = False
        self.unanswered_at: float | None = None
        """When bt_navigator called a server for it that has not answered."""
        self.cancelled = False
        """Whether the controller's own goal was cancelled, which the behaviour tree treats as success."""

    @property
    def places_left(self) -> int:
        """Number of poses not passed yet, including the last one."""
        return len(self._via) + 1

    @property
    def next_place(self) -> Pose | None:
        """The pose to drive to; None: stop."""
        if self.cancelled:
            return None
        return self._via[0] if self._via and self.end is not None else self.end

    @property
    def behind(self) -> float:
        """Length of the path beyond :attr:`next_place`, m."""
        return _length_of([*self._via, self.end]) if self.end is not None else 0.0

    def fail(self, error_code: int) -> None:
        """Make the controller give up."""
        self.end, self.error_code, self.recovery = None, error_code, None

    def left(self, pose: Pose) -> float:
        """Return the remaining length of the path from ``pose``, m; 0 without one."""
        if self.end is None:
            return 0.0
        return _length_of([pose, *self._via, self.target.pose])

    def move_to(self, pose: Pose) -> None:
        """Update the robot's pose; the goal's position counts once it has been reached."""
        if self.end is None:
            return
        while self._via and pose.distance(self._via[0]) <= self._passed_within:
            del self._via[0]
        xy, yaw = self._tolerances
        # Of the path, not the goal: the planner may end up to its tolerance away. Reached once is enough,
        # because Nav2's goal checker is stateful.
        self._at_place = self._at_place or (not self._via and pose.distance(self.end) <= xy)
        self._reached = self._at_place and abs(wrap(pose.yaw - self.end.yaw)) <= yaw

    def progress(self, pose: Pose, now: float) -> Progress:
        """Return the progress with the robot at ``pose``."""
        if self.cancelled:
            return Progress.REACHED
        if self.recovery is not None and not self.recovery.over(now):
            return Progress.UNDERWAY
        given_up = self._abort_within is not None and self.left(pose) <= self._abort_within
        if self.end is None or given_up:
            return Progress.FAILED
        return Progress.REACHED if self._reached else Progress.UNDERWAY

    def plan(self, pose: Pose) -> list[Pose]:
        """Return the remaining path: straight lines from ``pose`` through each pose to the end."""
        if self.end is None:
            return []
        corners = [pose, *self._via, self.end]
        most = max(1, PLAN_PARTS // (len(corners) - 1))
        parts = (_straight_poses(start, end, most) for start, end in pairwise(corners))
        return [place for part in parts for place in part] + [self.end]


def _straight_poses(start: Pose, end: Pose, most: int) -> list[Pose]:
    """Return at most ``most`` poses from ``start`` up to ``end`` (exclusive), heading along the line."""
    heading = start.bearing(end)
    # The path of a client is not checked, so a distance may be infinite.
    parts = max(1, math.ceil(min(start.distance(end) / PLAN_SPACING, most)))
    dx, dy = (end.x - start.x) / parts, (end.y - start.y) / parts
    return [Pose(start.x + i * dx, start.y + i * dy, heading) for i in range(parts)]


def _length_of(way: Sequence[Pose]) -> float:
    return sum(start.distance(end) for start, end in pairwise(way))
