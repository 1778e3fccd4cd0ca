"""The storage of a robot's maps: a folder, Nav2's map_server, or a plug-in."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from shutil import rmtree
from typing import Protocol
from urllib.parse import quote, unquote

from nena_edge_agent.durability import sync_folder
from nena_shared.tasks import StartError
from nena_shared.vda5050.state import Map, MapStatus


class MapRefusedError(Exception):
    """A map cannot be stored, enabled or deleted; the message contains the reason."""


class DuplicateMapError(MapRefusedError):
    """A map with the same ID and version already exists."""

    def __init__(self, map_id: str, map_version: str) -> None:
        super().__init__(f"the robot already has map '{map_id}' in version '{map_version}'")


def find_map(maps: Iterable[Map], map_id: str, map_version: str) -> Map | None:
    """Return the map with this ID and version, None if there is none."""
    return next((item for item in maps if (item.map_id, item.map_version) == (map_id, map_version)), None)


class MapStore(Protocol):
    """Stores maps by mapId and mapVersion; at most one version of each mapId is enabled (3.0 section 6.3).

    Methods may be slow; they are never called concurrently.
    """

    @property
    def maps(self) -> tuple[Map, ...]:
        """Return all maps that can be enabled, as reported in the state."""
        ...

    async def install(self, map_id: str, map_version: str, content: bytes) -> None:
        """Store a new map, DISABLED; other maps stay unchanged.

        Raises:
            MapRefusedError: it is not accepted.
        """
        ...

    async def enable(self, map_id: str, map_version: str) -> None:
        """Enable this version, and disable the other versions of the mapId.

        Raises:
            MapRefusedError: it does not exist, or cannot be used.
        """
        ...

    async def delete(self, map_id: str, map_version: str) -> None:
        """Delete a map; raises MapRefusedError if it does not exist, or is enabled."""
        ...


CONTENT = "map"
ENABLED = "enabled"
UNFINISHED = ".new"


class FolderMapStore:
    """Stores maps unchanged in a folder; raises StartError if the folder cannot be used."""

    def __init__(self, folder: Path, first: Map, *, maximum: int) -> None:
        self._folder = folder.expanduser()
        self._maximum = maximum
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            if not self._read_maps():
                self._mark_enabled(
                    first.map_id, first.map_version
                )  # first, because the mark alone is not a map
                self._write_map(first.map_id, first.map_version, b"")
            self.maps = self._read_maps()
        except OSError as error:
            raise StartError(
                f"the maps' folder {folder} cannot be used: {error.strerror}; set maps.folder"
            ) from error

    async def install(self, map_id: str, map_version: str, content: bytes) -> None:
        """Store a new map, DISABLED.

        Raises:
            MapRefusedError: it already exists, the maximum number of maps is stored, or the disk fails.
        """
        if find_map(self.maps, map_id, map_version):
            raise DuplicateMapError(map_id, map_version)
        # A robot never deletes a map by its own decision (VDA 5050, 6.3; 2.1: 6.7).
        if len(self.maps) >= self._maximum:
            raise MapRefusedError(f"the robot has {self._maximum} maps; delete one first")
        try:
            await asyncio.to_thread(self._write_map, map_id, map_version, content)
        except OSError as error:
            raise MapRefusedError(f"the map was not written: {error.strerror}") from error
        self.maps = self._read_maps()

    async def enable(self, map_id: str, map_version: str) -> None:
        """Enable this version, and disable the other versions of the mapId.

        Raises:
            MapRefusedError: it does not exist.
        """
        self._require_map(map_id, map_version)
        self._mark_enabled(map_id, map_version)
        self.maps = self._read_maps()

    async def delete(self, map_id: str, map_version: str) -> None:
        """Delete a map; raises MapRefusedError if it does not exist, or is enabled."""
        # deleteMap is FAILED if the map is in use (6.2.3; 2.1: 6.8).
        if self._require_map(map_id, map_version).map_status is MapStatus.ENABLED:
            raise MapRefusedError(
                f"map '{map_id}' is enabled in version '{map_version}'; enable another version first"
            )
        await asyncio.to_thread(self._remove_map, map_id, map_version)
        self.maps = self._read_maps()

    def content(self, map_id: str, map_version: str) -> bytes:
        """Return the installed content; empty for the robot's first map."""
        return (self._map_folder(map_id, map_version) / CONTENT).read_bytes()

    def _require_map(self, map_id: str, map_version: str) -> Map:
        stored = find_map(self.maps, map_id, map_version)
        if stored is None:
            raise MapRefusedError(f"the robot has no map '{map_id}' in version '{map_version}'")
        return stored

    def _map_folder(self, map_id: str, map_version: str) -> Path:
        return self._folder / _folder_name(map_id) / _folder_name(map_version)

    def _write_map(self, map_id: str, map_version: str, content: bytes) -> None:
        """Write the map atomically."""
        place = self._map_folder(map_id, map_version)
        unfinished = _temporary_path(place)
        rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir(parents=True)
        for name, part in self._files_of(content).items():
            _write_through(unfinished / name, part)
        sync_folder(unfinished)
        # Only once the content is on disk: after a power failure, a listed map must not be empty.
        unfinished.rename(place)
        sync_folder(place.parent)
        sync_folder(self._folder)

    def _files_of(self, content: bytes) -> Mapping[str, bytes]:
        """Return the files to store for a map, by name."""
        return {CONTENT: content}

    def _remove_map(self, map_id: str, map_version: str) -> None:
        """Remove the map atomically, then delete its files."""
        place = self._map_folder(map_id, map_version)
        unfinished = _temporary_path(place)
        rmtree(unfinished, ignore_errors=True)
        place.rename(unfinished)
        sync_folder(place.parent)
        rmtree(unfinished)

    def _mark_enabled(self, map_id: str, map_version: str) -> None:
        self._write_file(self._folder / _folder_name(map_id) / ENABLED, map_version.encode())

    def _write_file(self, path: Path, content: bytes) -> None:
        """Write a small file atomically."""
        path.parent.mkdir(exist_ok=True)
        new = _temporary_path(path)
        _write_through(new, content)
        new.replace(path)
        sync_folder(path.parent)

    def _is_enabled(self, map_id: str, map_version: str) -> bool:
        mark = self._folder / _folder_name(map_id) / ENABLED
        return mark.exists() and mark.read_bytes() == map_version.encode()

    def _read_maps(self) -> tuple[Map, ...]:
        maps = []
        for area in sorted(self._folder.glob("=*")):
            for version in sorted(area.glob("=*")):
                # Left over when a write or a removal was interrupted: neither is a map.
                if version.name.endswith(UNFINISHED):
                    continue
                map_id, map_version = unquote(area.name[1:]), unquote(version.name[1:])
                enabled = self._is_enabled(map_id, map_version)
                status = MapStatus.ENABLED if enabled else MapStatus.DISABLED
                maps.append(Map(map_id=map_id, map_version=map_version, map_status=status))
        return tuple(maps)


def _temporary_path(place: Path) -> Path:
    """Return the temporary path for writing or removing ``place``."""
    return place.with_name(place.name + UNFINISHED)


def _write_through(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _folder_name(text: str) -> str:
    """Return the name of a folder; the leading ``=`` rules out relative paths and our own files."""
    return "=" + quote(text, safe=" ").replace(".", "%2E")
