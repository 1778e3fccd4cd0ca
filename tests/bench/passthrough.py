"""The yardstick of (b): MQTT in, goal_pose out, with bare paho and rclpy and nothing in between.

Run as a process of its own: ``bench.passthrough PORT DOMAIN_ID NAMESPACE TOPIC``; ends when its input closes.
"""

from __future__ import annotations

import json
import os
import sys

os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.context import Context

from bench.wire import Wire


def main() -> None:
    """Pass messages on until the input closes."""
    port, domain_id, namespace, topic = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3], sys.argv[4]
    context = Context()
    rclpy.init(context=context, domain_id=domain_id)
    node = rclpy.create_node("bench_passthrough", namespace=namespace, context=context)
    publisher = node.create_publisher(PoseStamped, "goal_pose", 1)

    def pass_on(_topic: str, payload: bytes, _moment: float) -> None:
        place = json.loads(payload)
        pose = PoseStamped()
        pose.header.frame_id = "map"
        pose.pose.position.x = float(place["x"])
        pose.pose.position.y = float(place["y"])
        publisher.publish(pose)

    wire = Wire(port, "bench-passthrough", (topic,), pass_on)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sys.stdin.read()
    wire.close()
    node.destroy_node()
    context.try_shutdown()


if __name__ == "__main__":
    main()
