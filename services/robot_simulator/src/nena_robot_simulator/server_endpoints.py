"""The endpoints that every process of Nav2 has: lifecycle and parameters.

The endpoints of a process that dies disappear; those of a process that hangs stay and answer nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from lifecycle_msgs.msg import TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

from nena_robot_simulator import faults
from nena_robot_simulator.robot import Robot
from nena_robot_simulator.servers import MANAGED, Server, Value
from nena_robot_simulator.session import RosSession
from nena_shared.log import get_logger

log = get_logger(__name__)

EVENTS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)

Answer = Callable[[Any], None]
Open = Callable[[], Iterable[Any]]
"""Creates the endpoints for a server's own work."""


class ServerEndpoints:
    """The endpoints of all servers but the navigator's actions; closed initially.

    ``work`` creates those of each server's own work, ``values`` are the parameters. ``on_change`` is called
    after a transition of a server's lifecycle.
    """

    def __init__(
        self,
        session: RosSession,
        robot: Robot,
        *,
        work: Mapping[Server, Open],
        values: Mapping[Server, Mapping[str, Value]],
        on_change: Callable[[], None],
    ) -> None:
        self._session = session
        self._robot = robot
        self._work = work
        self._values = values
        self._on_change = on_change
        self._open: dict[Server, list[Any]] = {}
        self._events: dict[Server, Any] = {}

    def show(self) -> None:
        """Make each server join or leave the ROS graph, depending on whether it runs."""
        for server in Server:
            there = self._robot.servers.there(server)
            if there and server not in self._open:
                self._open[server] = [*self._common(server), *self._work.get(server, tuple)()]
            elif not there and server in self._open:
                for entity in self._open.pop(server):
                    self._session.destroy(entity)

    def serve(self, server: Server, kind: Any, name: str, callback: Callable[[Any, Any], None]) -> Any:  # noqa: ANN401
        """Serve a service of a server; it does not answer while the server hangs."""

        def answer_if_awake(request: Any, answer: Answer) -> None:  # noqa: ANN401
            if self._robot.servers.runs(server):
                response = kind.Response()
                callback(request, response)
                answer(response)

        return self._session.serve_later(kind, name, answer_if_awake)

    def _common(self, server: Server) -> list[Any]:
        if server in MANAGED:
            return [self._manager(server)]

        def change(request: ChangeState.Request, response: ChangeState.Response) -> None:
            self._change(server, request, response)

        events = self._events[server] = self._session.publisher(
            TransitionEvent, f"{server}/transition_event", EVENTS
        )
        found = [
            events,
            self.serve(server, GetState, f"{server}/get_state", lambda _, to: self._answer_state(server, to)),
            self.serve(server, ChangeState, f"{server}/change_state", change),
        ]
        if values := self._values.get(server):
            name = f"{server}/get_parameters"
            found.append(
                self.serve(server, GetParameters, name, lambda of, to: _answer_parameters(values, of, to))
            )
        return found

    def _manager(self, manager: Server) -> Any:  # noqa: ANN401
        def respond(_request: Trigger.Request, answer: Answer) -> None:
            awake = self._robot.servers.runs(manager) and not self._robot.faults.on(faults.BringUp)
            if awake:
                answer(Trigger.Response(success=self._robot.servers.group_active(manager)))

        return self._session.serve_later(Trigger, f"{manager}/is_active", respond)

    def _answer_state(self, server: Server, response: GetState.Response) -> None:
        state = self._robot.servers.state(server)
        response.current_state.id, response.current_state.label = int(state), state.name.lower()

    def _change(self, server: Server, request: ChangeState.Request, response: ChangeState.Response) -> None:
        before = self._robot.servers.state(server)
        response.success = self._robot.servers.change(server, request.transition.id)
        if not response.success:
            return
        after = self._robot.servers.state(server)
        log.info("lifecycle", server=server.value, before=before.name, after=after.name)
        event = TransitionEvent()
        event.transition.id = request.transition.id
        event.start_state.id, event.start_state.label = int(before), before.name.lower()
        event.goal_state.id, event.goal_state.label = int(after), after.name.lower()
        self._events[server].publish(event)
        self._on_change()


def _answer_parameters(
    values: Mapping[str, Value], request: GetParameters.Request, response: GetParameters.Response
) -> None:
    """Return the requested parameters; like rclcpp, none at all if one of them does not exist."""
    if all(name in values for name in request.names):
        response.values = [_parameter(values[name]) for name in request.names]


def _parameter(value: Value) -> ParameterValue:
    match value:
        case bool():
            return ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value)
        case int():
            return ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value)
        case float():
            return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        case str():
            return ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)
    return ParameterValue(type=ParameterType.PARAMETER_STRING_ARRAY, string_array_value=value)
