"""The robot's maps where Nav2's map_server uses them: one is enabled at a time, and map_server has it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from pathlib import Path

from nena_edge_agent.map_store import CONTENT, FolderMapStore, MapRefusedError
from nena_edge_agent.nav2.map_bundle import BadBundleError, MapBundle
from nena_edge_agent.nav2.map_server import MapNotLoadedError, MapServer
from nena_shared.vda5050.state import Map

DESCRIPTION = "map.yaml"
CURRENT = "current"


class Nav2MapStore(FolderMapStore):
    """Unpacks each map, and has map_server load the one that is enabled.

    The robot's first map has no files here: it is the one of map_server's own settings.

    Raises:
        StartError: the folder cannot be used.

    """

    def __init__(self, folder: Path, first: Map, *, maximum: int, server: MapServer) -> None:
        self._server = server
        super().__init__(folder, first, maximum=maximum)
        current = next((each for each in self.maps if self._current == (each.map_id, each.map_version)), None)
        if current is not None:
            server.expect(current.map_id, self._file(current.map_id, current.map_version))

    async def install(self, map_id: str, map_version: str, content: bytes) -> None:
        """Keep a new map, DISABLED.

        Raises:
            MapRefusedError: it is no map of Nav2, it is there already, or there is no room.

        """
        try:
            await asyncio.to_thread(MapBundle.of, content)
        except BadBundleError as error:
            raise MapRefusedError(str(error)) from error
        await super().install(map_id, map_version, content)

    async def enable(self, map_id: str, map_version: str) -> None:
        """Have map_server use this map, and no other one.

        Raises:
            MapRefusedError: it is not there, or map_server does not take it.

        """
        self._expect(map_id, map_version)
        try:
            await self._server.use(map_id, self._file(map_id, map_version))
        except MapNotLoadedError as error:
            raise MapRefusedError(str(error)) from error
        await super().enable(map_id, map_version)

    def _files(self, content: bytes) -> Mapping[str, bytes]:
        if not content:
            return {CONTENT: b""}
        bundle = MapBundle.of(content)
        return {DESCRIPTION: bundle.description.encode(), bundle.image_name: bundle.image}

    def _file(self, map_id: str, map_version: str) -> str:
        path = self._place(map_id, map_version) / DESCRIPTION
        return str(path.absolute()) if path.exists() else ""

    @property
    def _current(self) -> tuple[str, str] | None:
        try:
            map_id, map_version = json.loads((self._folder / CURRENT).read_bytes())
        except (OSError, ValueError, TypeError):
            return None
        return str(map_id), str(map_version)

    def _mark(self, map_id: str, map_version: str) -> None:
        self._put(self._folder / CURRENT, json.dumps([map_id, map_version]).encode())

    def _is_enabled(self, map_id: str, map_version: str) -> bool:
        return self._current == (map_id, map_version)
