"""What a caller of fleet control can do wrong."""

from __future__ import annotations

from nena_shared.vda5050.topics import RobotKey


class RobotBusyError(Exception):
    """The robot has a mission already; end that one first."""

    def __init__(self, robot: RobotKey, mission_id: str) -> None:
        super().__init__(f"robot {robot} has the mission {mission_id!r}; a robot has one mission at a time")
        self.robot = robot
        self.mission_id = mission_id
