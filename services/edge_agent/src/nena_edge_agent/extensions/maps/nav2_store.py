"""The map store for Nav2's map_server: one map is enabled at a time, and map_server loads it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from nena_edge_agent.extensions.maps.store import CONTENT, FolderMapStore, MapRefusedError, find_map
from nena_edge_agent.nav2.map_server import MapNotLoadedError, MapServer, MapUser
from nena_shared.tasks import StartError
from nena_shared.vda5050.state import Map

if TYPE_CHECKING:
    from nena_edge_agent.extensions.maps.bundle import MapBundle

DESCRIPTION = "map.yaml"
CURRENT = "current"
UNPLACED = "unplaced"


MakeServer = Callable[..., MapServer]
"""Makes map_server's client, given map ID, file, mark and user as :class:`MapServer` has them."""


class Nav2MapStore(FolderMapStore):
    """Unpacks maps, and makes map_server load the enabled one.

    The robot's first map has no files here: it is the map in map_server's own settings.

    Raises:
        StartError: the folder cannot be used.
    """

    def __init__(self, folder: Path, first: Map, *, maximum: int, make_server: MakeServer) -> None:
        self._make_server = make_server
        self._first_id = first.map_id
        self._server: MapServer | None = None
        super().__init__(folder, first, maximum=maximum)
        if self._current_map is None and find_map(self.maps, first.map_id, first.map_version):
            self._mark_first(first)  # the folder is from another store

    @property
    def map_id(self) -> str:
        """Return the map that map_server has, or is loading."""
        return self._server.map_id if self._server else self._enabled_map()[0]

    def make_server_client(self, user: MapUser) -> MapServer:
        """Return map_server for a new driver of the robot, which expects the enabled map."""
        map_id, file = self._enabled_map()
        self._server = self._make_server(map_id, file, mark=self._folder / UNPLACED, user=user)
        return self._server

    def _enabled_map(self) -> tuple[str, str]:
        """Return the ID and the file of the enabled map; the robot's first map has no file here."""
        current = next(
            (item for item in self.maps if self._current_map == (item.map_id, item.map_version)), None
        )
        if current is None:
            return self._first_id, ""
        return current.map_id, self._description_file(current.map_id, current.map_version)

    async def install(self, map_id: str, map_version: str, content: bytes) -> None:
        """Store a new map, DISABLED.

        Raises:
            MapRefusedError: it is not a Nav2 map, it already exists, the maximum number of maps is stored, or
                the disk fails.
        """
        await asyncio.to_thread(_read_bundle, content)
        await super().install(map_id, map_version, content)

    async def enable(self, map_id: str, map_version: str) -> None:
        """Make map_server load this map, and mark it as enabled.

        Raises:
            MapRefusedError: it is not stored, or map_server does not accept it.
        """
        self._require_map(map_id, map_version)
        if self._is_foreign(map_id, map_version):
            raise MapRefusedError(
                f"map '{map_id}' in version '{map_version}' was not stored for map_server: delete and "
                "download it again"
            )
        server = self._server
        if server is None:
            raise MapRefusedError("the robot has not started yet")
        placed = not server.unplaced
        try:
            if map_id != server.map_id:
                self._write_file(
                    self._folder / UNPLACED, b""
                )  # first, because a restart may happen at any time
            await server.use(map_id, self._description_file(map_id, map_version))
        except MapNotLoadedError as error:
            if placed:
                server.record_placed()
            raise MapRefusedError(str(error)) from error
        except OSError as error:
            raise MapRefusedError(f"the map was not enabled: {error.strerror}") from error
        # Only now: a map that map_server has refused must not be enabled after a restart.
        await super().enable(map_id, map_version)

    def _files_of(self, content: bytes) -> Mapping[str, bytes]:
        if not content:
            return {CONTENT: b""}
        bundle = _read_bundle(content)
        return {DESCRIPTION: bundle.description.encode(), bundle.image_name: bundle.image}

    def _mark_first(self, first: Map) -> None:
        try:
            self._mark_enabled(first.map_id, first.map_version)
        except OSError as error:
            raise StartError(
                f"the maps' folder {self._folder} cannot be used: {error.strerror}; set maps.folder"
            ) from error
        self.maps = self._read_maps()

    def _is_foreign(self, map_id: str, map_version: str) -> bool:
        """Return whether another store has written this map: it has content but no description."""
        place = self._map_folder(map_id, map_version)
        content = place / CONTENT
        return not (place / DESCRIPTION).exists() and content.exists() and content.stat().st_size > 0

    def _description_file(self, map_id: str, map_version: str) -> str:
        path = self._map_folder(map_id, map_version) / DESCRIPTION
        return str(path.absolute()) if path.exists() else ""

    @property
    def _current_map(self) -> tuple[str, str] | None:
        try:
            map_id, map_version = json.loads((self._folder / CURRENT).read_bytes())
        except (OSError, ValueError, TypeError):
            return None
        return str(map_id), str(map_version)

    def _mark_enabled(self, map_id: str, map_version: str) -> None:
        self._write_file(self._folder / CURRENT, json.dumps([map_id, map_version]).encode())

    def _is_enabled(self, map_id: str, map_version: str) -> bool:
        return self._current_map == (map_id, map_version)


def _read_bundle(content: bytes) -> MapBundle:
    """Read an archive; the modules for archives are only imported when needed.

    Raises:
        MapRefusedError: it is not a Nav2 map.
    """
    from nena_edge_agent.extensions.maps.bundle import BadBundleError, MapBundle  # noqa: PLC0415 - see the docstring

    try:
        return MapBundle.of(content)
    except BadBundleError as error:
        raise MapRefusedError(str(error)) from error
