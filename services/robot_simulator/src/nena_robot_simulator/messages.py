"""Between ROS messages and the simulator's own data; the one place that fills and reads messages.

Every number passes through ``float()`` or ``int()``: a message takes any object and sends its memory.
"""

from __future__ import annotations

import array
import math
from collections.abc import Iterable
from uuid import UUID

from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from sensor_msgs.msg import BatteryState

from nena_robot_simulator.battery import Battery, Scale
from nena_robot_simulator.grid_map import GridMap
from nena_robot_simulator.localisation import Estimate
from nena_robot_simulator.pose import Pose, yaw_of
from nena_robot_simulator.status_array import GoalEntry

SECOND = 1_000_000_000
X_VARIANCE, Y_VARIANCE, YAW_VARIANCE = 0, 7, 35
"""Where these stand in the covariance of a pose, a matrix of 6 by 6 in rows."""


def stamp_of(nanoseconds: int) -> Time:
    """Give UTC nanoseconds as builtin_interfaces/Time."""
    seconds, rest = divmod(int(nanoseconds), SECOND)
    return Time(sec=seconds, nanosec=rest)


def nanoseconds_of(stamp: Time) -> int:
    """Read builtin_interfaces/Time as nanoseconds."""
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def goal_id_of(info: GoalInfo) -> UUID:
    """Read the goal id of an action_msgs/GoalInfo."""
    return UUID(bytes=bytes(info.goal_id.uuid))


def goal_info(goal: GoalEntry) -> GoalInfo:
    """Make the action_msgs/GoalInfo of a goal."""
    info = GoalInfo(stamp=stamp_of(goal.accepted_ns))
    info.goal_id.uuid = list(goal.goal_id.bytes)
    return info


def status_array(goals: Iterable[GoalEntry]) -> GoalStatusArray:
    """Make the action_msgs/GoalStatusArray of the goals."""
    return GoalStatusArray(
        status_list=[GoalStatus(goal_info=goal_info(goal), status=int(goal.status)) for goal in goals]
    )


def pose_message(pose: Pose) -> PoseMessage:
    """Make a geometry_msgs/Pose on the floor."""
    message = PoseMessage()
    message.position.x = float(pose.x)
    message.position.y = float(pose.y)
    message.orientation.z = math.sin(float(pose.yaw) / 2.0)
    message.orientation.w = math.cos(float(pose.yaw) / 2.0)
    return message


def pose_of(message: PoseMessage) -> Pose | None:
    """Read a geometry_msgs/Pose; None where the quaternion or a number is unusable."""
    turn = message.orientation
    yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
    x, y = float(message.position.x), float(message.position.y)
    return Pose(x, y, yaw) if yaw is not None and math.isfinite(x) and math.isfinite(y) else None


def goal_pose_of(message: PoseMessage) -> Pose:
    """Read a goal's pose as Nav2 does, which checks nothing: a broken orientation becomes yaw 0."""
    turn = message.orientation
    yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
    return Pose(float(message.position.x), float(message.position.y), yaw or 0.0)


def estimate_message(estimate: Estimate, frame_id: str, nanoseconds: int) -> PoseWithCovarianceStamped:
    """Make the geometry_msgs/PoseWithCovarianceStamped of AMCL."""
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame_id
    message.header.stamp = stamp_of(nanoseconds)
    message.pose.pose = pose_message(estimate.pose)
    message.pose.covariance[X_VARIANCE] = float(estimate.xy_variance)
    message.pose.covariance[Y_VARIANCE] = float(estimate.xy_variance)
    message.pose.covariance[YAW_VARIANCE] = float(estimate.yaw_variance)
    return message


def odometry_message(
    pose: Pose, velocity: tuple[float, float], *, frame_id: str, child_frame_id: str, nanoseconds: int
) -> Odometry:
    """Make a nav_msgs/Odometry; ``velocity`` is forward m/s and counter-clockwise rad/s."""
    message = Odometry(child_frame_id=child_frame_id)
    message.header.frame_id = frame_id
    message.header.stamp = stamp_of(nanoseconds)
    message.pose.pose = pose_message(pose)
    message.twist.twist.linear.x = float(velocity[0])
    message.twist.twist.angular.z = float(velocity[1])
    return message


def path_message(poses: Iterable[Pose], frame_id: str, nanoseconds: int) -> Path:
    """Make the nav_msgs/Path of a plan."""
    path = Path()
    path.header.frame_id = frame_id
    path.header.stamp = stamp_of(nanoseconds)
    path.poses = [PoseStamped(header=path.header, pose=pose_message(pose)) for pose in poses]
    return path


def battery_message(battery: Battery, scale: Scale, nanoseconds: int) -> BatteryState:
    """Make a sensor_msgs/BatteryState."""
    message = BatteryState(
        present=True,
        percentage=float(battery.percentage(scale)),
        voltage=float(battery.voltage),
        current=float(battery.current),
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
    )
    message.header.stamp = stamp_of(nanoseconds)
    return message


def map_message(grid: GridMap, frame_id: str, nanoseconds: int) -> OccupancyGrid:
    """Make the nav_msgs/OccupancyGrid of the place."""
    message = OccupancyGrid()
    message.header.frame_id = frame_id
    message.header.stamp = message.info.map_load_time = stamp_of(nanoseconds)
    message.info.width, message.info.height = int(grid.width), int(grid.height)
    message.info.resolution = float(grid.resolution)
    message.info.origin = pose_message(Pose(grid.origin_x, grid.origin_y, 0.0))
    message.data = array.array("b", grid.cells)
    return message
