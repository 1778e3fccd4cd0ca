"""Docking by an offset: a short drive from the robot's pose to a pose nearby."""

from __future__ import annotations

import asyncio
from math import cos, sin

from nena_edge_agent.actions.plugin import (
    BackgroundAction,
    DriveError,
    DrivePort,
    Report,
    RunningAction,
    WorkFailedError,
)
from nena_edge_agent.driver.port import Pose
from nena_edge_agent.extensions.action_kinds.settings import DockOperationSettings
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ValueDataType
from nena_shared.vda5050.state import Load

FORWARD = "forward"


class Docking:
    """Drives by the configured offset, or as far ahead as the order requests."""

    def __init__(self, settings: DockOperationSettings, drive: DrivePort) -> None:
        self._settings = settings
        self._drive = drive
        reach = abs(settings.forward)
        forward = Parameter(
            FORWARD,
            ValueDataType.NUMBER,
            required=False,
            description=f"m forward, negative: backward; default {settings.forward:g}",
            minimum=-reach,
            maximum=reach,
        )
        self.declaration = ActionDeclaration(
            settings.action_type,
            scopes=settings.scopes,
            parameters=(
                *(parameter.declared for parameter in settings.parameters),
                *((forward,) if settings.adjustable else ()),
            ),
            blocking_types=settings.blocking_types,
            pause_allowed=True,
            cancel_allowed=True,
            load=settings.load_change,
            timeout=settings.timeout,
            description=settings.description or f"Drives {settings.forward:g} m ahead.",
        )

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Start the drive."""
        requested = action.parameter(FORWARD) if self._settings.adjustable else None
        ahead = float(requested) if isinstance(requested, int | float) else self._settings.forward
        return _Drive(action.action_id, self._settings, self._drive, ahead, report)


class _Drive(BackgroundAction):
    """One drive. When paused, the robot stops; when resumed, it drives to the same pose."""

    def __init__(
        self, action_id: str, settings: DockOperationSettings, drive: DrivePort, ahead: float, report: Report
    ) -> None:
        self._settings = settings
        self._drive = drive
        self._ahead = ahead
        self._resumed = asyncio.Event()
        self._resumed.set()
        self._drive_task: asyncio.Task[None] | None = None
        super().__init__(action_id, self._dock_robot, report)

    def pause(self) -> None:
        """Stop the robot; PAUSED is reported at standstill."""
        if not self.ended:
            self._resumed.clear()
            if self._drive_task is not None:
                self._drive_task.cancel()

    def resume(self) -> None:
        """Continue the drive."""
        self._resumed.set()

    async def _dock_robot(self) -> ActionReport:
        start = self._drive.pose
        if start is None:
            raise WorkFailedError("the robot is not localised")
        goal = offset_pose(start, self._ahead, self._settings.left, self._settings.turn)
        while not await self._drive_once(goal):
            self._report(ActionReport(self._action_id, ActionStatus.PAUSED))
            await self._resumed.wait()
            self._report(ActionReport(self._action_id, ActionStatus.RUNNING))
        return ActionReport(self._action_id, ActionStatus.FINISHED, charging=self._settings.charging)

    async def _drive_once(self, goal: Pose) -> bool:
        """Drive to ``goal``; return False if the action was paused before the arrival."""
        if not self._resumed.is_set():
            return False
        settings, task = self._settings, asyncio.current_task()
        self._drive_task = asyncio.create_task(
            self._drive.drive(
                goal,
                deviation_xy=settings.deviation_xy,
                deviation_theta=settings.deviation_theta,
                maximum_speed=settings.speed,
            ),
            name=f"drive of action {self._action_id}",
        )
        try:
            await self._drive_task
        except DriveError as error:
            raise WorkFailedError(str(error)) from error
        except asyncio.CancelledError:
            # The action itself was cancelled, not only its drive by a pause.
            if task is not None and task.cancelling():
                raise
            return False
        finally:
            self._drive_task = None
        return True


def offset_pose(pose: Pose, ahead: float, left: float, turn: float) -> Pose:
    """Return the pose ``ahead`` and to the ``left`` (m) of ``pose``, turned by ``turn`` (rad)."""
    x = pose.x + ahead * cos(pose.theta) - left * sin(pose.theta)
    y = pose.y + ahead * sin(pose.theta) + left * cos(pose.theta)
    return Pose(x, y, pose.theta + turn, pose.map_id)
