"""Keeps a second order service away from the same SQLite file: both would send the same orders."""

from __future__ import annotations

import fcntl
from pathlib import Path
from typing import Self

from nena_order_service.store.engine import parse_url
from nena_order_service.store.errors import StoreError


class InstanceLock:
    """Held from :meth:`take` on until the process ends, however it ends."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("w", encoding="utf-8")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise

    @classmethod
    def take(cls, url: str) -> Self | None:
        """Take the lock of a SQLite file; None for other databases.

        Raises:
            StoreError: another process has it, the lock file cannot be made, or the URL names no file.

        """
        parsed = parse_url(url)
        if parsed.get_backend_name() != "sqlite":
            return None
        if parsed.database in (None, "", ":memory:"):
            message = "store.url names no file, so orders would be lost. Name one: sqlite:///orders.db"
            raise StoreError(message)
        path = Path(f"{parsed.database}.lock")
        try:
            return cls(path)
        except BlockingIOError as error:
            message = f"another order service uses {parsed.database}: end it, or name another store.url"
            raise StoreError(message) from error
        except OSError as error:
            message = f"cannot make {path}: {error.strerror}. Name a file that can be written in store.url"
            raise StoreError(message) from error

    def release(self) -> None:
        """Let another process have the store."""
        self._file.close()
