"""Tracks the topics of each robot, to detect retained messages of earlier sessions (section 4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Final, Protocol

from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.topics import RobotKey, TopicScheme

_ENDS: Final = frozenset({ConnectionState.OFFLINE, ConnectionState.CONNECTION_BROKEN})
"""States that end a connection. The broker may publish an old last will long after a new connect."""


class Dated(Protocol):
    """A message with a timestamp."""

    @property
    def timestamp(self) -> datetime:
        """Time of sending, UTC."""


@dataclass(frozen=True, slots=True)
class _Source:
    scheme: TopicScheme
    timestamp: datetime | None
    """Time of the newest retained message; None: confirmed as current by a live message."""


class RobotSources:
    """Tracks for each robot the topics on which it publishes.

    A robot that changes its version or interface name leaves retained messages on its old topics, and perhaps
    a pending last will. They are outdated once the robot publishes elsewhere. While only retained messages
    are known, the newest one is current.
    """

    def __init__(self) -> None:
        self._sources: dict[RobotKey, _Source] = {}

    def expect(self, robot: RobotKey, scheme: TopicScheme) -> None:
        """Set where a robot is expected to publish."""
        self._sources[robot] = _Source(scheme, None)

    def accepts(self, robot: RobotKey, scheme: TopicScheme, message: Dated, *, retained: bool) -> bool:
        """Return whether a message is current for the robot, and remember it for later comparisons."""
        source = self._sources.get(robot)
        if source is not None and source.scheme == scheme and source.timestamp is None:
            return True
        # VDA 5050 3.0, 6.5: a last will has the time of the connect, and comes long after it
        maybe_old = retained or (isinstance(message, Connection) and message.connection_state in _ENDS)
        if source is not None and source.scheme != scheme and maybe_old:
            if source.timestamp is None or message.timestamp <= source.timestamp:
                return False
        elif source is not None and source.scheme == scheme and maybe_old:
            return True
        self._sources[robot] = _Source(scheme, message.timestamp if maybe_old else None)
        return True
