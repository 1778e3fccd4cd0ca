"""Topics of each robot; retained messages of earlier sessions are recognised (section 4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Final, Protocol

from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.topics import RobotKey, TopicScheme

FAREWELLS: Final = frozenset({ConnectionState.OFFLINE, ConnectionState.CONNECTION_BROKEN})
"""What ends a connection. The broker may publish the will of an old one long after the new one is up."""


class Dated(Protocol):
    """A message with the time when it was sent."""

    @property
    def timestamp(self) -> datetime:
        """In UTC."""


@dataclass(frozen=True, slots=True)
class _Source:
    scheme: TopicScheme
    timestamp: datetime | None
    """Time of the newest retained message; None: the robot is known to publish there."""


class RobotSources:
    """Remembers for each robot the topics on which it publishes.

    A robot that has changed its version or interface name leaves its retained messages under the old topics,
    and maybe a last will that is still to arrive. They are outdated once the robot publishes elsewhere; while
    only such messages are known of it, the newest of them decides.
    """

    def __init__(self) -> None:
        self._sources: dict[RobotKey, _Source] = {}

    def expect(self, robot: RobotKey, scheme: TopicScheme) -> None:
        """Set where a robot is expected to publish."""
        self._sources[robot] = _Source(scheme, None)

    def accepts(self, robot: RobotKey, scheme: TopicScheme, message: Dated, *, retained: bool) -> bool:
        """Return whether a message is current for the robot; later ones are compared with it."""
        known = self._sources.get(robot)
        if known is not None and known.scheme == scheme and known.timestamp is None:
            return True
        of_another_time = retained or _is_farewell(message)
        if known is not None and known.scheme != scheme and of_another_time:
            if known.timestamp is None or message.timestamp <= known.timestamp:
                return False
        elif known is not None and known.scheme == scheme and of_another_time:
            return True
        self._sources[robot] = _Source(scheme, message.timestamp if of_another_time else None)
        return True


def _is_farewell(message: Dated) -> bool:
    return isinstance(message, Connection) and message.connection_state in FAREWELLS
