"""A driver controlled by the test: it stores its commands, and the test emits its events."""

from __future__ import annotations

from collections.abc import Callable

from nena_edge_agent.driver.port import Area, DriveGoal, OwnGoals, Pose


class ScriptedDriver:
    """A driver that stores its commands."""

    def __init__(self) -> None:
        self.goals: list[DriveGoal] = []
        self.halts = 0
        self.on_halt: Callable[[], None] = lambda: None

    async def start(self) -> None:
        """Nothing to start."""

    async def stop(self) -> None:
        """Nothing to stop."""

    def reclaim(self, goals: OwnGoals) -> None:
        """Nothing to reclaim."""

    def keep_out(self, areas: tuple[Area, ...]) -> None:
        self.areas = areas

    def limit_speed(self, speed: float | None) -> None:
        """Nothing to limit."""

    def initialize_position(self, pose: Pose) -> None:
        """Nothing to initialise."""

    def go_to(self, goal: DriveGoal) -> None:
        self.goals.append(goal)

    def halt(self) -> None:
        self.halts += 1
        self.on_halt()
