"""A disk of a few MB that a test fills and frees. Needs root on Linux."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

PIECE = 4096


@dataclass(frozen=True, slots=True)
class SmallDisk:
    """Mounted at ``folder``."""

    folder: Path

    @property
    def free(self) -> int:
        """Return the free space, bytes."""
        return shutil.disk_usage(self.folder).free

    def fill(self, *, leave: int = 0) -> None:
        """Fill the free space but for ``leave`` bytes; existing files can still be overwritten."""
        with self._ballast.open("ab", buffering=0) as file:
            try:
                while self.free > leave or not leave:
                    file.write(bytes(PIECE))
            except OSError as error:
                assert self.free == 0, error  # noqa: PT017 - any other error than a full disk

    def clear(self) -> None:
        """End :meth:`fill`."""
        self._ballast.unlink()

    @property
    def _ballast(self) -> Path:
        return self.folder / "ballast"


@contextmanager
def small_disk(folder: Path, megabytes: int) -> Iterator[SmallDisk]:
    """Mount a disk at ``folder``; the test is skipped where that cannot be done."""
    if os.geteuid() != 0:
        pytest.skip("a disk of its own needs root")
    folder.mkdir()
    mounted = _run("mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "nena-test", str(folder))
    if mounted.returncode != 0:
        pytest.skip(f"no disk can be mounted here: {mounted.stderr.strip()}")
    try:
        yield SmallDisk(folder)
    finally:
        _run("umount", "--lazy", str(folder)).check_returncode()


def _run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, check=False, timeout=30, capture_output=True, text=True)
