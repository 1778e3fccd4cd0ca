"""A bare rclpy node in a separate process, as a yardstick: it listens until its input closes."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable

os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

END_SECONDS = 5.0


def run_node(name: str, *, domain_id: int, namespace: str, prepare: Callable[[Node], object]) -> None:
    """Spin a node prepared by ``prepare``; report when it is ready, return when the input closes."""
    context = Context()
    rclpy.init(context=context, domain_id=domain_id)
    node = rclpy.create_node(name, namespace=namespace, context=context)
    prepare(node)
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
    thread.join(timeout=END_SECONDS)
