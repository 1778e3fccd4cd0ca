"""Under which topics each robot speaks; what a broker has kept from before is told apart (section 4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from nena_shared.vda5050.topics import RobotKey, TopicScheme


@dataclass(frozen=True, slots=True)
class _Source:
    scheme: TopicScheme
    timestamp: datetime | None
    """Of the newest message that the broker had kept; None: the robot is known to speak there."""


class RobotSources:
    """Remembers for each robot the topics that it speaks under.

    A robot that has changed its version or interface name leaves its retained messages under the old topics.
    They say nothing about a robot that speaks elsewhere; while only retained messages are known of it, the
    newest of them decides.
    """

    def __init__(self) -> None:
        self._sources: dict[RobotKey, _Source] = {}

    def expect(self, robot: RobotKey, scheme: TopicScheme) -> None:
        """Know where a robot speaks before it has done so."""
        self._sources[robot] = _Source(scheme, None)

    def accepts(self, robot: RobotKey, scheme: TopicScheme, *, timestamp: datetime, retained: bool) -> bool:
        """Tell whether a message says something of the robot now; later ones are compared with it."""
        known = self._sources.get(robot)
        if known is not None and known.scheme != scheme and retained:
            if known.timestamp is None or timestamp <= known.timestamp:
                return False
        elif known is not None and known.scheme == scheme and (known.timestamp is None or retained):
            return True
        self._sources[robot] = _Source(scheme, timestamp if retained else None)
        return True
