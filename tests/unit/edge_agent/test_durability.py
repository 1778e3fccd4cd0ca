from __future__ import annotations

from pathlib import Path

import pytest

from nena_edge_agent.durability import sync_folder


def descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def test_a_folder_is_synced_to_disk_and_closed(tmp_path: Path) -> None:
    before = descriptors()
    sync_folder(tmp_path)
    assert descriptors() == before


def test_a_missing_folder_is_reported(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        sync_folder(tmp_path / "nowhere")
