"""The yardstick of (d), (i) and (k): bare rclpy with the six subscriptions of the agent, and nothing more.

Run as a process of its own: ``bench.bare_node DOMAIN_ID NAMESPACE``; says when it is ready, and ends when its
input closes.
"""

from __future__ import annotations

import os
import sys
import threading

os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")

import rclpy
from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import BatteryState

from bench.nav2_stand_in import BEST_EFFORT, LATCHED, STATUS_TOPIC

TOPICS = (
    (GoalStatusArray, STATUS_TOPIC, LATCHED),
    (PoseWithCovarianceStamped, "amcl_pose", LATCHED),
    (PoseWithCovarianceStamped, "amcl_pose", BEST_EFFORT),
    (Odometry, "odom", BEST_EFFORT),
    (Path, "plan", BEST_EFFORT),
    (BatteryState, "battery_state", BEST_EFFORT),
)


def main() -> None:
    """Listen until the input closes."""
    context = Context()
    rclpy.init(context=context, domain_id=int(sys.argv[1]))
    node = rclpy.create_node("bench_bare", namespace=sys.argv[2], context=context)
    for kind, topic, qos in TOPICS:
        node.create_subscription(kind, topic, lambda _message: None, qos)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sys.stdin.read()
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()
    thread.join(timeout=5.0)


if __name__ == "__main__":
    main()
