"""Replaces Nav2 and AMCL for the agent: notes when goals arrive, and ends them on request.

In the process of the benchmark, for some namespaces of one domain. The robot is wherever it was sent.
"""

from __future__ import annotations

import queue
import threading
import time
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus, GoalStatusArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

STATUS_TOPIC = "navigate_to_pose/_action/status"
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
RATE = 20.0
"""Poses, and odometry messages, per second."""
VARIANCE = 0.01


class Nav2StandIn:
    """One node that plays the navigation of several robots; the first namespace has a localisation."""

    def __init__(self, domain_id: int, namespaces: tuple[str, ...], *, odometry: bool = True) -> None:
        self.goals: dict[str, queue.SimpleQueue[float]] = {each: queue.SimpleQueue() for each in namespaces}
        """When goals came, by namespace."""
        self._place = (0.0, 0.0)
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain_id)
        self._node = rclpy.create_node(f"bench_nav2_{namespaces[0]}", context=self._context)
        self._statuses: dict[str, Any] = {}
        for each in namespaces:
            self._node.create_subscription(PoseStamped, f"/{each}/goal_pose", self._noting(each), 10)
            topic = f"/{each}/{STATUS_TOPIC}"
            self._statuses[each] = self._node.create_publisher(GoalStatusArray, topic, LATCHED)
        robot = namespaces[0]
        self._poses = self._node.create_publisher(PoseWithCovarianceStamped, f"/{robot}/amcl_pose", LATCHED)
        self._node.create_timer(1 / RATE, self._publish_pose)
        if odometry:
            self._odometry = self._node.create_publisher(Odometry, f"/{robot}/odom", BEST_EFFORT)
            self._node.create_timer(1 / RATE, lambda: self._odometry.publish(Odometry()))
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def place(self, x: float, y: float) -> None:
        """Put the robot at a position, m, and publish its pose there."""
        self._place = (x, y)

    def joined(self, namespace: str) -> bool:
        """Return whether an agent sends goals there and follows them."""
        goals = self._node.count_publishers(f"/{namespace}/goal_pose")
        return bool(goals and self._statuses[namespace].get_subscription_count())

    def show(self, namespace: str, goal_id: list[int], status: int) -> None:
        """Publish a status array of one goal."""
        entry = GoalStatus(status=status)
        entry.goal_info.goal_id.uuid = goal_id
        self._statuses[namespace].publish(GoalStatusArray(status_list=[entry]))

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()
        self._thread.join(timeout=5.0)

    def _noting(self, name: str) -> Any:
        return lambda _goal: self.goals[name].put(time.perf_counter())

    def _publish_pose(self) -> None:
        message = PoseWithCovarianceStamped()
        message.header.frame_id = "map"
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.pose.pose.position.x, message.pose.pose.position.y = self._place
        message.pose.pose.orientation.w = 1.0
        for index in (0, 7, 35):
            message.pose.covariance[index] = VARIANCE
        self._poses.publish(message)
