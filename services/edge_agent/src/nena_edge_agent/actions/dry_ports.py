"""Ports behind which there is no robot: to try a plug-in where nothing may be sent and nothing may drive."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

from pydantic import JsonValue

from nena_edge_agent.actions.message_shape import FieldError, Record, conformed
from nena_edge_agent.actions.message_types import UnknownTypeError, message_type, read, service_type
from nena_edge_agent.actions.ports import Fields, Publisher, RosError, ServiceClient, TopicQos
from nena_edge_agent.driver.port import Pose

DRIVE_TIME = 0.2
"""Seconds of every drive."""


class DryRos:
    """Takes every message that fits its type, and says nothing; services answer that they have succeeded."""

    def publisher(self, topic: str, type_name: str) -> Publisher:
        """Give a publisher to whom one listens.

        Raises:
            RosError: there is no such type here.

        """
        try:
            return _DryPublisher(topic, message_type(type_name))
        except UnknownTypeError as error:
            raise RosError(str(error)) from error

    def subscribe(
        self,
        topic: str,  # noqa: ARG002 - the port's names
        type_name: str,
        handle: Callable[[Fields], None],  # noqa: ARG002
        *,
        qos: TopicQos = TopicQos.RELIABLE,  # noqa: ARG002
    ) -> None:
        """Look at the type; no message will come.

        Raises:
            RosError: there is no such type here.

        """
        try:
            message_type(type_name)
        except UnknownTypeError as error:
            raise RosError(str(error)) from error

    def client(self, service: str, type_name: str) -> ServiceClient:
        """Give a client whose service does nothing.

        Raises:
            RosError: there is no such type here.

        """
        try:
            return _DryClient(service, *service_type(type_name))
        except UnknownTypeError as error:
            raise RosError(str(error)) from error


class DryDrive:
    """Arrives after a moment, wherever it is to go."""

    def __init__(self) -> None:
        self.pose: Pose | None = Pose(0.0, 0.0, 0.0, "map")

    async def drive(
        self,
        pose: Pose,
        *,
        deviation_xy: float,  # noqa: ARG002 - the port's names
        deviation_theta: float | None = None,  # noqa: ARG002
        maximum_speed: float | None = None,  # noqa: ARG002
    ) -> None:
        """Be there."""
        await asyncio.sleep(DRIVE_TIME)
        self.pose = pose


class _DryPublisher:
    listeners = 1

    def __init__(self, topic: str, shape: Record) -> None:
        self._topic = topic
        self._shape = shape

    def publish(self, fields: Mapping[str, JsonValue]) -> None:
        _conform(fields, self._shape, self._topic)


class _DryClient:
    def __init__(self, service: str, request: Record, response: Record) -> None:
        self._service = service
        self._request = request
        self._response = response

    async def call(self, fields: Mapping[str, JsonValue], *, seconds: float) -> Fields:  # noqa: ARG002
        _conform(fields, self._request, self._service)
        await asyncio.sleep(0)
        response = read(self._response.make())
        return response | {"success": True} if "success" in response else response


def _conform(fields: Mapping[str, JsonValue], shape: Record, path: str) -> None:
    try:
        conformed(dict(fields), shape, path)
    except FieldError as error:
        raise RosError(str(error)) from error
