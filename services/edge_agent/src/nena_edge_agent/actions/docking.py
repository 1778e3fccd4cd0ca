"""Docking by an offset: a drive from where the robot stands to a place beside it."""

from __future__ import annotations

from functools import partial
from math import cos, sin

from nena_edge_agent.actions.background import BackgroundAction, WorkFailedError
from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.actions.ports import DriveError, DrivePort
from nena_edge_agent.actions.settings import DockOperationSettings
from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ValueDataType
from nena_shared.vda5050.state import Load

FORWARD = "forward"


class Docking:
    """Drives by the offset of the settings, or as far ahead as the order says."""

    def __init__(self, settings: DockOperationSettings, drive: DrivePort) -> None:
        self._settings = settings
        self._drive = drive
        reach = abs(settings.forward)
        forward = Parameter(
            FORWARD,
            ValueDataType.NUMBER,
            required=False,
            description=f"m ahead, below zero backwards; {settings.forward:g} if not given",
            minimum=-reach,
            maximum=reach,
        )
        self.declaration = ActionDeclaration(
            settings.action_type,
            scopes=settings.scopes,
            parameters=(
                *(each.declared for each in settings.parameters),
                *((forward,) if settings.adjustable else ()),
            ),
            blocking_types=settings.blocking_types,
            cancel_allowed=True,
            load=settings.load_change,
            timeout=settings.timeout,
            description=settings.description or f"Drives {settings.forward:g} m ahead.",
        )

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Begin to drive."""
        return BackgroundAction(action.action_id, partial(self._work, action), report)

    async def _work(self, action: Action) -> ActionReport:
        start = self._drive.pose
        if start is None:
            message = "the robot does not know where it is"
            raise WorkFailedError(message)
        try:
            await self._drive.drive(
                self._goal(start, action),
                deviation_xy=self._settings.deviation_xy,
                deviation_theta=self._settings.deviation_theta,
                maximum_speed=self._settings.speed,
            )
        except DriveError as error:
            raise WorkFailedError(str(error)) from error
        return ActionReport(action.action_id, ActionStatus.FINISHED, charging=self._settings.charging)

    def _goal(self, start: Pose, action: Action) -> Pose:
        asked = action.parameter(FORWARD) if self._settings.adjustable else None
        ahead = float(asked) if isinstance(asked, int | float) else self._settings.forward
        return beside(start, ahead, self._settings.left, self._settings.turn)


def beside(pose: Pose, ahead: float, left: float, turn: float) -> Pose:
    """Give the place ``ahead`` and to the ``left`` (m) of ``pose``, turned by ``turn`` (rad)."""
    x = pose.x + ahead * cos(pose.theta) - left * sin(pose.theta)
    y = pose.y + ahead * sin(pose.theta) + left * cos(pose.theta)
    return Pose(x, y, pose.theta + turn, pose.map_id)
