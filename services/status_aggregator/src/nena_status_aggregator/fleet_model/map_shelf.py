"""Keeps equal maps of several robots once: a fleet in one hall has one map, and its image may be large."""

from __future__ import annotations

from weakref import WeakValueDictionary

from nena_shared.fleet_api.robot_map import RobotMap

ROOM = 64 * 1024 * 1024
"""Bytes of images that are kept; above that a further one is not taken, for anybody may invent robots."""


class MapShelf:
    """Knows the maps that some robot has; one that no robot has any more goes by itself."""

    def __init__(self) -> None:
        self._known: WeakValueDictionary[str, RobotMap] = WeakValueDictionary()

    def shared(self, found: RobotMap) -> RobotMap | None:
        """Give the map that equals ``found`` and is kept already, else ``found``; None: there is no room."""
        known = self._known.get(found.digest)
        if known == found:
            return known
        if sum(len(each.png) for each in self._known.values()) + len(found.png) > ROOM:
            return None
        self._known[found.digest] = found
        return found
