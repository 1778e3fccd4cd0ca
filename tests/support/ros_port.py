"""A ROS port controlled by the test: published messages are stored, and the test sends the others."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any

from pydantic import JsonValue

from nena_edge_agent.actions.plugin import (
    Fields,
    Publisher,
    RosActionClient,
    RosError,
    ServiceClient,
    TopicQos,
)


class ScriptedRos:
    """``services`` has the responses of existing services, ``listeners`` is the number of subscribers."""

    def __init__(self) -> None:
        self.published: list[tuple[str, dict[str, Any]]] = []
        self.called: list[tuple[str, dict[str, Any]]] = []
        self.services: dict[str, Fields] = {}
        self.listeners = 1
        self.active = True
        self.replies: dict[str, Callable[[dict[str, Any]], None]] = {}
        """What happens when something is published on a topic."""
        self._handlers: dict[str, list[Callable[[Fields], None]]] = defaultdict(list)

    def publisher(self, topic: str, type_name: str) -> Publisher:  # noqa: ARG002
        return _Publisher(self, topic)

    def subscribe(
        self,
        topic: str,
        type_name: str,  # noqa: ARG002
        handle: Callable[[Fields], None],
        *,
        qos: TopicQos = TopicQos.RELIABLE,  # noqa: ARG002
    ) -> None:
        self._handlers[topic].append(handle)

    def client(self, service: str, type_name: str) -> ServiceClient:  # noqa: ARG002
        return _Client(self, service)

    def action(self, name: str, type_name: str) -> RosActionClient:  # noqa: ARG002
        return _Action(self, name)

    def say(self, topic: str, **fields: Any) -> None:
        """Deliver a message."""
        for handle in self._handlers[topic]:
            handle(fields)


class _Publisher:
    def __init__(self, ros: ScriptedRos, topic: str) -> None:
        self._ros = ros
        self._topic = topic

    @property
    def listeners(self) -> int:
        return self._ros.listeners

    def publish(self, fields: Mapping[str, JsonValue]) -> None:
        if not self._ros.active:
            message = "the robot's ROS session is not active"
            raise RosError(message)
        self._ros.published.append((self._topic, dict(fields)))
        if reply := self._ros.replies.get(self._topic):
            reply(dict(fields))


class _Action:
    def __init__(self, ros: ScriptedRos, name: str) -> None:
        self._ros = ros
        self._name = name

    async def run(self, fields: Mapping[str, JsonValue]) -> Fields:
        return await _Client(self._ros, self._name).call(fields, seconds=0.0)


class _Client:
    def __init__(self, ros: ScriptedRos, service: str) -> None:
        self._ros = ros
        self._service = service

    async def call(self, fields: Mapping[str, JsonValue], *, seconds: float) -> Fields:  # noqa: ARG002
        self._ros.called.append((self._service, dict(fields)))
        if self._service not in self._ros.services:
            message = f"no node offers the service {self._service}"
            raise RosError(message)
        return self._ros.services[self._service]
