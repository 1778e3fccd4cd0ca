"""What Nav2's parameters say of how near it drives to a goal, read from its servers while it runs."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters

from nena_edge_agent.nav2.session import RosSession
from nena_edge_agent.nav2.settings import RosSettings

Value = float | int | str | list[str] | None


@dataclass(frozen=True, slots=True)
class Nav2Parameters:
    """Metres, radians and milliseconds; None where Nav2 has no such parameter, or does not answer.

    ``approach`` is the distance from a goal in which Regulated Pure Pursuit slows down.
    """

    xy_tolerance: float | None = None
    yaw_tolerance: float | None = None
    planner_tolerance: float | None = None
    approach: float | None = None
    server_timeout: float | None = None


class ParameterReader:
    """Asks Nav2's servers for their parameters; enters a node before all else."""

    def __init__(self, settings: RosSettings) -> None:
        self._settings = settings

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Build the clients."""
        names = self._settings.names
        self._session = session
        self._controller, self._planner, self._navigator = (
            node.create_client(GetParameters, f"{server}/get_parameters")
            for server in (names.controller, names.planner, names.navigator)
        )

    async def read(self) -> Nav2Parameters:
        """Ask for all of them; takes at most two time-outs of a call."""
        checker, follower, planner = await asyncio.gather(
            self._first(self._controller, "goal_checker_plugins", "general_goal_checker"),
            self._first(self._controller, "controller_plugins", "FollowPath"),
            self._first(self._planner, "planner_plugins", "GridBased"),
        )
        numbers = await asyncio.gather(
            self._number(self._controller, f"{checker}.xy_goal_tolerance"),
            self._number(self._controller, f"{checker}.yaw_goal_tolerance"),
            self._number(self._planner, f"{planner}.tolerance"),
            self._number(self._controller, f"{follower}.approach_velocity_scaling_dist"),
            self._number(self._navigator, "default_server_timeout"),
        )
        return Nav2Parameters(*numbers)

    async def _first(self, client: Any, name: str, default: str) -> str:  # noqa: ANN401
        """Return the first of a list of plug-ins."""
        value = await self._ask(client, name)
        return value[0] if isinstance(value, list) and value else default

    async def _number(self, client: Any, name: str) -> float | None:  # noqa: ANN401
        value = await self._ask(client, name)
        return float(value) if isinstance(value, int | float) else None

    async def _ask(self, client: Any, name: str) -> Value:  # noqa: ANN401
        """Ask for one parameter: of several, a server with one that it does not know tells none."""
        request = GetParameters.Request(names=[name])
        answer = await self._session.call(client, request, seconds=self._settings.call_timeout)
        found = None if answer is None or not answer.values else answer.values[0]
        if found is None:
            return None
        match found.type:
            case ParameterType.PARAMETER_DOUBLE:
                return float(found.double_value)
            case ParameterType.PARAMETER_INTEGER:
                return int(found.integer_value)
            case ParameterType.PARAMETER_STRING_ARRAY:
                return list(found.string_array_value)
        return None
