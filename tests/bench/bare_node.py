"""The yardstick of (d), (i) and (k): bare rclpy with the six subscriptions of the agent.

Run in a separate process: ``bench.bare_node DOMAIN_ID NAMESPACE``; reports when it is ready, and exits when
its input closes.
"""

from __future__ import annotations

import sys

from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node
from sensor_msgs.msg import BatteryState

from bench.bare_ros import run_node
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

    def listen(node: Node) -> None:
        for kind, topic, qos in TOPICS:
            node.create_subscription(kind, topic, lambda _message: None, qos)

    run_node("bench_bare", domain_id=int(sys.argv[1]), namespace=sys.argv[2], prepare=listen)


if __name__ == "__main__":
    main()
