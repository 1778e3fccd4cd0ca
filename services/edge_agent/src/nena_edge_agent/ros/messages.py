"""Builds every message that goes out.

A ROS message takes any object into a number's field and sends its memory as garbage, so each number passes
through :func:`_number` here and nowhere else.
"""

from __future__ import annotations

import math
from typing import Any, SupportsFloat

from action_msgs.srv import CancelGoal
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped

from nena_edge_agent.driver.map_port import MapPose
from nena_edge_agent.ros.pose import quaternion_of

X_VARIANCE, Y_VARIANCE, YAW_VARIANCE = 0, 7, 35
"""Where these stand in the covariance of a pose, a matrix of 6 by 6 in rows."""


class NotFiniteError(ValueError):
    """A number that no robot can drive to."""

    def __init__(self, number: float) -> None:
        super().__init__(f"{number} is no finite number")
        self.number = number


def goal_message(pose: MapPose, frame: str) -> Any:  # noqa: ANN401 - rclpy carries no types
    """Make the geometry_msgs/PoseStamped of a goal; stamp zero means: by the newest transforms.

    Raises:
        NotFiniteError: a number is NaN or infinite.

    """
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose = _pose(pose)
    return message


def initial_pose_message(pose: MapPose, frame: str, *, xy_variance: float, theta_variance: float) -> Any:  # noqa: ANN401
    """Make the geometry_msgs/PoseWithCovarianceStamped that tells the localisation where the robot is.

    Raises:
        NotFiniteError: a number is NaN or infinite.

    """
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    message.pose.pose = _pose(pose)
    message.pose.covariance[X_VARIANCE] = _number(xy_variance)
    message.pose.covariance[Y_VARIANCE] = _number(xy_variance)
    message.pose.covariance[YAW_VARIANCE] = _number(theta_variance)
    return message


def cancel_request(goal_id: str) -> Any:  # noqa: ANN401
    """Make the action_msgs/srv/CancelGoal request for one goal: its id with stamp zero means it alone."""
    request = CancelGoal.Request()
    request.goal_info.goal_id.uuid = list(bytes.fromhex(goal_id))
    return request


def cancel_all_request() -> Any:  # noqa: ANN401
    """Return the action_msgs/srv/CancelGoal request for all goals of a server: no id and no stamp."""
    return CancelGoal.Request()


def _pose(pose: MapPose) -> PoseMessage:
    message = PoseMessage()
    message.position.x = _number(pose.x)
    message.position.y = _number(pose.y)
    message.orientation.z, message.orientation.w = map(_number, quaternion_of(_number(pose.theta)))
    return message


def _number(value: SupportsFloat) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise NotFiniteError(number)
    return number
