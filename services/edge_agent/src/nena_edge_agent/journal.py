"""The journal: what a robot must still know after the end of its agent, in one file per robot."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from urllib.parse import quote

from pydantic import ValidationError

from nena_edge_agent.protocol.memory import Memory
from nena_shared.program import StartError
from nena_shared.vda5050.topics import RobotKey


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
            message = f"the journal's folder {folder} cannot be used: {error.strerror}; set journal.folder"
            raise StartError(message) from error
        yield


class Journal:
    """Holds the newest record only; a record is there whole or not at all."""

    def __init__(self, folder: Path, robot: RobotKey) -> None:
        self._folder = _at_home(folder)
        self._file = self._folder / f"{_file_name(robot)}.json"

    def read(self) -> Memory | None:
        """Give the last record, None if there is none.

        Raises:
            StartError: the folder or the file cannot be used, with what to do.

        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            content = self._file.read_bytes() if self._file.exists() else None
        except OSError as error:
            message = f"the journal {self._file} cannot be used: {error.strerror}; set journal.folder"
            raise StartError(message) from error
        if content is None:
            return None
        try:
            return Memory.model_validate_json(content)
        except ValidationError as error:
            message = f"the journal {self._file} is damaged; look at where the robot is, then remove the file"
            raise StartError(message) from error

    def write(self, memory: Memory) -> None:
        """Replace the record; when this returns it survives the end of the process and of the power.

        Blocks for the time of the disk: to be called outside of the event loop's thread.

        Raises:
            OSError: it could not be written; the old record stands.

        """
        new = self._file.with_suffix(".new")
        with new.open("wb") as file:
            file.write(memory.model_dump_json(exclude_defaults=True).encode())
            file.flush()
            os.fsync(file.fileno())
        new.replace(self._file)
        _sync_folder(self._folder)


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


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
