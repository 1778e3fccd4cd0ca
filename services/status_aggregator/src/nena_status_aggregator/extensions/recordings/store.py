"""The files of all robots in one folder. Its methods block: call them outside the event loop."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path
from typing import Final
from urllib.parse import quote, unquote

from pydantic import Field

from nena_shared.extensions.black_box.folder import FILE_NAME, UNFINISHED, StoredFile, excess, files_in
from nena_shared.extensions.black_box.settings import LARGEST_FILE
from nena_shared.extensions.black_box.transfer import Answer, Chunk, Verdict
from nena_shared.settings import SettingsGroup
from nena_shared.vda5050.topics import RobotKey

SEPARATOR: Final = "."
"""Between manufacturer and serial number in the name of a robot's folder, which contain none."""

LONGEST_FOLDER: Final = 250
"""Maximum length of a folder's name."""


class RecordingSettings(SettingsGroup):
    """Recordings and log reports of robots."""

    enabled: bool = Field(default=True, description="Accept recordings of robots.")
    folder: Path = Field(
        Path("nena-recordings"),
        description="Folder of the recordings, with a subfolder per robot; created with the first one.",
    )
    keep: int = Field(500, ge=1, description="Maximum number of files; beyond it, the oldest is removed.")
    keep_per_robot: int = Field(
        50, ge=1, description="Maximum number of files of a robot; beyond it, its oldest is removed."
    )
    keep_bytes: int = Field(
        2 * 1024**3,
        ge=1024**2,
        description="Maximum size of all files, bytes; beyond it, the oldest are removed.",
    )
    file_bytes: int = Field(
        64 * 1024**2,
        ge=1024,
        le=LARGEST_FILE,
        description="Maximum size of a file, bytes; larger ones are refused.",
    )


@dataclass(frozen=True, slots=True)
class StoredRecording:
    """A file of a robot; ``received`` is the time of its last chunk, s since 1970."""

    robot: RobotKey
    name: str
    size: int
    received: float
    path: Path


class RecordingStore:
    """Appends chunks to files; a file appears under its name only when complete, with the right checksum."""

    def __init__(self, limits: RecordingSettings) -> None:
        """Use the folder of ``limits``, which is created with the first file."""
        self._folder = limits.folder
        self._limits = limits

    def add_chunk(self, robot: RobotKey, chunk: Chunk) -> Answer:
        """Store a chunk if it is the next one of its file; return the answer for the robot.

        Raises:
            OSError: the disk fails; the robot repeats the chunk.
        """
        header, place = chunk.header, self._folder_of(robot)
        target = place / header.name
        if problem := self._why_refused(chunk, place):
            return Answer(name=header.name, verdict=Verdict.REFUSED, reason=problem)
        if target.exists():
            return Answer(name=header.name, verdict=Verdict.COMPLETE, received=header.size)
        part = place / f"{header.name}.{header.sha256}{UNFINISHED}"
        have = part.stat().st_size if part.exists() else 0
        if header.offset != have:
            return Answer(name=header.name, verdict=Verdict.MORE, received=have)
        if have == 0:
            place.mkdir(parents=True, exist_ok=True)
            # A robot sends one file at a time; it gave up one that it began before and never completed.
            for unfinished in place.glob(f"*{UNFINISHED}"):
                unfinished.unlink(missing_ok=True)
        with part.open("ab") as file:
            file.write(chunk.data)
        have += len(chunk.data)
        if have < header.size:
            return Answer(name=header.name, verdict=Verdict.MORE, received=have)
        return self._finish_file(chunk, part, target)

    def _why_refused(self, chunk: Chunk, place: Path) -> str:
        """Return why a file is refused; empty if it is not."""
        size, limit, target = chunk.header.size, self._limits.file_bytes, place / chunk.header.name
        if size > limit:
            return f"{size} bytes exceed the limit of {limit} (recordings.file_bytes)"
        if len(place.name) > LONGEST_FOLDER:
            return "manufacturer and serial number are too long for a folder"
        if target.exists() and target.stat().st_size != size:
            return "another file of this name exists"
        return ""

    def _finish_file(self, chunk: Chunk, part: Path, target: Path) -> Answer:
        with part.open("rb") as file:
            digest = file_digest(file, "sha256").hexdigest()
        if digest != chunk.header.sha256:
            part.unlink()
            return Answer(name=target.name, verdict=Verdict.REFUSED, reason="the checksum is wrong")
        part.replace(target)
        self._remove_oldest(target.parent)
        return Answer(name=target.name, verdict=Verdict.COMPLETE, received=chunk.header.size)

    def list_recordings(self) -> list[StoredRecording]:
        """Return all complete files, newest first."""
        recordings = [
            StoredRecording(robot, file.path.name, file.size, file.written, file.path)
            for robot, place in self._all_folders()
            for file in files_in(place)
            if FILE_NAME.fullmatch(file.path.name)
        ]
        return sorted(recordings, key=lambda recording: (recording.received, recording.name), reverse=True)

    def find_file(self, robot: RobotKey, name: str) -> Path | None:
        """Return the path of a complete file, None if there is none."""
        path = self._folder_of(robot) / name
        return path if FILE_NAME.fullmatch(name) and path.is_file() else None

    def _remove_oldest(self, place: Path) -> None:
        """Remove the oldest files: of this robot beyond its number, then of all robots beyond the limits."""
        limits = self._limits
        own = [file for file in files_in(place) if FILE_NAME.fullmatch(file.path.name)]
        self._remove_files(excess(own, keep=limits.keep_per_robot, keep_bytes=limits.keep_bytes))
        every = [file for _, folder in self._all_folders() for file in files_in(folder)]
        every.sort(key=lambda file: file.written)
        self._remove_files(excess(every, keep=limits.keep, keep_bytes=limits.keep_bytes))

    def _remove_files(self, files: list[StoredFile]) -> None:
        for file in files:
            file.path.unlink(missing_ok=True)
            with suppress(OSError):  # not empty
                file.path.parent.rmdir()

    def _folder_of(self, robot: RobotKey) -> Path:
        # Letters, digits, - and _ stay; a dot would be taken for the separator, so it is encoded, too.
        levels = (quote(name, safe="").replace(".", "%2E").replace("~", "%7E") for name in robot)
        return self._folder / SEPARATOR.join(levels)

    def _all_folders(self) -> Iterator[tuple[RobotKey, Path]]:
        for path in self._folder.glob(f"*{SEPARATOR}*"):
            parts = [unquote(level) for level in path.name.split(SEPARATOR)]
            if path.is_dir() and len(parts) == len(RobotKey._fields):
                yield RobotKey(*parts), path
