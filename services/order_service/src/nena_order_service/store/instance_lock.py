"""Lock on the file of a SQLite store: one order service at a time, and the same file until it exits."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from typing import Self
from urllib.parse import urlsplit

from nena_order_service.store.schema import StoreError, parse_url


class InstanceLock:
    """Locks the database file itself from :meth:`take` until :meth:`release` or the end of the process.

    A second order service on the same file would send the same orders. Release it after the database is
    closed: closing any descriptor of a file releases SQLite's own locks on it (POSIX).
    """

    def __init__(self, path: Path) -> None:
        """Open and lock ``path``; create an empty file, a new SQLite database, if it does not exist.

        Raises:
            OSError: the file cannot be opened; BlockingIOError: another process has locked it.
        """
        self._path = path
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._file)
            raise
        self._opened = os.fstat(self._file)

    @classmethod
    def take(cls, url: str) -> Self | None:
        """Lock the file of a SQLite URL; None for other databases.

        Raises:
            StoreError: another process has locked the file, it cannot be written, or the URL names no file.
        """
        parsed = parse_url(url)
        if parsed.get_backend_name() != "sqlite":
            return None
        if parsed.database in (None, "", ":memory:"):
            message = "store.url names no file, so orders would be lost. Set a file: sqlite:///orders.db"
            raise StoreError(message)
        database = str(parsed.database)
        path = Path(urlsplit(database).path if database.startswith("file:") else database)
        try:
            return cls(path)
        except BlockingIOError as error:
            message = f"another order service uses {path}: stop it, or set another store.url"
            raise StoreError(message) from error
        except OSError as error:
            message = f"cannot open {path}: {error.strerror}. Set store.url to a writable file"
            raise StoreError(message) from error

    def why_lost(self) -> str:
        """Return why the path no longer leads to the opened file; empty while it does."""
        try:
            present = self._path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return f"the database file {self._path} was deleted while in use"
        except OSError:
            return ""  # unknown whether it is another file; the commit itself will report the problem
        return (
            "" if os.path.samestat(present, self._opened) else f"the database file {self._path} was replaced"
        )

    def release(self) -> None:
        """Release the lock."""
        os.close(self._file)
