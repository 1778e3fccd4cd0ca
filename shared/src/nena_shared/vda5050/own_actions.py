"""Action types of NeNa's own; a robot that has them lists them in its factsheet."""

from __future__ import annotations

from typing import Final

from nena_shared.vda5050.factsheet import Factsheet

START_ROS_SESSION: Final = "nena:startRosSession"
STOP_ROS_SESSION: Final = "nena:stopRosSession"
CONFIGURE_ROS_SESSION: Final = "nena:configureRosSession"

SHOW_MAP_TRANSFORMS: Final = "nena:showMapTransforms"
"""Describes how the plant lies on the robot's maps. A robot that lists it uses the plant's frame and
transforms poses itself; so fleet control must not."""

USE_BEHAVIOR_TREE: Final = "nena:useBehaviorTree"
"""Edge action: has Nav2 drive the edge by another behaviour tree."""
BEHAVIOR_TREE: Final = "behaviorTree"
"""Parameter of USE_BEHAVIOR_TREE: the tree's name in the agent's settings."""

ROS_SESSION: Final = "rosSession"
"""Type of the information entry with the state of the robot's ROS session."""


def transforms_itself(factsheet: Factsheet) -> bool:
    """Return whether the robot turns the plant's coordinates into those of its map and back."""
    actions = factsheet.protocol_features.mobile_robot_actions
    return any(each.action_type == SHOW_MAP_TRANSFORMS for each in actions)
