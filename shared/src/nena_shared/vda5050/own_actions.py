"""NeNa's own action types; robots that support them list them in their factsheet."""

from __future__ import annotations

from typing import Final

from nena_shared.vda5050.factsheet import Factsheet

START_ROS_SESSION: Final = "nena:startRosSession"
STOP_ROS_SESSION: Final = "nena:stopRosSession"
CONFIGURE_ROS_SESSION: Final = "nena:configureRosSession"

SHOW_MAP_TRANSFORMS: Final = "nena:showMapTransforms"
"""Sends the transforms from the plant frame to the robot's maps. A robot that lists it uses the plant frame
and transforms poses itself, so fleet control must not."""

USE_BEHAVIOR_TREE: Final = "nena:useBehaviorTree"
"""Edge action: makes Nav2 use another behaviour tree on the edge."""
BEHAVIOR_TREE: Final = "behaviorTree"
"""Parameter of USE_BEHAVIOR_TREE: name of the tree in the agent's settings."""

FETCH_RECORDING: Final = "nena:fetchRecording"
"""Writes the last minutes of the robot's black box to a file, and sends it to the status aggregator."""

ROS_SESSION: Final = "rosSession"
"""Type of the information entry that reports the robot's ROS session."""


def transforms_itself(factsheet: Factsheet) -> bool:
    """Return whether the robot converts between the plant frame and its map itself."""
    actions = factsheet.protocol_features.mobile_robot_actions
    return any(action.action_type == SHOW_MAP_TRANSFORMS for action in actions)
