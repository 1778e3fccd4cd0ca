"""Folders of recordings: complete files only, within their limits."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import pytest

from nena_shared.extensions.black_box.folder import FILE_NAME, OutgoingFolder, name_of


def add(folder: OutgoingFolder, number: int, size: int = 10) -> str:
    name = f"{number:03d}.mcap"
    path = folder.add(name, partial(Path.write_bytes, data=bytes(size)))
    os.utime(path, (number, number))
    return name


def names(folder: OutgoingFolder) -> list[str]:
    return [each.path.name for each in folder.waiting()]


def test_names_sort_by_time_and_say_why() -> None:
    name = name_of(datetime(2026, 1, 2, 3, 4, 5, 678_900, tzinfo=UTC), "drive-failed")

    assert name == "20260102T030405.678Z-drive-failed.mcap"
    assert FILE_NAME.fullmatch(name)


@pytest.mark.parametrize(
    "name", ["../x.mcap", ".x.mcap", "a/b.mcap", "x.mcap\n", "x.toml", "x.mcap.part", ""]
)
def test_other_names_are_invalid(name: str) -> None:
    assert not FILE_NAME.fullmatch(name)


def test_the_oldest_files_go_and_sent_ones_first(tmp_path: Path) -> None:
    folder = OutgoingFolder(tmp_path, keep=3, keep_bytes=10_000)
    for number in (1, 2, 3):
        add(folder, number)
    folder.mark_sent("003.mcap")

    add(folder, 4)
    assert names(folder) == ["001.mcap", "002.mcap", "004.mcap"]
    add(folder, 5)
    assert names(folder) == ["002.mcap", "004.mcap", "005.mcap"]
    assert not list((tmp_path / "sent").iterdir())


def test_the_size_of_all_files_is_limited_but_the_newest_stays(tmp_path: Path) -> None:
    folder = OutgoingFolder(tmp_path, keep=100, keep_bytes=250)
    for number in (1, 2, 3):
        add(folder, number, 100)
    assert names(folder) == ["002.mcap", "003.mcap"]

    add(folder, 4, 1000)
    assert names(folder) == ["004.mcap"]


def test_a_file_that_fails_leaves_nothing(tmp_path: Path) -> None:
    folder = OutgoingFolder(tmp_path, keep=3, keep_bytes=1000)

    def fail(path: Path) -> None:
        path.write_bytes(b"half")
        message = "no space left on device"
        raise OSError(message)

    with pytest.raises(OSError, match="no space"):
        folder.add("001.mcap", fail)
    assert list(tmp_path.iterdir()) == []


def test_a_sent_file_is_kept_and_can_be_sent_again(tmp_path: Path) -> None:
    folder = OutgoingFolder(tmp_path, keep=3, keep_bytes=1000)
    name = add(folder, 1)
    folder.mark_sent(name)
    assert names(folder) == []
    assert (tmp_path / "sent" / name).is_file()
