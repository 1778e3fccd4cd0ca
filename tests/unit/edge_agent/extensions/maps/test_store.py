"""Maps in a folder."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from nena_edge_agent.extension import Core
from nena_edge_agent.extensions.maps import Maps, MapSettings
from nena_edge_agent.extensions.maps.store import DuplicateMapError, FolderMapStore, MapRefusedError
from nena_edge_agent.protocol.events import MapsReport
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import StartError
from nena_shared.vda5050.state import Map, MapStatus
from nena_shared.vda5050.topics import RobotKey
from support.clocks import ManualClock
from support.edge_agent import make_robot

pytestmark = pytest.mark.clause("6.3")

FIRST = Map(map_id="hall", map_version="1", map_status=MapStatus.ENABLED)


def store(folder: Path, *, maximum: int = 5) -> FolderMapStore:
    return FolderMapStore(folder / "maps", FIRST, maximum=maximum)


def files_of(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def _interrupted(*_: object) -> None:
    raise KeyboardInterrupt


def _interrupted_at_a_file(folder: Path, *, ignore_errors: bool = False) -> None:
    """Delete one file of ``folder``, and no more."""
    if not ignore_errors:
        (folder / "map").unlink()
        message = "interrupted"
        raise OSError(message)


def held(maps: FolderMapStore) -> dict[tuple[str, str], str]:
    return {(each.map_id, each.map_version): each.map_status.value for each in maps.maps}


def test_the_configured_map_is_stored_and_enabled(tmp_path: Path) -> None:
    assert held(store(tmp_path)) == {("hall", "1"): "ENABLED"}


async def test_a_new_map_is_disabled_and_leaves_the_others_unchanged(tmp_path: Path) -> None:
    maps = store(tmp_path)

    await maps.install("hall", "2", b"picture")

    assert held(maps) == {("hall", "1"): "ENABLED", ("hall", "2"): "DISABLED"}
    assert maps.content("hall", "2") == b"picture"


async def test_only_one_version_of_a_map_is_enabled(tmp_path: Path) -> None:
    maps = store(tmp_path)
    await maps.install("hall", "2", b"")
    await maps.install("attic", "1", b"")

    await maps.enable("hall", "2")
    await maps.enable("attic", "1")

    assert held(maps) == {("attic", "1"): "ENABLED", ("hall", "1"): "DISABLED", ("hall", "2"): "ENABLED"}


async def test_everything_is_restored_after_a_restart(tmp_path: Path) -> None:
    maps = store(tmp_path)
    await maps.install("hall", "2", b"")
    await maps.enable("hall", "2")

    assert held(store(tmp_path)) == held(maps)


async def test_an_enabled_map_is_not_deleted(tmp_path: Path) -> None:
    maps = store(tmp_path)
    await maps.install("hall", "2", b"")

    with pytest.raises(MapRefusedError, match="is enabled"):
        await maps.delete("hall", "1")
    await maps.delete("hall", "2")

    assert held(store(tmp_path)) == {("hall", "1"): "ENABLED"}


async def test_an_existing_map_is_not_installed_again(tmp_path: Path) -> None:
    maps = store(tmp_path)

    with pytest.raises(DuplicateMapError):
        await maps.install("hall", "1", b"another")


async def test_a_missing_map_is_neither_enabled_nor_deleted(tmp_path: Path) -> None:
    maps = store(tmp_path)

    for change in (maps.enable, maps.delete):
        with pytest.raises(MapRefusedError, match="no map 'hall' in version '9'"):
            await change("hall", "9")


async def test_the_number_of_maps_is_limited(tmp_path: Path) -> None:
    maps = store(tmp_path, maximum=2)
    await maps.install("hall", "2", b"")

    with pytest.raises(MapRefusedError, match="has 2 maps"):
        await maps.install("hall", "3", b"")


@pytest.mark.parametrize(
    "name", ["../../up", "..", "", "a/b", "=x", "enabled", "x.new", "ü ß", "1\r\n", "a" * 60]
)
async def test_names_cannot_leave_the_folder(tmp_path: Path, name: str) -> None:
    maps = store(tmp_path)

    await maps.install(name, name, b"content")
    await maps.enable(name, name)

    assert held(store(tmp_path))[name, name] == "ENABLED"
    assert files_of(tmp_path) == ["maps"]


async def test_a_partly_written_map_is_not_listed(tmp_path: Path) -> None:
    maps = store(tmp_path)
    half = next((tmp_path / "maps").iterdir()) / "=2.new"
    half.mkdir()
    (half / "map").write_bytes(b"half")

    assert held(store(tmp_path)) == {("hall", "1"): "ENABLED"}
    await maps.install("hall", "2", b"whole")
    assert maps.content("hall", "2") == b"whole"


def test_the_configured_map_is_enabled_after_an_interrupted_first_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for step in ("_write_map", "_mark_enabled"):
        with monkeypatch.context() as interrupted:
            interrupted.setattr(FolderMapStore, step, _interrupted)
            with pytest.raises(KeyboardInterrupt):
                store(tmp_path / step)

        assert held(store(tmp_path / step)) == {("hall", "1"): "ENABLED"}


async def test_a_partly_deleted_map_is_not_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    maps = store(tmp_path)
    await maps.install("hall", "2", b"picture")
    monkeypatch.setattr("nena_edge_agent.extensions.maps.store.rmtree", _interrupted_at_a_file)

    with pytest.raises(OSError, match="interrupted"):
        await maps.delete("hall", "2")

    assert held(store(tmp_path)) == {("hall", "1"): "ENABLED"}


async def test_a_power_failure_takes_back_nothing_that_was_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A new name in a folder is on disk only once the folder is synced."""
    unsynced: set[Path] = set()
    rename, replace, sync = Path.rename, Path.replace, os.fsync

    def note(do: Callable[[Path, Path], Path]) -> Callable[[Path, Path], Path]:
        def renamed(path: Path, target: Path) -> Path:
            unsynced.update((path.parent, target.parent))
            return do(path, target)

        return renamed

    def synced(handle: int) -> None:
        unsynced.discard(Path(f"/proc/self/fd/{handle}").readlink())
        sync(handle)

    monkeypatch.setattr(Path, "rename", note(rename))
    monkeypatch.setattr(Path, "replace", note(replace))
    monkeypatch.setattr(os, "fsync", synced)
    maps = store(tmp_path)
    assert not unsynced
    await maps.install("yard", "2", b"content")
    assert not unsynced
    await maps.enable("yard", "2")
    assert not unsynced
    await maps.install("yard", "3", b"content")
    await maps.delete("yard", "3")
    assert not unsynced


def test_foreign_files_in_the_folder_are_not_maps(tmp_path: Path) -> None:
    store(tmp_path)
    (tmp_path / "maps" / "lost+found").mkdir()
    (tmp_path / "maps" / ".DS_Store").write_text("")

    assert held(store(tmp_path)) == {("hall", "1"): "ENABLED"}


def test_a_damaged_enabled_file_enables_nothing(tmp_path: Path) -> None:
    store(tmp_path)
    next((tmp_path / "maps").glob("*/enabled")).write_bytes(b"\xff")

    assert held(store(tmp_path)) == {("hall", "1"): "DISABLED"}


def test_an_unusable_folder_is_reported_at_the_start(tmp_path: Path) -> None:
    (tmp_path / "maps").write_text("a file")

    with pytest.raises(StartError, match=r"maps\.folder"):
        store(tmp_path)


def robots_maps(*names: str, **settings: object) -> list[tuple[Map, ...]]:
    """Return the maps that each robot reports at its start."""
    agent = EdgeAgentSettings.model_validate({"map_id": "hall", "map_version": "7", "driver": "loopback"})
    robots = tuple(make_robot(RobotKey("ACME", name)) for name in names)
    maps = Maps(MapSettings.model_validate(settings), Core(agent, ManualClock(), robots))
    reports = [report for robot in robots for report in maps.on_start(robot)]
    return [report.maps for report in reports if isinstance(report, MapsReport)]


def test_a_robot_has_a_single_map_by_default() -> None:
    assert robots_maps("r.1") == []


def test_each_robot_has_its_own_folder(tmp_path: Path) -> None:
    first, second = robots_maps("r.1", "r2", store="folder", folder=tmp_path)

    assert first == second
    assert [(each.map_id, each.map_version) for each in first] == [("hall", "7")]
    assert len(list(tmp_path.iterdir())) == 2


def test_a_map_plug_in_that_is_not_installed_is_a_settings_error() -> None:
    with pytest.raises(ConfigurationError, match=r"nena\.maps"):
        robots_maps("r.1", store="acme_map_server")
