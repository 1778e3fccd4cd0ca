"""A reader of what comes from outside, and the place where those that need one have their files."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import mkdtemp

from support.damage import damaged

READABLE = 5000
"""Signs: a refusal is for people, also that of something huge."""


class NotTakenError(Exception):
    """A reader has refused its input, and has reported that without an error of its own."""


@dataclass(frozen=True)
class Place:
    """A folder for the readers' files, and what is closed after them."""

    folder: Path
    stack: ExitStack

    def new(self) -> Path:
        """Make a folder."""
        return Path(mkdtemp(dir=self.folder))


@dataclass(frozen=True)
class Reader:
    """Reads bytes, or raises one of its own errors."""

    read: Callable[[bytes], object]
    samples: tuple[bytes, ...]
    """What it takes."""
    refusals: tuple[type[Exception], ...] = ()
    """None: whatever comes is made the best of."""
    spoiled: Callable[[bytes, Random], bytes] = damaged

    def takes(self, data: bytes) -> bool:
        """Return whether it reads ``data``; any other error than its own ends the test."""
        try:
            self.read(data)
        except self.refusals as error:
            said = str(error)
        else:
            return True
        assert 0 < len(said) < READABLE, said[:READABLE]
        return False


Make = Callable[[Place], Reader]


def of_file(file: Path, read: Callable[[], object]) -> Callable[[bytes], object]:
    """Return what reads bytes from a file."""

    def reader(data: bytes) -> object:
        file.write_bytes(data)
        return read()

    return reader
