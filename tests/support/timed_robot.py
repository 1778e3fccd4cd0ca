"""A simulated robot without ROS, whose time is moved by the test."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any
from uuid import UUID

from nena_robot_simulator import faults
from nena_robot_simulator.goals import Action
from nena_robot_simulator.motion import Pose, hall
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.robot import Robot
from nena_robot_simulator.settings import RobotSettings, SimulatorSettings

A, B = UUID(int=1), UUID(int=2)
HALL = hall(min_x=-20, min_y=-20, max_x=30, max_y=20, resolution=0.1)


class Bench:
    """A robot whose time is moved by the test."""

    def __init__(
        self,
        *,
        time_factor: float = 1.0,
        replan_period: float = 0.0,
        recovery_time: float = 0.0,
        server_timeout: float = 0.02,
        **settings: Any,
    ) -> None:
        self.now = 100.0
        self.robot = Robot(
            RobotSettings(**settings),
            SimulatorSettings(
                time_factor=time_factor,
                replan_period=replan_period,
                recovery_time=recovery_time,
                server_timeout=server_timeout,
            ),
            hall=HALL,
            now=self.now,
            noise=random.Random(7),
        )

    def take(self, goal_id: UUID, x: float, y: float, yaw: float = 0.0, frame: str = "map") -> bool:
        return self.robot.take_goal(Goal(goal_id, Pose(x, y, yaw), frame), 1, self.now)

    def apply(self, fault: faults.AnyFault, goal_id: UUID = B) -> None:
        self.robot.apply(fault, goal_id=goal_id, accepted_ns=1, now=self.now)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> float:
        """Run for ``seconds`` or until the condition holds; return the seconds that passed."""
        start = self.now
        while self.now - start < seconds and not until():
            self.now += 0.01
            self.robot.advance(self.now)
        return self.now - start

    def until_ended(self, goal_id: UUID = A, seconds: float = 60.0) -> int:
        self.run(seconds, lambda: int(self.robot.goals(Action.TO_POSE)[goal_id]) >= 4)
        return int(self.robot.goals(Action.TO_POSE)[goal_id])
