"""Actions executed by Nav2's own servers: docking, undocking, and its behaviours."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

from pydantic import JsonValue

from nena_edge_agent.actions.plugin import (
    ActionFailedError,
    BackgroundAction,
    Report,
    RosActionClient,
    RosError,
    RosPort,
    RunningAction,
    WorkFailedError,
)
from nena_edge_agent.actions.settings import Behaviour, Nav2OperationSettings
from nena_edge_agent.nav2.error_codes import meaning_of
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ValueDataType
from nena_shared.vda5050.state import Load

DOCK_ID, ANGLE, DISTANCE = "dockId", "angle", "distance"
# nav2_behaviors (1.3) refuses a distance of 0, whose sign is not that of the speed, except from BackUp.
SHORTEST_DRIVE = 0.001
"""Shortest distance of DriveOnHeading, m."""
_SERVERS: Mapping[Behaviour, tuple[str, str, str]] = {
    Behaviour.DOCK: ("dock_robot", "DockRobot", "Docks with Nav2's docking server."),
    Behaviour.UNDOCK: ("undock_robot", "UndockRobot", "Undocks with Nav2's docking server."),
    Behaviour.SPIN: ("spin", "Spin", "Turns on the spot."),
    Behaviour.BACK_UP: ("backup", "BackUp", "Drives straight backwards."),
    Behaviour.DRIVE_ON_HEADING: ("drive_on_heading", "DriveOnHeading", "Drives straight ahead."),
}
"""ROS action name, its type, and the description in the factsheet."""


def declaration_of(settings: Nav2OperationSettings) -> ActionDeclaration:
    """Return the declaration of the action."""
    return ActionDeclaration(
        settings.action_type,
        scopes=settings.scopes,
        parameters=(*(parameter.declared for parameter in settings.parameters), *_make_parameters(settings)),
        blocking_types=settings.blocking_types,
        cancel_allowed=True,
        load=settings.load_change,
        timeout=settings.time_limit,
        description=settings.description or _SERVERS[settings.behavior][2],
    )


def _make_parameters(settings: Nav2OperationSettings) -> tuple[Parameter, ...]:
    number, most = ValueDataType.NUMBER, settings.maximum
    match settings.behavior:
        case Behaviour.DOCK:
            named = f"name of the dock; default '{settings.dock_id}'" if settings.dock_id else "dock"
            required = not settings.dock_id
            return (Parameter(DOCK_ID, ValueDataType.STRING, required=required, description=named),)
        case Behaviour.SPIN:
            return (Parameter(ANGLE, number, description="rad to the left", minimum=-most, maximum=most),)
        case Behaviour.BACK_UP | Behaviour.DRIVE_ON_HEADING:
            least = 0.0 if settings.behavior is Behaviour.BACK_UP else SHORTEST_DRIVE
            return (Parameter(DISTANCE, number, description="m", minimum=least, maximum=most),)
    return ()


class Nav2Operation:
    """Sends goals to one of Nav2's servers and reports their results."""

    def __init__(self, settings: Nav2OperationSettings, ros: RosPort) -> None:
        self.declaration = declaration_of(settings)
        self._settings = settings
        server, type_name, _ = _SERVERS[settings.behavior]
        self._client: RosActionClient = ros.action(settings.server or server, f"nav2_msgs/action/{type_name}")

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Send the goal; if the action is cancelled, the server's goal is cancelled first."""
        return BackgroundAction(action.action_id, partial(self._run_goal, action), report)

    async def _run_goal(self, action: Action) -> ActionReport:
        try:
            result = await self._client.run(_goal_fields(self._settings, action))
        except ActionFailedError as error:
            code, text = error.result.get("error_code", 0), error.result.get("error_msg", "")
            # Measured (1.3.13): a cancelled goal may carry the code of an earlier failure, such as 208.
            meaning = None if error.cancelled else meaning_of(int(code), str(text))
            details = "; ".join(part for part in meaning if part) if meaning else ""
            raise WorkFailedError(f"{error}: {details}" if meaning else str(error)) from error
        except RosError as error:
            raise WorkFailedError(str(error)) from error
        # Only the docking actions have this field.
        if result.get("success") is False:
            raise WorkFailedError("the server reports failure")
        return ActionReport(action.action_id, ActionStatus.FINISHED, charging=self._settings.charging)


def _goal_fields(settings: Nav2OperationSettings, action: Action) -> dict[str, JsonValue]:
    """Return the fields of the goal."""
    seconds = int(settings.time_limit)
    match settings.behavior:
        case Behaviour.DOCK:
            return {
                "use_dock_id": True,
                "dock_id": str(action.parameter(DOCK_ID) or settings.dock_id),
                "dock_type": settings.dock_type,
                "navigate_to_staging_pose": settings.drives_to_dock,
                "max_staging_time": settings.time_limit,
            }
        case Behaviour.UNDOCK:
            return {"dock_type": settings.dock_type, "max_undocking_time": settings.time_limit}
        case Behaviour.SPIN:
            return {"target_yaw": _number_of(action, ANGLE), "time_allowance": {"sec": seconds}}
        case _:
            # nav2_behaviors refuses a distance and a speed of different signs, except from BackUp.
            away = -1.0 if settings.behavior is Behaviour.BACK_UP else 1.0
            return {
                "target": {"x": away * _number_of(action, DISTANCE)},
                "speed": away * settings.speed,
                "time_allowance": {"sec": seconds},
            }


def _number_of(action: Action, key: str) -> float:
    value = action.parameter(key)
    return float(value) if isinstance(value, int | float) else math.nan
