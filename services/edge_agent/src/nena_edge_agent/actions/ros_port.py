"""ROS for action plug-ins, on the agent's own node: plain data, and types by name.

Endpoints are kept, and created again on each node of a new session.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeVar
from uuid import uuid4

from pydantic import JsonValue

from nena_edge_agent.actions.messages import (
    FieldError,
    Record,
    UnknownTypeError,
    action_type,
    class_of,
    conform_value,
    make_message,
    message_type,
    read_fields,
    service_type,
)
from nena_edge_agent.actions.plugin import (
    ActionFailedError,
    Fields,
    Publisher,
    RosActionClient,
    RosError,
    ServiceClient,
    TopicQos,
)
from nena_edge_agent.driver.port import SessionState
from nena_edge_agent.nav2.goals import GoalEntry
from nena_edge_agent.nav2.presence import endpoints
from nena_edge_agent.nav2.settings import status_of
from nena_shared.log import get_logger
from nena_shared.ros import GoalStatus

if TYPE_CHECKING:
    from nena_edge_agent.nav2.session import RosSession


log = get_logger(__name__)

MESSAGES_WAITING = 100
"""Maximum number of messages of a topic that wait for the event loop; beyond, the oldest is dropped."""
# Measured: DDS finds a peer within 0.07 s, or 1.65 s if its first announcement is lost.
FOUND_WITHIN = 5.0
"""Timeout for finding a service, seconds."""
LOOK_EVERY = 0.05
"""Seconds between two checks for it."""


ANSWERS_WITHIN = 5.0
"""Timeout for an action server to accept or cancel a goal, seconds."""
LONGEST_GOAL = 86_400.0
"""Timeout for the result of a goal, seconds; actions have their own timeouts."""
ENDS = {GoalStatus.CANCELED: "cancelled", GoalStatus.ABORTED: "aborted"}
"""What a server has done with a goal that did not succeed."""
GLANCE = 0.2
"""Interval between checks of the status array and of the server while a result is awaited, seconds."""
RESULT_WAIT = 2.0
"""Timeout for the result after the status array has listed the end of the goal, or the reverse, seconds."""

THERE = (SessionState.INITIATING, SessionState.ACTIVE)
"""States in which the session has a node."""


class _Endpoint(Protocol):
    def open(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Create the endpoint on this node."""
        ...


E = TypeVar("E", bound=_Endpoint)
T = TypeVar("T")


class PluginRos:
    """The ROS port of one robot; its endpoints live on the agent's node."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._endpoints: list[_Endpoint] = []
        self._subscriptions: dict[tuple[str, str, TopicQos], _Subscription] = {}
        self._session: RosSession | None = None
        self._node: Any = None

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401
        """Create all endpoints on a new node."""
        with self._lock:
            self._session, self._node = session, node
            for endpoint in self._endpoints:
                endpoint.open(session, node)

    def session(self) -> RosSession:
        """Return the session; raises RosError if there is none now."""
        if self._session is None or self._session.state is not SessionState.ACTIVE:
            raise RosError("the robot's ROS session is not active")
        return self._session

    def publisher(self, topic: str, type_name: str) -> Publisher:
        """Return a publisher on ``topic``; raises RosError if there is no such type here."""
        return self._add_endpoint(_Publisher(self, topic, type_name))

    def subscribe(
        self,
        topic: str,
        type_name: str,
        handle: Callable[[Fields], None],
        *,
        qos: TopicQos = TopicQos.RELIABLE,
    ) -> None:
        """Call ``handle`` with each message, in the event loop.

        All subscribers of a topic receive a message at the same time: an answer to one action must not arrive
        late at the next one.

        Raises:
            RosError: the type is not installed here.
        """
        key = (topic, type_name, qos)
        if key not in self._subscriptions:
            self._subscriptions[key] = self._add_endpoint(_Subscription(topic, type_name, qos))
        self._subscriptions[key].join(handle)

    def client(self, service: str, type_name: str) -> ServiceClient:
        """Return a client of ``service``; raises RosError if there is no such type here."""
        return self._add_endpoint(_Client(self, service, type_name))

    def action(self, name: str, type_name: str) -> RosActionClient:
        """Return a client of the action ``name``; raises RosError if the type is not installed here."""
        return self._add_endpoint(_Action(self, name, type_name))

    def _add_endpoint(self, endpoint: E) -> E:
        with self._lock:
            self._endpoints.append(endpoint)
            if self._session is not None and self._session.state in THERE:
                endpoint.open(self._session, self._node)
        return endpoint


class _Publisher:
    def __init__(self, port: PluginRos, topic: str, type_name: str) -> None:
        self._port = port
        self._topic = topic
        self._shape = installed(message_type, type_name)
        self._publisher: Any = None

    def open(self, session: RosSession, node: Any) -> None:  # noqa: ANN401, ARG002
        from nena_edge_agent.nav2.session import RELIABLE  # noqa: PLC0415 - needs rclpy

        self._publisher = node.create_publisher(self._shape.make, self._topic, RELIABLE)

    @property
    def listeners(self) -> int:
        try:
            self._port.session()
        except RosError:
            return 0
        return int(self._publisher.get_subscription_count())

    def publish(self, fields: Mapping[str, JsonValue]) -> None:
        ros_message = _make_message(fields, self._shape, self._topic)
        self._port.session()
        self._publisher.publish(ros_message)


class _Subscription:
    def __init__(self, topic: str, type_name: str, qos: TopicQos) -> None:
        self._topic = topic
        self._kind = installed(class_of, type_name)
        self._qos = qos
        self._handlers: list[Callable[[Fields], None]] = []
        self._last: Fields | None = None

    def join(self, handle: Callable[[Fields], None]) -> None:
        """Add a subscriber; on a latched topic it also receives the last message."""
        self._handlers.append(handle)
        # DDS delivers the latched message once to this subscription, which all actions share.
        if self._last is not None and self._qos is TopicQos.LATCHED:
            self._deliver_fields(handle, self._last)

    def open(self, session: RosSession, node: Any) -> None:  # noqa: ANN401
        from nena_edge_agent.nav2.session import LATCHED, RELIABLE, SENSOR  # noqa: PLC0415 - needs rclpy

        profiles = {
            TopicQos.RELIABLE: RELIABLE,
            TopicQos.BEST_EFFORT: SENSOR,
            TopicQos.LATCHED: LATCHED,
        }
        session.subscribe(
            node,
            self._kind,
            self._topic,
            profiles[self._qos],
            read=read_fields,
            handle=self._on_message,
            limit=MESSAGES_WAITING,
            events=self._qos is not TopicQos.BEST_EFFORT,  # which fits each publisher
        )

    def _on_message(self, fields: Fields) -> None:
        self._last = fields
        for handle in self._handlers:
            self._deliver_fields(handle, fields)

    def _deliver_fields(self, handle: Callable[[Fields], None], fields: Fields) -> None:
        try:
            handle(fields)
        except Exception:
            log.exception("an action plug-in failed to handle a message", topic=self._topic)


class _Client:
    def __init__(self, port: PluginRos, service: str, type_name: str) -> None:
        self._port = port
        self._service = service
        self._kind = installed(class_of, type_name)
        self._request, _ = installed(service_type, type_name)
        self._client: Any = None

    def open(self, session: RosSession, node: Any) -> None:  # noqa: ANN401, ARG002
        self._client = node.create_client(self._kind, self._service)

    async def call(self, fields: Mapping[str, JsonValue], *, seconds: float) -> Fields:
        request = _make_message(fields, self._request, self._service)
        session = self._port.session()
        await _wait_for_server(self._client, f"the service {self._service}", min(FOUND_WITHIN, seconds))
        response = await session.call(self._client, request, seconds=seconds)
        if response is None:
            raise RosError(f"the service {self._service} did not answer within {seconds:g} s")
        return read_fields(response)


# 0024: rclpy's ActionClient chooses the goal's ID itself and has no timeouts; on the wire, both are the same.
class _Action:
    """A ROS action through its hidden services: a goal with our own ID, its result, and its end."""

    def __init__(self, port: PluginRos, name: str, type_name: str) -> None:
        self._port = port
        self._name = name
        self._goal, self._kind = installed(action_type, type_name)
        self._package = type_name.partition("/")[0]
        self._send: Any = None
        self._node: Any = None
        self._statuses: dict[str, GoalStatus] = {}
        """The goals that are awaited, by their IDs, with their last status in the server's array."""

    def open(self, session: RosSession, node: Any) -> None:  # noqa: ANN401
        from action_msgs.msg import GoalStatusArray  # noqa: PLC0415 - needs rclpy
        from action_msgs.srv import CancelGoal  # noqa: PLC0415

        from nena_edge_agent.nav2.messages import status_entries  # noqa: PLC0415
        from nena_edge_agent.nav2.session import LATCHED, STATUS_ARRAYS  # noqa: PLC0415

        services, hidden = self._kind.Impl, f"{self._name}/_action"
        self._node = node
        session.subscribe(
            node,
            GoalStatusArray,
            status_of(self._name),
            LATCHED,
            read=status_entries,
            handle=self._on_statuses,
            limit=STATUS_ARRAYS,
        )
        self._send = node.create_client(services.SendGoalService, f"{hidden}/send_goal")
        self._results = node.create_client(services.GetResultService, f"{hidden}/get_result")
        self._cancel = node.create_client(CancelGoal, f"{hidden}/cancel_goal")

    async def run(self, fields: Mapping[str, JsonValue]) -> Fields:
        goal = _make_message(fields, self._goal, self._name)
        session = self._port.session()
        for client in (self._send, self._results, self._cancel):
            await _wait_for_server(client, f"the action {self._name}", FOUND_WITHIN)
        request = self._kind.Impl.SendGoalService.Request(goal=goal)
        request.goal_id.uuid = list(uuid4().bytes)
        key = bytes(request.goal_id.uuid).hex()
        self._statuses[key] = GoalStatus.UNKNOWN
        try:
            answer = await session.call(self._send, request, seconds=ANSWERS_WITHIN)
            # DDS drops an answer whose reader the server has not discovered yet; the array shows that goal.
            begun = self._statuses[key] is not GoalStatus.UNKNOWN if answer is None else answer.accepted
            if not begun:
                text = "refuses the goal" if answer is not None else "does not answer"
                if answer is None:  # it may accept the goal later, when this action has failed
                    await self._cancel_goal(session, request.goal_id)
                raise RosError(f"the action {self._name} {text}: is its server active?")
            return await self._await_result(session, request.goal_id)
        except asyncio.CancelledError:
            await self._cancel_goal(session, request.goal_id)
            raise
        finally:
            del self._statuses[key]

    async def _await_result(self, session: RosSession, goal_id: Any) -> Fields:  # noqa: ANN401
        try:
            status, answer = await self._await_end(session, goal_id, LONGEST_GOAL)
        except RosError:
            await self._cancel_goal(session, goal_id)
            raise
        result, missing = {} if answer is None else read_fields(answer.result), ""
        if answer is None:
            missing = (
                f"its result did not arrive: compare the version of {self._package} on this computer with "
                "that of the server"
            )
        # Measured (1.3.13): after action_server_result_timeout, a server answers at once with status 0.
        elif answer.status != status:  # its fields are defaults
            result, missing = {}, "the server has dropped its result (action_server_result_timeout)"
        if missing:
            log.warning("no result of a goal", action=self._name, status=status.name, reason=missing)
        if status is GoalStatus.SUCCEEDED:
            return result
        message = f"{self._name} has {ENDS[status]} its goal"
        cancelled = status is GoalStatus.CANCELED
        raise ActionFailedError(f"{message}; {missing}" if missing else message, result, cancelled=cancelled)

    async def _await_end(self, session: RosSession, goal_id: Any, seconds: float) -> tuple[GoalStatus, Any]:  # noqa: ANN401
        """Wait for the end of a goal; return its status, and the answer with its result or None.

        DDS drops an answer silently if its type is defined differently here and there, and a server that
        ends leaves none. So the status array ends a goal as well, and the server is watched.

        Raises:
            RosError: the end is unknown.
        """
        key, servers = bytes(goal_id.uuid).hex(), self._server_endpoints()
        asked = self._kind.Impl.GetResultService.Request(goal_id=goal_id)
        # Once: it is answered at the end only, and a request that is given up keeps waiting at the server.
        call = asyncio.ensure_future(session.call(self._results, asked, seconds=seconds))
        try:
            while not call.done() and not self._statuses[key].terminal:
                await asyncio.wait((call,), timeout=GLANCE)
                seen = self._server_endpoints()
                servers = servers or seen
                # Measured (1.3.13): a killed server seems ready for 20 s; its goals never get a result.
                if seen - servers or (servers and not seen):
                    raise RosError(f"the server of {self._name} has ended or was restarted during the goal")
            await asyncio.wait((call,), timeout=RESULT_WAIT)
            answer = call.result() if call.done() else None
        finally:
            call.cancel()
        if answer is not None and GoalStatus.of(answer.status).terminal:
            return GoalStatus.of(answer.status), answer
        for _ in range(int(RESULT_WAIT / GLANCE)):  # the array may follow an answer without a status
            if self._statuses[key].terminal:
                return self._statuses[key], answer
            await asyncio.sleep(GLANCE)
        raise RosError(
            f"{self._name} has sent no result, and its status array does not show the end of the goal"
        )

    async def _cancel_goal(self, session: RosSession, goal_id: Any) -> None:  # noqa: ANN401
        request = self._cancel.srv_type.Request()
        # Without a stamp: with one, all goals accepted before it would be cancelled too (rcl_action).
        request.goal_info.goal_id = goal_id
        if await session.call(self._cancel, request, seconds=ANSWERS_WITHIN) is None:
            log.warning("a goal was not cancelled: the action server does not answer", action=self._name)
            return
        try:
            await self._await_end(session, goal_id, ANSWERS_WITHIN - RESULT_WAIT)
        except RosError as error:
            text = "a goal was cancelled; its end was not confirmed"
            log.warning(text, action=self._name, reason=str(error))

    def _server_endpoints(self) -> frozenset[str]:
        """Return the endpoint IDs of the status array's publishers.

        Raises:
            RosError: there is no session now.
        """
        self._port.session()
        return endpoints(self._node.get_publishers_info_by_topic(status_of(self._name)))

    def _on_statuses(self, entries: list[GoalEntry]) -> None:
        awaited = (entry for entry in entries if entry.goal_id in self._statuses)
        self._statuses.update({entry.goal_id: entry.status for entry in awaited})


async def _wait_for_server(client: Any, what: str, seconds: float) -> None:  # noqa: ANN401
    for _ in range(int(seconds / LOOK_EVERY)):
        if client.service_is_ready():
            return
        await asyncio.sleep(LOOK_EVERY)
    raise RosError(f"no node offers {what}")


def installed(find: Callable[[str], T], name: str) -> T:
    """Return the ROS type that ``find`` returns for ``name``.

    Raises:
        RosError: the type is not installed.
    """
    try:
        return find(name)
    except UnknownTypeError as error:
        raise RosError(str(error)) from error


def _make_message(fields: Mapping[str, JsonValue], shape: Record, path: str) -> Any:  # noqa: ANN401
    try:
        return make_message(conform_value(dict(fields), shape, path), shape)
    except FieldError as error:
        raise RosError(str(error)) from error
