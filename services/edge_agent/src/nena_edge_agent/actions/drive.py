"""Drives of actions, by the port that the order drives by."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from nena_edge_agent.actions.ports import DriveError
from nena_edge_agent.driver.port import Arrived, DriveFailed, DriveGoal, Driver, Halted, Pose, PoseReport
from nena_edge_agent.protocol.events import Event

HALT_TIMEOUT = 10.0
"""Seconds for the robot to stand, after which a drive that was given up ends anyway."""


class ActionDrive:
    """One robot's. Its goals have numbers below zero, which the protocol core takes for none of its own."""

    def __init__(self) -> None:
        self._driver: Driver | None = None
        self._pose: PoseReport | None = None
        self._generation = 0
        self._result: asyncio.Future[str] | None = None
        self._stand: asyncio.Event = asyncio.Event()

    def attach(self, driver: Driver) -> None:
        """Drive by ``driver`` from now on."""
        self._driver = driver

    def hear(self, event: Event) -> None:
        """Look at what the driver tells the core."""
        match event:
            case PoseReport():
                self._pose = event
            case Halted():
                self._stand.set()
            case Arrived(generation) if generation == self._generation:
                self._end("")
            case DriveFailed(generation, failure, description) if generation == self._generation:
                self._end(f"{description} ({failure})")

    @property
    def pose(self) -> Pose | None:
        """Where the robot is; None where that cannot be trusted."""
        return self._pose.pose if self._pose and self._pose.localized else None

    async def drive(
        self,
        pose: Pose,
        *,
        deviation_xy: float,
        deviation_theta: float | None = None,
        maximum_speed: float | None = None,
    ) -> None:
        """Drive to ``pose``; cancelled, it stops the robot first.

        Raises:
            DriveError: it did not get there, or another action drives.

        """
        if self._driver is None or self._result is not None:
            message = "another action drives" if self._driver else "the driver is not there yet"
            raise DriveError(message)
        self._generation -= 1
        goal = DriveGoal(self._generation, pose, deviation_xy, deviation_theta, maximum_speed)
        self._result = asyncio.get_running_loop().create_future()
        try:
            self._driver.go_to(goal)
            problem = await self._result
        except asyncio.CancelledError:
            await self._halt(self._driver.halt)
            raise
        finally:
            self._result = None
        if problem:
            raise DriveError(problem)

    async def _halt(self, halt: Callable[[], None]) -> None:
        self._stand.clear()
        halt()
        try:
            async with asyncio.timeout(HALT_TIMEOUT):
                await self._stand.wait()
        except TimeoutError:
            return

    def _end(self, problem: str) -> None:
        if self._result is not None and not self._result.done():
            self._result.set_result(problem)
