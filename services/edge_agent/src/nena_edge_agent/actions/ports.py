"""What a plug-in may use of the robot: ROS topics and services by the names of their types, and drives.

Both are narrow on purpose: plain data goes in and comes out, nothing blocks, and who needs more of ROS than
this makes a node of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Any, Protocol

from pydantic import JsonValue

from nena_edge_agent.driver.port import Pose

Fields = Mapping[str, Any]
"""A message as plain data: numbers, texts, lists, and tables for messages within it."""


class RosError(Exception):
    """ROS did not do what it was asked; the text says why."""


class DriveError(Exception):
    """A drive of an action did not get there; the text says why."""


class TopicQos(StrEnum):
    """How a topic is listened to."""

    RELIABLE = "reliable"
    """Every message of a publisher that is reliable; nothing of one that is not."""
    BEST_EFFORT = "best_effort"
    """Fits every publisher, as batteries and other sensors often are; a message may be lost."""
    LATCHED = "latched"
    """Also the last message from before, of a publisher that keeps it."""


class Publisher(Protocol):
    """Sends messages of one type on one topic."""

    @property
    def listeners(self) -> int:
        """How many subscriptions there are."""
        ...

    def publish(self, fields: Mapping[str, JsonValue]) -> None:
        """Send a message; fields that are not given have the type's defaults.

        Raises:
            RosError: there is no ROS session now, or the fields do not fit the type.

        """
        ...


class ServiceClient(Protocol):
    """Calls one service."""

    async def call(self, fields: Mapping[str, JsonValue], *, seconds: float) -> Fields:
        """Call it and give the response.

        Raises:
            RosError: there is no ROS session now, nobody offers the service, or nobody answers within
                ``seconds``, or the fields do not fit the type.

        """
        ...


class RosPort(Protocol):
    """ROS in the robot's namespace and domain. What is asked for stays, through every new ROS session."""

    def publisher(self, topic: str, type_name: str) -> Publisher:
        """Give what publishes on ``topic``, reliably.

        Raises:
            RosError: there is no such type here.

        """
        ...

    def subscribe(
        self,
        topic: str,
        type_name: str,
        handle: Callable[[Fields], None],
        *,
        qos: TopicQos = TopicQos.RELIABLE,
    ) -> None:
        """Have ``handle`` called with each message, in the event loop.

        Raises:
            RosError: there is no such type here.

        """
        ...

    def client(self, service: str, type_name: str) -> ServiceClient:
        """Give what calls ``service``.

        Raises:
            RosError: there is no such type here.

        """
        ...


class DrivePort(Protocol):
    """Short drives of an action, while the order holds the robot where it is."""

    @property
    def pose(self) -> Pose | None:
        """Where the robot is, in the plant's frame; None where that cannot be trusted."""
        ...

    async def drive(
        self,
        pose: Pose,
        *,
        deviation_xy: float,
        deviation_theta: float | None = None,
        maximum_speed: float | None = None,
    ) -> None:
        """Drive to ``pose`` (m, rad, m/s); cancelled, it stops the robot first.

        Only for actions of nodes that are HARD or SOFT: with others the order drives too.

        Raises:
            DriveError: it did not get there.

        """
        ...
