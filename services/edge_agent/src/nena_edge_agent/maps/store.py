"""The port to whatever keeps a robot's maps: a folder, or the robot's own map server."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from nena_shared.vda5050.state import Map


class MapRefusedError(Exception):
    """A map cannot be taken, enabled or deleted; the text says why."""


class DuplicateMapError(MapRefusedError):
    """A map of the same id and version is there."""

    def __init__(self, map_id: str, map_version: str) -> None:
        super().__init__(f"the robot holds map '{map_id}' in version '{map_version}' already")


def find(maps: Iterable[Map], map_id: str, map_version: str) -> Map | None:
    """Give the map of that id and version."""
    return next((each for each in maps if (each.map_id, each.map_version) == (map_id, map_version)), None)


class MapStore(Protocol):
    """Keeps maps by mapId and mapVersion; at most one version of each mapId is enabled.

    The methods may take their time; each is called when the one before has ended.
    """

    @property
    def maps(self) -> tuple[Map, ...]:
        """All maps that are ready to be enabled, as the state shows them."""
        ...

    async def install(self, map_id: str, map_version: str, content: bytes) -> None:
        """Keep a new map, DISABLED; it touches no other one.

        Raises:
            MapRefusedError: it is not taken.

        """
        ...

    async def enable(self, map_id: str, map_version: str) -> None:
        """Use this version, and no other one of the same mapId.

        Raises:
            MapRefusedError: it is not there, or cannot be used.

        """
        ...

    async def delete(self, map_id: str, map_version: str) -> None:
        """Forget a map.

        Raises:
            MapRefusedError: it is not there, or enabled.

        """
        ...
