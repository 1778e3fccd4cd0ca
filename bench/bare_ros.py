"""Yardsticks of the edge agent: bare rclpy and paho with nothing in between, each as a process.

``bench.bare_ros listen DOMAIN_ID NAMESPACE`` has the agent's six subscriptions.
``bench.bare_ros pass DOMAIN_ID NAMESPACE PORT TOPIC ANSWER SIZE`` publishes a goal_pose for each message of a
topic, and a message of ``SIZE`` bytes for each status array.
"""

from __future__ import annotations

import json
import os
import sys
import threading

os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")  # as the agent

import rclpy
from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import BatteryState

from bench.nav2_stand_in import BEST_EFFORT, LATCHED, STATUS_TOPIC
from bench.programs import wait_for_end_of_input
from bench.wire import Wire
from support.waiting import wait_until

TOPICS = (
    (GoalStatusArray, STATUS_TOPIC, LATCHED),
    (PoseWithCovarianceStamped, "amcl_pose", LATCHED),
    (PoseWithCovarianceStamped, "amcl_pose", BEST_EFFORT),
    (Odometry, "odom", BEST_EFFORT),
    (Path, "plan", BEST_EFFORT),
    (BatteryState, "battery_state", BEST_EFFORT),
)


def _listen(node: Node) -> None:
    for kind, topic, qos in TOPICS:
        node.create_subscription(kind, topic, lambda _message: None, qos)


def _pass_messages_on(node: Node, port: str, topic: str, answer_topic: str, size: str) -> None:
    publisher, answer = node.create_publisher(PoseStamped, "goal_pose", 1), b"x" * int(size)

    def pass_on(_topic: str, payload: bytes, _moment: float) -> None:
        place, pose = json.loads(payload), PoseStamped()
        pose.header.frame_id = "map"
        pose.pose.position.x, pose.pose.position.y = float(place["x"]), float(place["y"])
        publisher.publish(pose)

    wire = Wire(int(port), "bench-pass", (topic,), pass_on)
    node.create_subscription(
        GoalStatusArray, STATUS_TOPIC, lambda _statuses: wire.publish(answer_topic, answer), LATCHED
    )
    # each side discovers the other for itself: what is published before is lost
    wait_until(publisher.get_subscription_count, what="the far end is discovered")


def main() -> None:
    """Run until the input ends."""
    mode, domain_id, namespace, *rest = sys.argv[1:]
    context = Context()
    rclpy.init(context=context, domain_id=int(domain_id))
    node = rclpy.create_node(f"bench_{mode}", namespace=namespace, context=context)
    if mode == "listen":
        _listen(node)
    else:
        _pass_messages_on(node, *rest)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    wait_for_end_of_input()
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()
    thread.join(timeout=5.0)


if __name__ == "__main__":
    main()
