"""The endpoints that every process of Nav2 has: lifecycle and parameters.

The endpoints of a process that dies disappear; those of a process that hangs stay and answer nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, Protocol

from lifecycle_msgs.msg import TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

from nena_robot_simulator import faults
from nena_robot_simulator.robot import Robot
from nena_robot_simulator.servers import MANAGED, Change, Server, Value
from nena_robot_simulator.session import RosSession
from nena_shared.log import get_logger
from nena_shared.ros import interface

log = get_logger(__name__)

EVENTS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)

Answer = Callable[[Any], None]
Open = Callable[[], Iterable[Any]]
"""Creates the endpoints for a server's own work."""


class Changes(Protocol):
    """Executes what clients request of the lifecycle services."""

    def change(self, server: Server, transition: int) -> bool:
        """Execute a transition; return False if the server's state does not allow it."""
        ...

    def manage(self, manager: Server, command: int) -> bool:
        """Execute a command to a lifecycle manager; return whether all servers have done it."""
        ...


class ServerEndpoints:
    """The endpoints of all servers but the navigator's actions; closed initially.

    ``work`` makes those of a server's own work, which it has once it is configured; ``values`` are the
    parameters.
    """

    def __init__(
        self,
        session: RosSession,
        robot: Robot,
        *,
        work: Mapping[Server, Open],
        values: Mapping[Server, Mapping[str, Value]],
        changes: Changes,
    ) -> None:
        self._session = session
        self._robot = robot
        self._work = work
        self._values = values
        self._changes = changes
        self._open: dict[Server, list[Any]] = {}
        self._working: dict[Server, list[Any]] = {}
        self._events: dict[Server, Any] = {}

    def show(self) -> None:
        """Make each server join or leave the ROS graph, and publish its transitions."""
        servers = self._robot.servers
        for server in Server:
            # A killed process stays in the graph until its DDS lease ends; its services look ready.
            if servers.listed(server):
                continue
            self._keep_endpoints(
                self._open, server, there=servers.there(server), of=partial(self._common_services, server)
            )
            work = self._work.get(server)
            if work is not None:
                self._keep_endpoints(self._working, server, there=servers.configured(server), of=work)
        for change in servers.take_changes():
            self._publish_transition(change)

    def _keep_endpoints(
        self, found: dict[Server, list[Any]], server: Server, *, there: bool, of: Open
    ) -> None:
        if there and server not in found:
            found[server] = list(of())
        elif not there and server in found:
            for entity in found.pop(server):
                self._session.destroy(entity)

    def serve(self, server: Server, kind: Any, name: str, callback: Callable[[Any, Any], None]) -> Any:  # noqa: ANN401
        """Serve a service of a server; it does not answer while the server hangs."""

        def answer_if_awake(request: Any, answer: Answer) -> None:  # noqa: ANN401
            if self._robot.servers.runs(server):
                response = kind.Response()
                callback(request, response)
                answer(response)

        return self._session.serve_later(kind, name, answer_if_awake)

    def _common_services(self, server: Server) -> list[Any]:
        if server in MANAGED:
            return self._manager_services(server)

        def change(request: ChangeState.Request, response: ChangeState.Response) -> None:
            response.success = self._changes.change(server, request.transition.id)

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

    def _manager_services(self, manager: Server) -> list[Any]:
        def awake() -> bool:
            # Measured: during the bring-up is_active exists, but does not answer.
            return self._robot.servers.runs(manager) and not self._robot.faults.on(faults.BringUp)

        def respond(_request: Trigger.Request, answer: Answer) -> None:
            if awake():
                answer(Trigger.Response(success=self._robot.servers.group_active(manager)))

        def manage(request: Any, answer: Answer) -> None:  # noqa: ANN401
            if awake():
                answer(kind.Response(success=self._changes.manage(manager, request.command)))

        kind: Any = interface("nav2_msgs/srv/ManageLifecycleNodes")
        found = [self._session.serve_later(Trigger, f"{manager}/is_active", respond)]
        if kind is not None:
            found.append(self._session.serve_later(kind, f"{manager}/manage_nodes", manage))
        return found

    def _answer_state(self, server: Server, response: GetState.Response) -> None:
        state = self._robot.servers.state(server)
        response.current_state.id, response.current_state.label = int(state), state.name.lower()

    def _publish_transition(self, change: Change) -> None:
        before, after = change.before, change.after
        log.info("lifecycle", server=change.server.value, before=before.name, after=after.name)
        event = TransitionEvent()
        event.transition.id = change.transition
        event.start_state.id, event.start_state.label = int(before), before.name.lower()
        event.goal_state.id, event.goal_state.label = int(after), after.name.lower()
        if change.server in self._open:
            self._events[change.server].publish(event)


def _answer_parameters(
    values: Mapping[str, Value], request: GetParameters.Request, response: GetParameters.Response
) -> None:
    """Return the requested parameters; like rclcpp, none at all if one of them does not exist."""
    if all(name in values for name in request.names):
        response.values = [_parameter_value(values[name]) for name in request.names]


def _parameter_value(value: Value) -> ParameterValue:
    match value:
        # Before int, because a bool is one.
        case bool():
            return ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value)
        case int():
            return ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value)
        case float():
            return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        case str():
            return ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)
    return ParameterValue(type=ParameterType.PARAMETER_STRING_ARRAY, string_array_value=value)
