"""One run of nena-deploy at a time on one file or site, so that no change is lost."""

from __future__ import annotations

import fcntl
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PATIENCE = 30.0
"""Seconds that another run may take."""
LOOK_EVERY = 0.05


class BusyError(Exception):
    """Another run does not come to its end; the text says what to do."""


@contextmanager
def alone(path: Path, *, patience: float = PATIENCE) -> Iterator[None]:
    """Keep other runs away from ``path``, a file or a folder, until the block ends.

    Raises:
        BusyError: another one has it for longer than ``patience`` seconds.

    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = path.with_name(f".{path.name}.lock")
    with lock.open("a") as file:
        _take(file.fileno(), path, time.monotonic() + patience)
        yield


def _take(descriptor: int, path: Path, end: float) -> None:
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > end:
                message = f"another nena-deploy works on {path}: wait for it, or end it."
                raise BusyError(message) from None
            time.sleep(LOOK_EVERY)
        else:
            return
