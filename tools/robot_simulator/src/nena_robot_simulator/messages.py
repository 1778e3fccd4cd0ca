"""Conversion between ROS messages and the simulator's data.

Every number passes through ``float()`` or ``int()``: a message accepts any object and sends its memory.
"""

from __future__ import annotations

import array
import math
from collections.abc import Iterable
from functools import lru_cache
from typing import Any
from uuid import UUID

from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from sensor_msgs.msg import BatteryState

from nena_robot_simulator.goals import Action, GoalEntry
from nena_robot_simulator.motion import GridMap, Pose
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.robot import Feedback
from nena_robot_simulator.sensors import CHARGING_CURRENT, Battery, Estimate, Scale
from nena_shared.ros import yaw_of

SECOND = 1_000_000_000
X_VARIANCE, Y_VARIANCE, YAW_VARIANCE = 0, 7, 35
"""Indices in the covariance of a pose, a 6 by 6 matrix in rows."""


def stamp_of(nanoseconds: int) -> Time:
    """Convert UTC nanoseconds to builtin_interfaces/Time."""
    seconds, rest = divmod(int(nanoseconds), SECOND)
    return Time(sec=seconds, nanosec=rest)


def nanoseconds_of(stamp: Time) -> int:
    """Convert builtin_interfaces/Time to nanoseconds."""
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def goal_id_of(message: Any) -> UUID:  # noqa: ANN401 - GoalInfo, or a request of an action
    """Read the goal ID of an action_msgs/GoalInfo or of an action's request."""
    return UUID(bytes=bytes(message.goal_id.uuid))


def goal_info(goal: GoalEntry) -> GoalInfo:
    """Return the action_msgs/GoalInfo of a goal."""
    info = GoalInfo(stamp=stamp_of(goal.accepted_ns))
    info.goal_id.uuid = list(goal.goal_id.bytes)
    return info


STATUSES_KEPT = 10_000
"""Maximum number of goals whose messages are kept; an array holds the goals of the last 15 minutes."""


def status_array(goals: Iterable[GoalEntry]) -> GoalStatusArray:
    """Return the action_msgs/GoalStatusArray of the goals."""
    return GoalStatusArray(status_list=[_goal_status(goal) for goal in goals])


@lru_cache(STATUSES_KEPT)
def _goal_status(goal: GoalEntry) -> GoalStatus:
    return GoalStatus(goal_info=goal_info(goal), status=int(goal.status))


def pose_message(pose: Pose) -> PoseMessage:
    """Return a geometry_msgs/Pose at z = 0."""
    message = PoseMessage()
    message.position.x = float(pose.x)
    message.position.y = float(pose.y)
    message.orientation.z = math.sin(float(pose.yaw) / 2.0)
    message.orientation.w = math.cos(float(pose.yaw) / 2.0)
    return message


def pose_of(message: PoseMessage) -> Pose | None:
    """Read a geometry_msgs/Pose; None if the quaternion or a number is invalid."""
    turn = message.orientation
    yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
    x, y = float(message.position.x), float(message.position.y)
    return Pose(x, y, yaw) if yaw is not None and math.isfinite(x) and math.isfinite(y) else None


def goal_pose_of(message: PoseMessage) -> Pose:
    """Read a goal's pose like Nav2, without checks: an invalid orientation becomes yaw 0."""
    turn = message.orientation
    yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
    return Pose(float(message.position.x), float(message.position.y), yaw or 0.0)


def estimate_message(estimate: Estimate, frame_id: str, nanoseconds: int) -> PoseWithCovarianceStamped:
    """Return the geometry_msgs/PoseWithCovarianceStamped of AMCL."""
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame_id
    message.header.stamp = stamp_of(nanoseconds)
    message.pose.pose = pose_message(estimate.pose)
    message.pose.covariance[X_VARIANCE] = float(estimate.xy_variance)
    message.pose.covariance[Y_VARIANCE] = float(estimate.xy_variance)
    message.pose.covariance[YAW_VARIANCE] = float(estimate.yaw_variance)
    return message


def transform_message(pose: Pose, frame_id: str, child_frame_id: str, nanoseconds: int) -> TransformStamped:
    """Return the geometry_msgs/TransformStamped of a frame that lies at ``pose``."""
    message = TransformStamped(child_frame_id=child_frame_id)
    message.header.frame_id = frame_id
    message.header.stamp = stamp_of(nanoseconds)
    message.transform.translation.x = float(pose.x)
    message.transform.translation.y = float(pose.y)
    message.transform.rotation = pose_message(pose).orientation
    return message


def odometry_message(
    pose: Pose, velocity: tuple[float, float], *, frame_id: str, child_frame_id: str, nanoseconds: int
) -> Odometry:
    """Return a nav_msgs/Odometry; ``velocity`` is forward m/s and counter-clockwise rad/s."""
    message = Odometry(child_frame_id=child_frame_id)
    message.header.frame_id = frame_id
    message.header.stamp = stamp_of(nanoseconds)
    message.pose.pose = pose_message(pose)
    message.twist.twist.linear.x = float(velocity[0])
    message.twist.twist.angular.z = float(velocity[1])
    return message


def path_message(poses: Iterable[Pose], frame_id: str, nanoseconds: int) -> Path:
    """Return the nav_msgs/Path of a plan."""
    path = Path()
    path.header.frame_id = frame_id
    path.header.stamp = stamp_of(nanoseconds)
    path.poses = [PoseStamped(header=path.header, pose=pose_message(pose)) for pose in poses]
    return path


def battery_message(
    battery: Battery, scale: Scale, nanoseconds: int, *, charging: bool = False
) -> BatteryState:
    """Return a sensor_msgs/BatteryState."""
    message = BatteryState(
        present=True,
        percentage=float(battery.percentage(scale)),
        voltage=float(battery.voltage),
        current=CHARGING_CURRENT if charging else float(battery.current),
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_CHARGING
        if charging
        else BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
    )
    message.header.stamp = stamp_of(nanoseconds)
    return message


def map_message(grid: GridMap, frame_id: str, nanoseconds: int) -> OccupancyGrid:
    """Return the nav_msgs/OccupancyGrid of the hall."""
    message = OccupancyGrid()
    message.header.frame_id = frame_id
    message.header.stamp = message.info.map_load_time = stamp_of(nanoseconds)
    message.info.width, message.info.height = int(grid.width), int(grid.height)
    message.info.resolution = float(grid.resolution)
    message.info.origin = pose_message(Pose(grid.origin_x, grid.origin_y, 0.0))
    message.data = array.array("b", grid.cells)
    return message


LETHAL = 254
"""Cost of an occupied cell."""


def costmap_message(kind: Any, grid: GridMap, frame_id: str, nanoseconds: int) -> Any:  # noqa: ANN401
    """Return the nav2_msgs/Costmap of the hall, of the type ``kind``."""
    message = kind()
    message.header.frame_id = frame_id
    message.header.stamp = stamp_of(nanoseconds)
    message.metadata.map_load_time = message.metadata.update_time = message.header.stamp
    message.metadata.layer = "master"
    message.metadata.resolution = float(grid.resolution)
    message.metadata.size_x, message.metadata.size_y = int(grid.width), int(grid.height)
    message.metadata.origin = pose_message(Pose(grid.origin_x, grid.origin_y, 0.0))
    message.data = array.array("B", bytes(LETHAL if cell else 0 for cell in grid.cells))
    return message


STANDING = 0.01
"""Speed below which Nav2 does not estimate the remaining time, m/s."""
NEARLY_THERE = 0.1
"""Distance below which Nav2 does not estimate the remaining time, m."""
NOWHERE = Pose(math.nan, math.nan, 0.0)


def goal_of(request: Any, action: Action) -> Goal:  # noqa: ANN401 - rclpy carries no types
    """Read a request of an action's ``send_goal`` service."""
    if action is Action.FOLLOW_PATH:
        path = request.goal.path
        way = [goal_pose_of(pose.pose) for pose in path.poses] or [NOWHERE]
        return Goal(goal_id_of(request), way[-1], path.header.frame_id, tuple(way[:-1]))
    stamped = request.goal.poses if action is Action.THROUGH_POSES else [request.goal.pose]
    places = [goal_pose_of(each.pose) for each in stamped] or [NOWHERE]
    frame_id = stamped[-1].header.frame_id if stamped else ""
    tree = str(request.goal.behavior_tree)
    return Goal(goal_id_of(request), places[-1], frame_id, tuple(places[:-1]), tree)


def fill_result(response: Any, entry: GoalEntry | None) -> None:  # noqa: ANN401
    """Fill the response of ``get_result``; an unknown goal has status 0."""
    # Measured: Nav2 answers at once with status 0 and code 0 once it has forgotten the goal.
    if entry is not None:
        response.status = int(entry.status)
        response.result.error_code = int(entry.error_code)


def feedback_message(types: Any, feedback: Feedback, frame_id: str, nanoseconds: int) -> Any:  # noqa: ANN401
    """Return the feedback message of an action."""
    message = types.Impl.FeedbackMessage()
    message.goal_id.uuid = list(feedback.goal_id.bytes)
    status = message.feedback
    if hasattr(status, "distance_to_goal"):
        status.distance_to_goal, status.speed = float(feedback.left), float(feedback.speed)
        return message
    status.current_pose.header.frame_id = frame_id
    status.current_pose.header.stamp = stamp_of(nanoseconds)
    status.current_pose.pose = pose_message(feedback.pose)
    _fill_duration(status.navigation_time, feedback.seconds)
    if feedback.speed > STANDING and feedback.left > NEARLY_THERE:
        _fill_duration(status.estimated_time_remaining, feedback.left / feedback.speed)
    status.number_of_recoveries = int(feedback.recoveries)
    status.distance_remaining = float(feedback.left)
    if hasattr(status, "number_of_poses_remaining"):
        status.number_of_poses_remaining = int(feedback.places_left)
    return message


def _fill_duration(message: Any, seconds: float) -> None:  # noqa: ANN401
    message.sec, message.nanosec = divmod(int(seconds * SECOND), SECOND)
