"""A folder of recordings, limited by number and size. Its methods block: call them outside the event loop."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

FILE_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,120}\.(mcap|log)", re.ASCII)
"""Valid file name of a recording or a log report."""
SENT: Final = "sent"
UNFINISHED: Final = ".part"


@dataclass(frozen=True, slots=True)
class StoredFile:
    """A file, with its size and time of writing (s since 1970)."""

    path: Path
    size: int
    written: float


def name_of(utc: datetime, reason: str, ending: str = "mcap") -> str:
    """Return the name of a file: time to the millisecond, then reason; names sort by time."""
    return f"{utc:%Y%m%dT%H%M%S}.{utc.microsecond // 1000:03d}Z-{reason}.{ending}"


def files_in(folder: Path, pattern: str = "*") -> list[StoredFile]:
    """Return the files of a folder that match, oldest first; none if it does not exist."""
    found = []
    for path in folder.glob(pattern):
        with suppress(OSError):  # another thread may have removed it
            status = path.stat()
            if path.is_file():
                found.append(StoredFile(path, status.st_size, status.st_mtime))
    return sorted(found, key=lambda each: (each.written, each.path.name))


def excess(files: list[StoredFile], *, keep: int, keep_bytes: int) -> list[StoredFile]:
    """Return the files to remove, oldest first, until the others fit; the newest always stays."""
    total, left = sum(file.size for file in files), len(files)
    removed = []
    for file in files[:-1]:
        if left <= keep and total <= keep_bytes:
            break
        removed.append(file)
        total, left = total - file.size, left - 1
    return removed


class OutgoingFolder:
    """Files that wait for their transfer, and beside them, in ``sent``, those that have been transferred."""

    def __init__(self, folder: Path, *, keep: int, keep_bytes: int) -> None:
        self._folder = folder
        self._keep = keep
        self._keep_bytes = keep_bytes

    def add(self, name: str, write: Callable[[Path], object]) -> Path:
        """Write a file by ``write`` and return its path; a file appears under its name only when complete.

        Transferred files are removed before waiting ones.

        Raises:
            OSError: the disk fails.
        """
        self._folder.mkdir(parents=True, exist_ok=True)
        unfinished = self._folder / f"{name}{UNFINISHED}"
        try:
            write(unfinished)
            path = unfinished.replace(self._folder / name)
        finally:
            unfinished.unlink(missing_ok=True)
        files = [*files_in(self._folder / SENT), *self.waiting()]
        for each in excess(files, keep=self._keep, keep_bytes=self._keep_bytes):
            each.path.unlink(missing_ok=True)
        return path

    def waiting(self) -> list[StoredFile]:
        """Return the files that have not been transferred, oldest first."""
        return [file for file in files_in(self._folder) if FILE_NAME.fullmatch(file.path.name)]

    def mark_sent(self, name: str) -> None:
        """Move a file to those that have been transferred; raises OSError if the disk fails."""
        sent = self._folder / SENT
        sent.mkdir(exist_ok=True)
        with suppress(FileNotFoundError):  # removed for a newer one meanwhile
            (self._folder / name).replace(sent / name)
