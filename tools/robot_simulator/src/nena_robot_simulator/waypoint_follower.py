"""Nav2's waypoint follower: one goal for the navigator after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any
from uuid import UUID, uuid4

from nena_robot_simulator import messages
from nena_robot_simulator.action_server import SimpleAction
from nena_robot_simulator.goals import Action, GoalEntry
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.session import RosSession
from nena_shared.log import get_logger
from nena_shared.ros import GoalStatus, interface

log = get_logger(__name__)

NAME = "follow_waypoints"
PERIOD = 0.05
"""Seconds between two checks of the navigator's goal."""
UNKNOWN = 600
"""Error code of a waypoint that was not reached."""


@dataclass(slots=True)
class _Tour:
    """The goal at hand: its waypoints, and the navigator's goal for the one at ``index``."""

    goal_id: UUID
    poses: list[Any]
    index: int
    loops_left: int
    drive: UUID | None = None
    missed: list[Any] = field(default_factory=list)


class WaypointFollower:
    """One robot's.

    ``take`` gives the navigator a goal, ``find`` returns what has become of it, ``cancel`` cancels it, or
    all with the UUID 0.
    """

    def __init__(
        self,
        session: RosSession,
        *,
        take: Callable[[Goal, Action], int | None],
        find: Callable[[Action, UUID], GoalEntry | None],
        cancel: Callable[[UUID], None],
    ) -> None:
        self._take = take
        self._find = find
        self._cancel = cancel
        self._tour: _Tour | None = None
        self._missed_kind = interface("nav2_msgs/msg/MissedWaypoint")
        self._timer = session.every(PERIOD, self._advance_tour)
        self._timer.cancel()
        kind = interface("nav2_msgs/action/FollowWaypoints")
        self._action = SimpleAction(session, NAME, kind) if kind is not None else None
        if self._action is not None:
            self._action.open(self._begin_tour, self._end_by_request)

    def _begin_tour(self, goal_id: UUID, goal: Any) -> bool:  # noqa: ANN401 - rclpy carries no types
        self._end_tour(GoalStatus.ABORTED)
        poses, index = list(goal.poses), int(goal.goal_index)
        if self._action is None or index >= len(poses):
            return False
        self._tour = _Tour(goal_id, poses, index, int(goal.number_of_loops))
        self._action.show(goal_id, GoalStatus.EXECUTING)
        self._drive_to_next(self._tour)
        self._timer.reset()
        return True

    def _end_by_request(self, goal_id: UUID) -> bool:
        tour = self._tour
        if tour is None or goal_id not in (tour.goal_id, UUID(int=0)):
            return False
        self._cancel(UUID(int=0))  # as Nav2's, which cancels all goals of the navigator
        self._end_tour(GoalStatus.CANCELED)
        return True

    def _drive_to_next(self, tour: _Tour) -> None:
        stamped = tour.poses[tour.index]
        # As in Nav2, other clients see a foreign goal in the navigator's status array.
        goal = Goal(uuid4(), messages.goal_pose_of(stamped.pose), stamped.header.frame_id)
        tour.drive = goal.goal_id if self._take(goal, Action.TO_POSE) is not None else None

    def _advance_tour(self) -> None:
        tour = self._tour
        if tour is None or self._action is None:
            self._timer.cancel()
            return
        self._action.publish_feedback(tour.goal_id, current_waypoint=tour.index)
        entry = self._find(Action.TO_POSE, tour.drive) if tour.drive is not None else None
        if entry is not None and not entry.ended:
            return
        if (entry is None or entry.status is not GoalStatus.SUCCEEDED) and self._missed_kind is not None:
            code = entry.error_code if entry is not None and entry.error_code else UNKNOWN
            stamped = tour.poses[tour.index]
            tour.missed.append(self._missed_kind(index=tour.index, goal=stamped, error_code=code))
        tour.index += 1
        if tour.index == len(tour.poses) and tour.loops_left:
            tour.index, tour.loops_left = 0, tour.loops_left - 1
        if tour.index < len(tour.poses):
            self._drive_to_next(tour)
        else:
            self._end_tour(GoalStatus.SUCCEEDED)

    def _end_tour(self, status: GoalStatus) -> None:
        tour, self._tour = self._tour, None
        if tour is None or self._action is None:
            return
        result = self._action.result()
        result.missed_waypoints = tour.missed
        self._action.end(tour.goal_id, status, result)
        log.info("waypoints ended", status=status.name, missed=len(tour.missed))
