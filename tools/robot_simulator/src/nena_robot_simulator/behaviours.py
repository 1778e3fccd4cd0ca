"""Nav2's behaviour and docking servers: one goal at a time, which moves the robot at a velocity."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any
from uuid import UUID

from nena_robot_simulator.action_server import SimpleAction
from nena_robot_simulator.robot import Robot
from nena_robot_simulator.servers import Server
from nena_robot_simulator.session import RosSession
from nena_shared.log import get_logger
from nena_shared.ros import GoalStatus as Status
from nena_shared.ros import interface

log = get_logger(__name__)

DOCKING = {"dock_robot": "DockRobot", "undock_robot": "UndockRobot"}
RECOVERIES = {"spin": "Spin", "backup": "BackUp"}
"""Behaviours that the navigator also uses; the node serves their cancel services."""
BEHAVIOURS = {**RECOVERIES, "drive_on_heading": "DriveOnHeading"}
"""Names and types of the actions."""
PERIOD = 0.02
"""Seconds between two checks of the goal."""
# Measured at the docking server, for an empty ID as well.
NOT_IN_DATABASE = 901
DOCK_DISTANCE, DOCK_SPEED = 0.4, 0.2
"""Distance from the staging pose into the dock, m, and speed, m/s."""
YAW_RATE = 1.0
"""Yaw rate of behaviours, rad/s."""


@dataclass(slots=True)
class Work:
    """The current goal: the remaining distance (m) or angle (rad), and the velocity."""

    name: str
    goal_id: UUID
    left: float
    velocity: tuple[float, float]
    error_code: int = 0
    fails: bool = False
    """Whether it is ABORTED, with or without a code."""


class Behaviours:
    """The behaviour servers of one robot; ``wake`` makes it move."""

    def __init__(
        self, session: RosSession, robot: Robot, docks: tuple[str, ...], wake: Callable[[], None]
    ) -> None:
        self._session = session
        self._robot = robot
        self._docks = docks
        self._wake = wake
        self._work: Work | None = None
        self._pose = robot.pose
        self._actions: dict[str, SimpleAction] = {}

        session.every(PERIOD, self._advance_work)

    def open(self, actions: Mapping[str, str]) -> list[Any]:
        """Join the ROS graph with the actions (names and types) whose types are installed."""
        found: list[Any] = []
        for name, type_name in actions.items():
            kind = interface(f"nav2_msgs/action/{type_name}")
            if kind is not None:
                action = self._actions[name] = SimpleAction(self._session, name, kind)
                cancel = None if name in RECOVERIES else partial(self._cancel_goal, name)
                found += action.open(partial(self._accept_goal, name), cancel)
        return found

    def cancel(self, *names: str) -> bool:
        """Cancel the current goal if it belongs to one of these actions; return whether it did."""
        if self._work is None or self._work.name not in names:
            return False
        self._end_work(Status.CANCELED)
        return True

    def _cancel_goal(self, name: str, _goal_id: UUID) -> bool:
        return self.cancel(name)

    def _accept_goal(self, name: str, goal_id: UUID, goal: Any) -> bool:  # noqa: ANN401
        if self._work is not None:
            return False
        self._work = self._work_of(name, goal_id, goal)
        log.info("behaviour", name=name, left=self._work.left)
        self._robot.behaviour, self._pose = self._work.velocity, self._robot.pose
        self._actions[name].show(goal_id, Status.EXECUTING)
        if name != "dock_robot":
            self._robot.docked = False
        self._wake()
        return True

    def _work_of(self, name: str, goal_id: UUID, goal: Any) -> Work:  # noqa: ANN401
        match name:
            case "dock_robot":
                known = goal.dock_id in self._docks
                if not known:
                    return Work(name, goal_id, 0.0, (0.0, 0.0), NOT_IN_DATABASE, fails=True)
                return Work(name, goal_id, DOCK_DISTANCE, (DOCK_SPEED, 0.0))
            case "undock_robot":
                # Measured: undocking a robot that is not docked ends ABORTED with code 0.
                if not self._robot.docked:
                    return Work(name, goal_id, 0.0, (0.0, 0.0), fails=True)
                return Work(name, goal_id, DOCK_DISTANCE, (-DOCK_SPEED, 0.0))
            case "spin":
                turn = float(goal.target_yaw)
                return Work(name, goal_id, abs(turn), (0.0, math.copysign(YAW_RATE, turn)))
            case _:
                away = -1.0 if name == "backup" else 1.0
                return Work(name, goal_id, abs(float(goal.target.x)), (away * abs(float(goal.speed)), 0.0))

    def _advance_work(self) -> None:
        work = self._work
        if work is None:
            return
        if work.name not in DOCKING and not self._robot.servers.there(Server.BEHAVIOURS):
            self._work = self._robot.behaviour = None  # its goal never ends
            return
        before, self._pose = self._pose, self._robot.pose
        turned = abs(math.remainder(self._pose.yaw - before.yaw, math.tau))
        work.left -= turned if work.velocity[1] else before.distance(self._pose)
        if work.left <= 0.0:
            self._end_work(Status.ABORTED if work.fails else Status.SUCCEEDED)

    def _end_work(self, status: Status) -> None:
        work, self._work, self._robot.behaviour = self._work, None, None
        if work is not None:
            if work.name == "dock_robot" and status is Status.SUCCEEDED:
                self._robot.docked = True
            log.info("behaviour ended", name=work.name, status=status.name)
            action = self._actions[work.name]
            result = action.result()
            result.error_code = work.error_code
            if hasattr(result, "success"):
                result.success = status is Status.SUCCEEDED
            action.end(work.goal_id, status, result)
