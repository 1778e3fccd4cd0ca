"""Optional features of Nav2, used if this machine has their types.

A robot's ROS installation usually has ``nav2_msgs``; the agent also works without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from nena_edge_agent.nav2.session_control import prepare_environment
from nena_edge_agent.nav2.settings import Navigation, RosSettings
from nena_shared import ros

CLEAR_COSTMAP = "nav2_msgs/srv/ClearEntireCostmap"
COLLISION_MONITOR = "nav2_msgs/msg/CollisionMonitorState"
FILTER_INFO = "nav2_msgs/msg/CostmapFilterInfo"
NAVIGATE = "nav2_msgs/action/NavigateToPose"
FOLLOW_PATH = "nav2_msgs/action/FollowPath"
LOAD_MAP = "nav2_msgs/srv/LoadMap"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
SPEED_LIMIT = "nav2_msgs/msg/SpeedLimit"


def interface(name: str) -> Any | None:  # noqa: ANN401 - rclpy carries no types
    """Return the type of a name such as ``nav2_msgs/msg/SpeedLimit``; None if it is not installed."""
    prepare_environment()
    return ros.interface(name)


@dataclass(frozen=True, slots=True)
class Nav2Offers:
    """The optional features that Nav2 offers.

    ``limits_speed``: it obeys speed limits; ``keeps_out``: it plans around closed areas; ``follows_paths``:
    its controller follows paths of the agent; ``behavior_trees``: names that orders may request.
    """

    limits_speed: bool = False
    keeps_out: bool = False
    follows_paths: bool = False
    behavior_trees: tuple[str, ...] = ()


NO_OFFERS = Nav2Offers()


def nav2_offers(settings: RosSettings) -> Nav2Offers:
    """Return the configured features for which this machine has the types."""
    by_action = settings.navigation is not Navigation.TOPICS and interface(NAVIGATE) is not None
    return Nav2Offers(
        limits_speed=settings.nav2.speed_limit and interface(SPEED_LIMIT) is not None,
        keeps_out=settings.nav2.keep_out and interface(FILTER_INFO) is not None,
        follows_paths=settings.nav2.follow_path and interface(FOLLOW_PATH) is not None,
        behavior_trees=tuple(sorted(settings.behavior_trees)) if by_action else (),
    )
