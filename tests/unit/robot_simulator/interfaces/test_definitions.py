"""The simulator's definitions have the fields of Nav2 1.3.13 (Jazzy), in their order.

DDS drops a message silently if reader and writer define it with other fields.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from nena_robot_simulator.interfaces.__main__ import PACKAGES
from support.action_types import needs_nav2_types

NAV2 = PACKAGES[0]
POSE, DURATION = "geometry_msgs/PoseStamped", "builtin_interfaces/Duration"
MOVE = f"geometry_msgs/Point target, float32 speed, {DURATION} time_allowance"
MOVED = f"{DURATION} total_elapsed_time, uint16 error_code, string error_msg"
PLANNED = f"nav_msgs/Path path, {DURATION} planning_time, uint16 error_code, string error_msg"
DRIVEN = (
    f"{POSE} current_pose, {DURATION} navigation_time, {DURATION} estimated_time_remaining, "
    "int16 number_of_recoveries, float32 distance_remaining"
)
DOCK = (
    f"bool use_dock_id, string dock_id, {POSE} dock_pose, string dock_type, float32 max_staging_time, "
    "bool navigate_to_staging_pose"
)
MAP_METADATA = (
    "builtin_interfaces/Time map_load_time, builtin_interfaces/Time update_time, string layer, "
    "float32 resolution, uint32 size_x, uint32 size_y, geometry_msgs/Pose origin"
)
FIELDS = {
    # docs.ros.org/en/jazzy/p/nav2_msgs/action/NAME.html; 1.3.13 on the wire has the same error_msg.
    "action/BackUp": (MOVE, MOVED, "float32 distance_traveled"),
    "action/ComputePathThroughPoses": (
        f"{POSE}[] goals, {POSE} start, string planner_id, bool use_start",
        PLANNED,
        "",
    ),
    "action/ComputePathToPose": (
        f"{POSE} goal, {POSE} start, string planner_id, bool use_start",
        PLANNED,
        "",
    ),
    "action/DockRobot": (
        DOCK,
        "bool success, uint16 error_code, uint16 num_retries, string error_msg",
        f"uint16 state, {DURATION} docking_time, uint16 num_retries",
    ),
    "action/DriveOnHeading": (MOVE, MOVED, "float32 distance_traveled"),
    "action/FollowPath": (
        "nav_msgs/Path path, string controller_id, string goal_checker_id, string progress_checker_id",
        "std_msgs/Empty result, uint16 error_code, string error_msg",
        "float32 distance_to_goal, float32 speed",
    ),
    "action/FollowWaypoints": (
        f"uint32 number_of_loops, uint32 goal_index, {POSE}[] poses",
        "nav2_msgs/MissedWaypoint[] missed_waypoints, uint16 error_code, string error_msg",
        "uint32 current_waypoint",
    ),
    "action/NavigateThroughPoses": (
        f"{POSE}[] poses, string behavior_tree",
        "uint16 error_code, string error_msg",
        f"{DRIVEN}, int16 number_of_poses_remaining",
    ),
    "action/NavigateToPose": (
        f"{POSE} pose, string behavior_tree",
        "uint16 error_code, string error_msg",
        DRIVEN,
    ),
    "action/Spin": (
        f"float32 target_yaw, {DURATION} time_allowance",
        MOVED,
        "float32 angular_distance_traveled",
    ),
    "action/UndockRobot": (
        "string dock_type, float32 max_undocking_time",
        "bool success, uint16 error_code, string error_msg",
        "",
    ),
    # github.com/ros-navigation/navigation2, nav2_msgs/msg and nav2_msgs/srv of the branch jazzy
    "msg/CollisionMonitorState": ("uint8 action_type, string polygon_name",),
    "msg/Costmap": ("std_msgs/Header header, nav2_msgs/CostmapMetaData metadata, uint8[] data",),
    "msg/CostmapFilterInfo": (
        "std_msgs/Header header, uint8 type, string filter_mask_topic, float32 base, float32 multiplier",
    ),
    "msg/CostmapMetaData": (MAP_METADATA,),
    "msg/MissedWaypoint": (f"uint32 index, {POSE} goal, uint16 error_code",),
    "msg/SpeedLimit": ("std_msgs/Header header, bool percentage, float64 speed_limit",),
    "srv/ClearEntireCostmap": ("std_msgs/Empty request", "std_msgs/Empty response"),
    "srv/GetCostmap": ("nav2_msgs/CostmapMetaData specs", "nav2_msgs/Costmap map"),
    "srv/LoadMap": ("string map_url", "nav_msgs/OccupancyGrid map, uint8 result"),
    "srv/ManageLifecycleNodes": ("uint8 command", "bool success"),
}
"""Of an action goal, result and feedback; of a service request and response."""
PARTS = {"action": ("Goal", "Result", "Feedback"), "srv": ("Request", "Response"), "msg": ("",)}
IN_PYTHON = {"float": "float32", "double": "float64", "boolean": "bool"}


def fields_of(definition: str) -> tuple[str, ...]:
    """Return the fields of each part of a definition, without defaults, constants and comments."""
    parts: list[list[str]] = [[]]
    for line in definition.splitlines():
        text = line.partition("#")[0].strip()
        if text == "---":
            parts.append([])
        elif text and "=" not in text:
            kind, name, *_ = text.split()
            own = "/" not in kind and kind[0].isupper()
            parts[-1].append(f"{'nav2_msgs/' if own else ''}{kind} {name}")
    return tuple(", ".join(each) for each in parts)


def in_words(kind: Any) -> str:
    """Return the fields of a type in Python."""
    words = []
    for name, found in kind.get_fields_and_field_types().items():
        element = found.removeprefix("sequence<").removesuffix(">")
        words.append(f"{IN_PYTHON.get(element, element)}{'[]' if element != found else ''} {name}")
    return ", ".join(words)


@pytest.mark.parametrize("path", sorted(NAV2.rglob("*.*")), ids=lambda path: str(path.stem))
def test_each_definition_has_the_fields_of_nav2(path: Path) -> None:
    assert fields_of(path.read_text(encoding="utf-8")) == FIELDS[f"{path.parent.name}/{path.stem}"]


@pytest.mark.ros
@needs_nav2_types
@pytest.mark.parametrize("name", FIELDS)
def test_the_types_that_are_installed_have_them_too(name: str) -> None:
    """Nav2's own where they are installed; else those made of the definitions, unless they are outdated."""
    folder, kind = name.split("/")
    found = getattr(import_module(f"nav2_msgs.{folder}"), kind)
    parts = [getattr(found, part) if part else found for part in PARTS[folder]]
    assert tuple(map(in_words, parts)) == FIELDS[name], "`make action-types` makes the types again"
