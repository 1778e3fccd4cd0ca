"""The maps of a robot whose map_server has the one that is enabled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from nena_edge_agent.extensions.maps.nav2_store import Nav2MapStore
from nena_edge_agent.extensions.maps.store import FolderMapStore, MapRefusedError
from nena_edge_agent.nav2.map_server import MapNotLoadedError, MapServer
from nena_edge_agent.nav2.settings import RosSettings
from nena_shared.vda5050.state import Map, MapStatus
from support.map_archives import attic

FIRST = Map(map_id="hall", map_version="1", map_status=MapStatus.ENABLED)


class Loader(MapServer):
    """A map_server that accepts every map, or none."""

    def __init__(self, map_id: str, file: str, **parts: Any) -> None:
        super().__init__(RosSettings(), map_id, file, **parts)
        self.files: list[str] = []
        self.refuses = ""

    async def use(self, map_id: str, file: str) -> None:
        if self.refuses:
            raise MapNotLoadedError(self.refuses)
        self.files.append(file)
        self.map_id = map_id


class StandingRobot:
    """A driver at standstill."""

    drives = False

    def await_map(self, reason: str) -> None:
        """Start no goal."""

    def use_map(self, map_id: str) -> None:
        """Use another map."""


def store(folder: Path) -> tuple[Nav2MapStore, Loader]:
    """Return a store, and map_server as its driver gets it."""
    maps = Nav2MapStore(folder / "maps", FIRST, maximum=5, make_server=Loader)
    server = maps.make_server_client(StandingRobot())
    assert isinstance(server, Loader)
    return maps, server


def enabled(maps: Nav2MapStore) -> list[str]:
    return [each.map_id for each in maps.maps if each.map_status is MapStatus.ENABLED]


async def test_one_map_is_enabled_and_unpacked(tmp_path: Path) -> None:
    maps, server = store(tmp_path)
    await maps.install("attic", "1", attic())
    assert enabled(maps) == ["hall"]

    await maps.enable("attic", "1")
    assert enabled(maps) == ["attic"]
    assert server.files[-1].endswith("/map.yaml")
    await maps.enable("hall", "1")

    assert enabled(maps) == ["hall"]
    assert server.files[-1] == ""


async def test_the_enabled_map_is_expected_after_a_restart(tmp_path: Path) -> None:
    maps, _ = store(tmp_path)
    await maps.install("attic", "1", attic())
    await maps.enable("attic", "1")

    again, server = store(tmp_path)

    assert enabled(again) == [server.map_id] == ["attic"]
    assert "map_server has not loaded" in server.problem


async def test_a_map_that_map_server_refuses_is_not_enabled(tmp_path: Path) -> None:
    maps, server = store(tmp_path)
    await maps.install("attic", "1", attic())
    server.refuses = "file not found"
    with pytest.raises(MapRefusedError, match="file not found"):
        await maps.enable("attic", "1")
    assert enabled(maps) == ["hall"]


async def test_a_missing_position_on_the_map_is_remembered_after_a_restart(tmp_path: Path) -> None:
    maps, _ = store(tmp_path)
    await maps.install("attic", "1", attic())
    await maps.enable("attic", "1")

    _, server = store(tmp_path)
    assert server.unplaced
    server.record_placed()

    _, last = store(tmp_path)
    assert not last.unplaced


async def test_a_refused_map_keeps_the_position(tmp_path: Path) -> None:
    maps, server = store(tmp_path)
    await maps.install("attic", "1", attic())
    server.refuses = "file not found"
    with pytest.raises(MapRefusedError):
        await maps.enable("attic", "1")
    assert not server.unplaced


async def test_maps_of_a_plain_folder_are_not_loaded_by_map_server(tmp_path: Path) -> None:
    plain = FolderMapStore(tmp_path / "maps", FIRST, maximum=5)
    await plain.install("attic", "1", b"walls")

    maps, server = store(tmp_path)
    assert enabled(maps) == ["hall"]
    with pytest.raises(MapRefusedError, match="delete and download it again"):
        await maps.enable("attic", "1")
    assert (enabled(maps), server.files) == (["hall"], [])


async def test_an_invalid_nav2_map_is_not_installed(tmp_path: Path) -> None:
    maps, _ = store(tmp_path)
    with pytest.raises(MapRefusedError, match="not a readable zip or tar"):
        await maps.install("attic", "1", b"walls")
    assert len(maps.maps) == 1
