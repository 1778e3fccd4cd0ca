"""The loopback driver: obeys goals at a set speed, without any robot."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from math import inf

from nena_edge_agent.driver.port import (
    Arrived,
    BatteryReport,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    Emit,
    Halted,
    NavigationReport,
    Pose,
    PoseReport,
    PositionInitialized,
)
from nena_edge_agent.loopback.motion import Motion
from nena_edge_agent.loopback.settings import LoopbackSettings
from nena_shared.clock import Clock

METRES_OF_DRAIN = 100.0
BATTERY_STEP = 1.0
"""Percent of charge between two reports."""


class LoopbackDriver:
    """One robot; costs nothing while it stands."""

    def __init__(self, settings: LoopbackSettings, start: Pose, *, emit: Emit, clock: Clock) -> None:
        self._settings = settings
        self._emit = emit
        self._clock = clock
        self._pose = start
        self._charge = settings.charge
        self._told_charge = settings.charge
        self._goal: DriveGoal | None = None
        self._motion: Motion | None = None
        self._timer: asyncio.TimerHandle | None = None

    async def start(self) -> None:
        """Tell where the robot is, and that it can drive."""
        self._tell_pose(0.0, 0.0)
        self._tell_battery()
        self._emit(NavigationReport(available=True, reason=""))

    async def stop(self) -> None:
        """Stand."""
        self._stand()

    def go_to(self, goal: DriveGoal) -> None:
        """Drive straight to ``goal`` from where the robot is."""
        self._stand()
        if goal.pose.map_id != self._pose.map_id:
            self._soon(lambda: self._refuse(goal))
            return
        self._goal = goal
        self._motion = Motion(
            start=self._pose,
            goal=goal.pose,
            begin=self._clock.monotonic(),
            speed=min(self._settings.speed, goal.maximum_speed or inf),
            rate=self._settings.turn_rate,
            turn_at_end=goal.deviation_theta is not None,
        )
        self._wait()

    def halt(self) -> None:
        """Stop on the spot."""
        self._stand()
        self._soon(self._halted)

    def initialize_position(self, pose: Pose) -> None:
        """Be there, at once."""
        self._stand()
        self._pose = pose
        self._soon(self._placed)

    def _stand(self) -> None:
        """Drop the goal, and be where the robot is at this moment."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._motion is not None:
            self._move(self._motion)
        self._goal, self._motion = None, None

    def _move(self, motion: Motion) -> tuple[float, float]:
        """Be where ``motion`` has brought the robot; gives speed and turning rate."""
        before = self._pose
        self._pose, vx, omega = motion.at(self._clock.monotonic())
        way = ((self._pose.x - before.x) ** 2 + (self._pose.y - before.y) ** 2) ** 0.5
        self._charge = max(0.0, self._charge - self._settings.drain * way / METRES_OF_DRAIN)
        return vx, omega

    def _wait(self) -> None:
        if self._motion is not None:
            left = max(0.0, self._motion.end - self._clock.monotonic())
            delay = min(left, self._settings.pose_interval)
            self._timer = asyncio.get_running_loop().call_later(delay, self._step)

    def _step(self) -> None:
        self._timer = None
        motion, goal = self._motion, self._goal
        if motion is None or goal is None:
            return
        arrived = self._clock.monotonic() >= motion.end
        vx, omega = self._move(motion)
        if arrived:
            self._goal, self._motion = None, None
        self._tell_pose(vx, omega)
        if arrived:
            self._emit(Arrived(goal.generation))
        if self._told_charge - self._charge >= BATTERY_STEP:
            self._tell_battery()
        self._wait()

    def _halted(self) -> None:
        self._tell_pose(0.0, 0.0)
        self._emit(Halted())

    def _placed(self) -> None:
        self._tell_pose(0.0, 0.0)
        self._emit(PositionInitialized(succeeded=True, description=""))

    def _refuse(self, goal: DriveGoal) -> None:
        text = f"the robot is on map '{self._pose.map_id}', the goal on '{goal.pose.map_id}'"
        self._emit(DriveFailed(goal.generation, DriveFailure.ABORTED, text))

    def _tell_pose(self, vx: float, omega: float) -> None:
        self._emit(PoseReport(self._pose, localized=True, vx=vx, omega=omega))

    def _tell_battery(self) -> None:
        self._told_charge = self._charge
        self._emit(BatteryReport(state_of_charge=self._charge, charging=False))

    def _soon(self, step: Callable[[], None]) -> None:
        """Answer from the loop, never from within the caller's own call."""
        asyncio.get_running_loop().call_soon(step)
