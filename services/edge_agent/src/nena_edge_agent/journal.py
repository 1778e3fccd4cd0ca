"""The journal: what a robot must still know after the end of its agent, in one file per robot."""

from __future__ import annotations

import errno
import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from urllib.parse import quote
from zlib import crc32

from nena_edge_agent.durability import sync_folder
from nena_edge_agent.protocol.memory import FORMAT, Memory
from nena_shared.program import StartError
from nena_shared.vda5050.topics import RobotKey

LEAST_ROOM = 16 * 1024
"""Bytes for one record, at least."""
CHECKSUM = 9
"""Bytes of a record's checksum: eight digits and a space."""


@contextmanager
def sole_user(folder: Path, robot: RobotKey) -> Iterator[None]:
    """Be the only program on this machine that works for ``robot`` with this folder, until the block ends.

    Raises:
        StartError: another one does, or the folder cannot be used.

    """
    path = _at_home(folder) / f"{_file_name(robot)}.lock"
    with ExitStack() as stack:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file = stack.enter_context(path.open("wb"))
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            message = f"another edge agent works for robot {robot}: end it first ({path} is locked)"
            raise StartError(message) from error
        except OSError as error:
            full = error.errno in (errno.ENOSPC, errno.EDQUOT)
            remedy = "make room on its disk" if full else "set journal.folder"
            message = f"the journal's folder {folder} cannot be used: {error.strerror}; {remedy}"
            raise StartError(message) from error
        yield


class UnreadableJournalError(Exception):
    """There is a journal, and nobody knows what it says; the text tells why and what to do."""


class Journal:
    """Holds the newest record and the one before it, each in its half of one file; no record is half there.

    A record is written over the older one. The file keeps its size, so that the disk has to take these bytes
    and nothing else; where a record needs more room, a new file takes the old one's place.
    """

    def __init__(self, folder: Path, robot: RobotKey) -> None:
        self._folder = _at_home(folder)
        self._file = self._folder / f"{_file_name(robot)}.journal"
        self._number = 0
        """Of the newest record that is on the disk."""
        self._made = False

    def read(self) -> Memory | None:
        """Give the last record, None if there is none; to be called before the first :meth:`write`.

        Raises:
            StartError: the folder cannot be used, with what to do.
            UnreadableJournalError: the file cannot be read, or is damaged, or of another version.

        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            there = self._file.exists()
        except OSError as error:
            message = f"the journal {self._file} cannot be used: {error.strerror}; set journal.folder"
            raise StartError(message) from error
        return self._read() if there else None

    def _read(self) -> Memory:
        remedy = f"remove {self._file} and start the agent again"
        try:
            self._number, record = _newest(self._file.read_bytes())
            found = {"format": FORMAT} | json.loads(record)
            if found["format"] == FORMAT:
                return Memory.model_validate_json(json.dumps(found))
        except OSError as error:
            message = f"the journal cannot be read ({error.strerror}): {remedy}"
            raise UnreadableJournalError(message) from error
        except (ValueError, TypeError, RecursionError) as error:
            message = f"the journal is damaged: {remedy}"
            raise UnreadableJournalError(message) from error
        message = f"the journal is of another version of the agent: install that one again, or {remedy}"
        raise UnreadableJournalError(message)

    def write(self, memory: Memory) -> None:
        """Replace the record; when this returns it outlives the process, after :meth:`sync` a power cut.

        Both block for the time of the disk: to be called outside of the event loop's thread.

        Raises:
            OSError: it could not be written; the old record stands.

        """
        record = memory.model_dump_json(exclude_defaults=True).encode()
        if not self._overwrite(self._number + 1, record):
            self._make_file(self._number + 1, record)
            self._made = True

    def sync(self) -> None:
        """Wait until the disk has the record that was written last.

        Raises:
            OSError: the disk has failed; whether it has the record is not known.

        """
        with self._file.open("rb") as file:
            os.fdatasync(file.fileno())
        if self._made:
            sync_folder(self._folder)
            self._made = False
        self._number += 1

    def _overwrite(self, number: int, record: bytes) -> bool:
        """Write over the older record; tell whether there is a file with room for it."""
        with suppress(FileNotFoundError), self._file.open("r+b") as file:
            half = os.fstat(file.fileno()).st_size // 2
            framed = _framed(number, record, half)
            if len(framed) == half:
                file.seek(number % 2 * half)
                file.write(framed)
                return True
        return False

    def _make_file(self, number: int, record: bytes) -> None:
        half = max(LEAST_ROOM, 1 << (2 * len(record)).bit_length())
        halves = [b" " * half, b" " * half]
        halves[number % 2] = _framed(number, record, half)
        new = self._file.with_suffix(".new")
        with new.open("wb") as file:
            file.write(b"".join(halves))
            file.flush()
            os.fsync(file.fileno())
        new.replace(self._file)


def recollection(journal: Journal | None) -> tuple[Memory | None, str]:
    """Give what ``journal`` holds, if there is one, and why nobody knows what it holds, if so.

    Raises:
        StartError: its folder cannot be used, with what to do.

    """
    try:
        return (journal.read() if journal else None), ""
    except UnreadableJournalError as error:
        return None, str(error)


def _framed(number: int, record: bytes, size: int) -> bytes:
    """Give a record with its number, filled up to ``size`` where it is shorter, after a checksum of all."""
    rest = (b"%d\n%b" % (number, record)).ljust(size - CHECKSUM)
    return b"%08x " % crc32(rest) + rest


def _newest(content: bytes) -> tuple[int, bytes]:
    """Give the newest record of a journal and its number; one that was being written may be torn.

    Raises:
        ValueError: there is none.

    """
    half = len(content) // 2
    records = [_read(each) for each in (content[:half], content[half:])]
    return max(each for each in records if each)


def _read(framed: bytes) -> tuple[int, bytes] | None:
    rest = framed[CHECKSUM:]
    if framed[:CHECKSUM] != b"%08x " % crc32(rest):
        return None
    number, _, record = rest.partition(b"\n")
    return int(number), record


def _file_name(robot: RobotKey) -> str:
    """Give a name that no other robot has: its first full stop ends the manufacturer.

    A serial number may hold any of the standard's signs as it is; all else that file systems stumble over is
    written as in an URL.
    """
    manufacturer = quote(robot.manufacturer, safe=" ").replace(".", "%2E")
    return f"{manufacturer}.{quote(robot.serial_number, safe=' :')}"


def _at_home(folder: Path) -> Path:
    """Put the home directory in place of ``~``.

    Raises:
        StartError: there is none.

    """
    try:
        return folder.expanduser()
    except RuntimeError as error:
        message = f"the journal's folder {folder} cannot be found: {error}; set journal.folder"
        raise StartError(message) from error
