"""Between the messages of Nav2's actions and the simulator's own data.

Every number passes through ``float()`` or ``int()``: a message takes any object and sends its memory.
"""

from __future__ import annotations

import math
from typing import Any
from uuid import UUID

from nena_robot_simulator.action import Action
from nena_robot_simulator.messages import SECOND, goal_pose_of, pose_message, stamp_of
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.pose import Pose
from nena_robot_simulator.robot import Feedback
from nena_robot_simulator.status_array import GoalEntry

STANDING = 0.01
"""m/s below which Nav2 gives no estimate of the time that is left."""
NEARLY_THERE = 0.1
"""Metres below which it gives none either."""
NOWHERE = Pose(math.nan, math.nan, 0.0)


def goal_of(request: Any, action: Action) -> Goal:  # noqa: ANN401 - rclpy carries no types
    """Read a request of an action's ``send_goal`` service."""
    stamped = request.goal.poses if action is Action.THROUGH_POSES else [request.goal.pose]
    places = [goal_pose_of(each.pose) for each in stamped] or [NOWHERE]
    frame_id = stamped[-1].header.frame_id if stamped else ""
    return Goal(goal_id_of(request), places[-1], frame_id, tuple(places[:-1]))


def goal_id_of(message: Any) -> UUID:  # noqa: ANN401
    """Read the goal id of a request of an action."""
    return UUID(bytes=bytes(message.goal_id.uuid))


def fill_result(response: Any, entry: GoalEntry | None) -> None:  # noqa: ANN401
    """Fill the answer of ``get_result``: an unknown goal has the status 0."""
    if entry is not None:
        response.status = int(entry.status)
        response.result.error_code = int(entry.error_code)


def feedback_message(types: Any, feedback: Feedback, frame_id: str, nanoseconds: int) -> Any:  # noqa: ANN401
    """Make the message of an action's feedback."""
    message = types.Impl.FeedbackMessage()
    message.goal_id.uuid = list(feedback.goal_id.bytes)
    told = message.feedback
    told.current_pose.header.frame_id = frame_id
    told.current_pose.header.stamp = stamp_of(nanoseconds)
    told.current_pose.pose = pose_message(feedback.pose)
    _fill_duration(told.navigation_time, feedback.seconds)
    if feedback.speed > STANDING and feedback.left > NEARLY_THERE:
        _fill_duration(told.estimated_time_remaining, feedback.left / feedback.speed)
    told.number_of_recoveries = int(feedback.recoveries)
    told.distance_remaining = float(feedback.left)
    if hasattr(told, "number_of_poses_remaining"):
        told.number_of_poses_remaining = int(feedback.places_left)
    return message


def _fill_duration(message: Any, seconds: float) -> None:  # noqa: ANN401
    message.sec, message.nanosec = divmod(int(seconds * SECOND), SECOND)
