"""The far end of (b): a ROS node that notes when goals arrive."""

from __future__ import annotations

import queue
import threading
import time
from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor


class GoalListener:
    """Notes the moments at which ``goal_pose`` arrives in some namespaces of one domain."""

    def __init__(self, domain_id: int, namespaces: tuple[str, ...]) -> None:
        self.arrivals: dict[str, queue.SimpleQueue[float]] = {
            name: queue.SimpleQueue() for name in namespaces
        }
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain_id)
        self._node = rclpy.create_node("bench_goal_listener", context=self._context)
        for name in namespaces:
            self._node.create_subscription(PoseStamped, f"/{name}/goal_pose", self._noting(name), 10)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def publishers(self, namespace: str) -> int:
        """Count who may send goals there."""
        return int(self._node.count_publishers(f"/{namespace}/goal_pose"))

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()
        self._thread.join(timeout=5.0)

    def _noting(self, name: str) -> Any:
        return lambda _pose: self.arrivals[name].put(time.perf_counter())
