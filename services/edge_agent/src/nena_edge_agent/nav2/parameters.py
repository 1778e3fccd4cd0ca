"""Nav2's parameters for driving and the robot, read from its running servers."""

from __future__ import annotations

import asyncio
import json
import math
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters

from nena_edge_agent.driver.port import DriveLimits
from nena_edge_agent.nav2.session import LateClient, RosSession
from nena_edge_agent.nav2.settings import GOAL_TOLERANCE, RosSettings
from nena_shared.log import get_logger

log = get_logger(__name__)

Value = float | int | str | list[str] | None
Contour = tuple[tuple[float, float], ...]
SPEEDS = ("desired_linear_vel", "vx_max", "max_speed_xy", "max_vel_x")
"""Parameters with the controller's own speed: Regulated Pure Pursuit, MPPI, DWB."""
CORNERS = 16
"""Number of corners of the polygon around a round robot."""


@dataclass(frozen=True, slots=True)
class Nav2Parameters:
    """Metres, radians and milliseconds; None if Nav2 has no such parameter, or does not answer.

    ``approach`` is the distance from a goal at which Regulated Pure Pursuit slows down, ``speed`` the
    controller's own speed in m/s, ``contour`` the robot's outline around its base frame. ``complete``: all
    servers answered.
    """

    xy_tolerance: float | None = None
    yaw_tolerance: float | None = None
    approach: float | None = None
    server_timeout: float | None = None
    speed: float | None = None
    contour: Contour = ()
    complete: bool = True

    def limits(self, tolerance: float | None, known_each: float, map_id: str) -> DriveLimits:
        """Return the resulting limits of a drive; ``tolerance`` replaces that of Nav2.

        ``known_each`` is the distance in m that the robot may drive between two updates of its position.
        """
        within = tolerance or self.xy_tolerance or GOAL_TOLERANCE
        hand_over = max(within, self.approach or 0.0) + known_each
        log.info("Nav2's parameters", tolerance=within, hand_over=hand_over)
        return DriveLimits(within, hand_over, map_id, self.contour, self.yaw_tolerance)


def contour_of(footprint: str, radius: float | None) -> Contour:
    """Return the outline from a costmap's parameters: the polygon, or a circle if there is none."""
    try:
        points = tuple((float(x), float(y)) for x, y in json.loads(footprint or "[]"))
    except (ValueError, TypeError):
        points = ()
    if len(points) >= 3 and all(math.isfinite(x) and math.isfinite(y) for x, y in points):  # noqa: PLR2004
        return points
    if radius is None or not 0 < radius < math.inf:
        return ()
    angles = (number * math.tau / CORNERS for number in range(CORNERS))
    return tuple((round(radius * math.cos(a), 4), round(radius * math.sin(a), 4)) for a in angles)


class ParameterReader:
    """Reads parameters from Nav2's servers; enters a node before all other extensions."""

    def __init__(self, settings: RosSettings) -> None:
        self._settings = settings
        self._answered = True

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Create the clients."""
        names = self._settings.names
        self._controller, self._navigator = (
            session.late_client(node, GetParameters, f"{server}/get_parameters")
            for server in (names.controller, names.navigator)
        )
        self._costmap = session.late_client(node, GetParameters, f"{names.costmap}/get_parameters")

    async def read(self) -> Nav2Parameters:
        """Read all of them; takes at most five timeouts of a call."""
        self._answered = True
        for client in (self._controller, self._navigator, self._costmap):
            client.prepare()  # they search for their servers at the same time
        checker, follower = await asyncio.gather(
            self._read_first(self._controller, "goal_checker_plugins", "general_goal_checker"),
            self._read_first(self._controller, "controller_plugins", "FollowPath"),
        )
        numbers = await asyncio.gather(
            self._read_number(self._controller, f"{checker}.xy_goal_tolerance"),
            self._read_number(self._controller, f"{checker}.yaw_goal_tolerance"),
            self._read_number(self._controller, f"{follower}.approach_velocity_scaling_dist"),
            self._read_number(self._navigator, "default_server_timeout"),
        )
        # get_parameters answers nothing at all if one of the names is unknown.
        speeds = await asyncio.gather(
            *(self._read_number(self._controller, f"{follower}.{name}") for name in SPEEDS)
        )
        speed = next((value for value in speeds if value is not None and value > 0), None)
        # A costmap has both; robot_radius counts only if footprint is "[]", its default (Nav2's setup guide).
        footprint, radius = await asyncio.gather(
            self._read_parameter(self._costmap, "footprint"), self._read_number(self._costmap, "robot_radius")
        )
        contour = contour_of(footprint if isinstance(footprint, str) else "", radius)
        return Nav2Parameters(*numbers, speed=speed, contour=contour, complete=self._answered)

    async def _read_first(self, client: LateClient, name: str, default: str) -> str:
        """Return the first plug-in of a list."""
        value = await self._read_parameter(client, name)
        return value[0] if isinstance(value, list) and value else default

    async def _read_number(self, client: LateClient, name: str) -> float | None:
        value = await self._read_parameter(client, name)
        return float(value) if isinstance(value, int | float) else None

    async def _read_parameter(self, client: LateClient, name: str) -> Value:
        """Read one parameter: asked for several, a server that lacks one of them returns none."""
        request = GetParameters.Request(names=[name])
        answer = await client.call(request, seconds=self._settings.call_timeout)
        self._answered = self._answered and answer is not None
        value = None if answer is None or not answer.values else answer.values[0]
        if value is None:
            return None
        match value.type:
            case ParameterType.PARAMETER_DOUBLE:
                return float(value.double_value)
            case ParameterType.PARAMETER_INTEGER:
                return int(value.integer_value)
            case ParameterType.PARAMETER_STRING:
                return str(value.string_value)
            case ParameterType.PARAMETER_STRING_ARRAY:
                return list(value.string_array_value)
        return None
