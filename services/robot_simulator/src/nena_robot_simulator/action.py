"""The actions of bt_navigator."""

from __future__ import annotations

from enum import StrEnum


class Action(StrEnum):
    """Each has a server of its own; the value is its name in the ROS graph."""

    TO_POSE = "navigate_to_pose"
    THROUGH_POSES = "navigate_through_poses"
