"""Reads messages that come in, as plain data, in the ROS thread."""

from __future__ import annotations

import math
from typing import Any

from nena_edge_agent.ros.battery import BatteryReading
from nena_edge_agent.ros.goal_status import GoalEntry, GoalStatus
from nena_edge_agent.ros.messages import X_VARIANCE, Y_VARIANCE, YAW_VARIANCE
from nena_edge_agent.ros.pose import PoseReading, yaw_of

NANOSECONDS = 1_000_000_000
PLAN_POINTS = 100
"""Points of a plan that are told on at most, beside its end."""


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
        UnusablePoseError: the place is not finite or the orientation no unit quaternion.

    """
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
    if yaw is None or not (math.isfinite(place.x) and math.isfinite(place.y)):
        text = f"x {place.x}, y {place.y}, quaternion {turn.x} {turn.y} {turn.z} {turn.w}"
        raise UnusablePoseError(text)
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
    """Read a nav_msgs/Path: its frame, and not more of its points than are of use, the last one always.

    Raises:
        UnusablePoseError: a point is not finite.

    """
    poses = message.poses
    step = max(1, -(-len(poses) // PLAN_POINTS))
    chosen = [*poses[:-1:step], *poses[-1:]]
    points = tuple((each.pose.position.x, each.pose.position.y) for each in chosen)
    if not all(math.isfinite(x) and math.isfinite(y) for x, y in points):
        text = "a plan with a point that is no place"
        raise UnusablePoseError(text)
    return message.header.frame_id, points


def velocity(message: Any) -> tuple[float, float]:  # noqa: ANN401
    """Read m/s forward and rad/s of a nav_msgs/Odometry."""
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
