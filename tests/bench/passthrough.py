"""The yardstick of (b) and (h): MQTT in, goal_pose out; a status in, a message of a state's size out.

Bare paho and rclpy. Run in a separate process: ``bench.passthrough PORT DOMAIN_ID NAMESPACE TOPIC
ANSWER_TOPIC SIZE``; exits when its input closes.
"""

from __future__ import annotations

import json
import sys

from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from bench.bare_ros import run_node
from bench.nav2_stand_in import LATCHED, STATUS_TOPIC
from bench.wire import Wire
from support.waiting import wait_until


def main() -> None:
    """Pass messages on until the input closes."""
    port, domain_id, namespace, topic, answer_topic, size = sys.argv[1:]
    answer = b"x" * int(size)

    def connect(node: Node) -> None:
        publisher = node.create_publisher(PoseStamped, "goal_pose", 1)

        def pass_on(_topic: str, payload: bytes, _moment: float) -> None:
            place = json.loads(payload)
            pose = PoseStamped()
            pose.header.frame_id = "map"
            pose.pose.position.x = float(place["x"])
            pose.pose.position.y = float(place["y"])
            publisher.publish(pose)

        wire = Wire(int(port), "bench-passthrough", (topic,), pass_on)
        node.create_subscription(
            GoalStatusArray, STATUS_TOPIC, lambda _statuses: wire.publish(answer_topic, answer), LATCHED
        )
        # each side discovers the other for itself: what is published before this one has is lost
        wait_until(publisher.get_subscription_count, what="the far end is discovered")

    run_node("bench_passthrough", domain_id=int(domain_id), namespace=namespace, prepare=connect)


if __name__ == "__main__":
    main()
