"""The planner's actions in the ROS graph: paths that clients ask for without driving them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any
from uuid import UUID

from nena_robot_simulator import messages
from nena_robot_simulator.action_server import SimpleAction
from nena_robot_simulator.robot import Robot
from nena_robot_simulator.servers import Server
from nena_robot_simulator.session import RosSession
from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.ros import GoalStatus, interface

log = get_logger(__name__)

ACTIONS: Mapping[str, str] = {
    "compute_path_to_pose": "ComputePathToPose",
    "compute_path_through_poses": "ComputePathThroughPoses",
}
"""Names and types."""


class PlannerServer:
    """One robot's; each path is there at once."""

    def __init__(self, session: RosSession, robot: Robot, clock: Clock) -> None:
        self._session = session
        self._robot = robot
        self._clock = clock

    def open(self) -> list[Any]:
        """Join the ROS graph with the actions whose types are installed."""
        found: list[Any] = []
        for name, type_name in ACTIONS.items():
            kind = interface(f"nav2_msgs/action/{type_name}")
            if kind is not None:
                action = SimpleAction(self._session, name, kind)
                found += action.open(partial(self._plan_path, action), lambda _: False)
        return found

    def _plan_path(self, action: SimpleAction, goal_id: UUID, goal: Any) -> bool:  # noqa: ANN401 - rclpy carries no types
        if not self._robot.servers.works(Server.PLANNER):
            return False
        several = hasattr(goal, "goals")
        stamped = list(goal.goals) if several else [goal.goal]
        frame_id = stamped[-1].header.frame_id if stamped else ""
        start = messages.goal_pose_of(goal.start.pose) if goal.use_start else None
        places = tuple(messages.goal_pose_of(each.pose) for each in stamped)
        poses, code = self._robot.plan(places, frame_id, start, several=several)
        nanoseconds = int(self._clock.now().timestamp() * 1_000_000) * 1000
        result = action.result()
        result.path, result.error_code = messages.path_message(poses, "map", nanoseconds), code
        log.info("path planned", action=action.name, poses=len(poses), code=code)
        action.show(goal_id, GoalStatus.EXECUTING)
        action.end(goal_id, GoalStatus.SUCCEEDED if poses else GoalStatus.ABORTED, result)
        return True
