"""What Nav2's servers offer beside driving, in the ROS graph: each part only if its types are installed."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy

from nena_robot_simulator.robot import Robot
from nena_robot_simulator.session import RosSession

RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


def interface(name: str) -> Any | None:  # noqa: ANN401 - rclpy carries no types
    """Return the type of a name such as ``nav2_msgs/msg/SpeedLimit``; None if it is not installed."""
    package, kind, type_name = name.split("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), type_name, None)
    except ImportError:
        return None


class Offers:
    """The endpoints of one robot."""

    def __init__(self, session: RosSession, robot: Robot) -> None:
        self._robot = robot
        if kind := interface("nav2_msgs/msg/SpeedLimit"):
            session.subscribe(kind, "speed_limit", self._on_speed_limit, RELIABLE)

    def _on_speed_limit(self, message: Any) -> None:  # noqa: ANN401
        """Take a limit like Regulated Pure Pursuit: one above the robot's own speed makes it faster."""
        limit = float(message.speed_limit)
        self._robot.limit_speed(limit, percentage=bool(message.percentage))
