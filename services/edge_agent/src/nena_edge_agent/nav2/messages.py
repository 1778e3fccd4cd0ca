"""Build outgoing ROS messages, and read incoming ones.

rclpy accepts any object in a numeric field and sends its memory as garbage, so each outgoing number passes
through :func:`_finite_number`.
"""

from __future__ import annotations

import math
from typing import Any, SupportsFloat

from action_msgs.srv import CancelGoal
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.nav2.goals import GoalEntry
from nena_edge_agent.nav2.poses import PoseReading, quaternion_of, thinned
from nena_edge_agent.nav2.robot_base import BatteryReading
from nena_shared.ros import GoalStatus, yaw_of

X_VARIANCE, Y_VARIANCE, YAW_VARIANCE = 0, 7, 35
"""Indices in the covariance of a pose, a 6 by 6 matrix in row-major order."""


class NotFiniteError(ValueError):
    """A coordinate is NaN or infinite."""

    def __init__(self, number: float) -> None:
        super().__init__(f"{number} is not a finite number")
        self.number = number


def goal_message(pose: Pose, frame: str) -> Any:  # noqa: ANN401 - rclpy carries no types
    """Build the geometry_msgs/PoseStamped of a goal; stamp zero selects the newest transforms.

    Raises:
        NotFiniteError: a number is NaN or infinite.
    """
    # With Nav2's own global frame the stamp is not used for a look-up.
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose = _pose_message(pose)
    return message


def initial_pose_message(pose: Pose, frame: str, *, xy_variance: float, theta_variance: float) -> Any:  # noqa: ANN401
    """Build the geometry_msgs/PoseWithCovarianceStamped that sets the robot's pose in the localisation.

    Raises:
        NotFiniteError: a number is NaN or infinite.
    """
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    message.pose.pose = _pose_message(pose)
    message.pose.covariance[X_VARIANCE] = _finite_number(xy_variance)
    message.pose.covariance[Y_VARIANCE] = _finite_number(xy_variance)
    message.pose.covariance[YAW_VARIANCE] = _finite_number(theta_variance)
    return message


def cancel_request(goal_id: str) -> Any:  # noqa: ANN401
    """Build the action_msgs/srv/CancelGoal request for one goal: its ID with stamp zero selects it only."""
    request = CancelGoal.Request()
    request.goal_info.goal_id.uuid = list(bytes.fromhex(goal_id))
    return request


def _pose_message(pose: Pose) -> PoseMessage:
    message = PoseMessage()
    message.position.x = _finite_number(pose.x)
    message.position.y = _finite_number(pose.y)
    message.orientation.z, message.orientation.w = map(
        _finite_number, quaternion_of(_finite_number(pose.theta))
    )
    return message


def _finite_number(value: SupportsFloat) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise NotFiniteError(number)
    return number


NANOSECONDS = 1_000_000_000


class UnusablePoseError(ValueError):
    """A pose without finite numbers or a unit quaternion."""


def status_entries(message: Any) -> list[GoalEntry]:  # noqa: ANN401 - rclpy carries no types
    """Read an action_msgs/GoalStatusArray, in the order of acceptance."""
    return [
        GoalEntry(bytes(entry.goal_info.goal_id.uuid).hex(), GoalStatus.of(entry.status))
        for entry in message.status_list
    ]


def pose_reading(message: Any) -> PoseReading:  # noqa: ANN401
    """Read a geometry_msgs/PoseWithCovarianceStamped.

    Raises:
        UnusablePoseError: the position is not finite or the orientation no unit quaternion.
    """
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
    # rclpy accepts NaN and inf silently.
    if yaw is None or not (math.isfinite(place.x) and math.isfinite(place.y)):
        raise UnusablePoseError(f"x {place.x}, y {place.y}, quaternion {turn.x} {turn.y} {turn.z} {turn.w}")
    covariance = message.pose.covariance
    return PoseReading(
        x=place.x,
        y=place.y,
        yaw=yaw,
        frame=message.header.frame_id,
        stamp=message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec,
        x_variance=float(covariance[X_VARIANCE]),
        y_variance=float(covariance[Y_VARIANCE]),
        yaw_variance=float(covariance[YAW_VARIANCE]),
    )


def plan_points(message: Any) -> tuple[str, tuple[tuple[float, float], ...]]:  # noqa: ANN401
    """Read a nav_msgs/Path: its frame, and a limited number of its points, always including the last one.

    Raises:
        UnusablePoseError: a point is not finite.
    """
    points = thinned([(pose.pose.position.x, pose.pose.position.y) for pose in message.poses])
    if not all(math.isfinite(x) and math.isfinite(y) for x, y in points):
        raise UnusablePoseError("a plan with an invalid point")
    return message.header.frame_id, points


def velocity(message: Any) -> tuple[float, float]:  # noqa: ANN401
    """Read the velocity of a nav_msgs/Odometry: m/s forward, and rad/s."""
    twist = message.twist.twist
    return twist.linear.x, twist.angular.z


def battery_reading(message: Any) -> BatteryReading:  # noqa: ANN401
    """Read a sensor_msgs/BatteryState."""
    return BatteryReading(
        percentage=message.percentage,
        voltage=message.voltage,
        current=message.current,
        status=message.power_supply_status,
    )
