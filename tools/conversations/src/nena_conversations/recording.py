"""Recorded conversations: JSON lines with time, topic and payload of each message."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Self, TextIO

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError

from nena_shared.findings import in_words


class RecordingError(Exception):
    """A file is not a valid recording; the message names the line and the reason."""


class _Line(BaseModel):
    model_config = ConfigDict(extra="ignore")

    time: AwareDatetime
    topic: Annotated[str, Field(min_length=1)]
    payload: str | None = None
    payload_base64: str | None = None
    """Replaces ``payload`` if that is not UTF-8."""
    qos: Annotated[int, Field(ge=0, le=2)] = 0
    retain: bool = False


@dataclass(frozen=True, slots=True)
class Entry:
    """A message as it passed the broker; ``retain``: delivered as a retained message."""

    time: datetime
    topic: str
    payload: bytes
    qos: int = 0
    retain: bool = False

    @classmethod
    def from_json(cls, line: str) -> Self:
        """Parse a line of a recording.

        Raises:
            ValueError: the line is invalid.

        """
        read = _Line.model_validate_json(line)
        if read.payload_base64 is not None:
            payload = base64.b64decode(read.payload_base64, validate=True)
        else:
            payload = (read.payload or "").encode()
        return cls(read.time, read.topic, payload, read.qos, read.retain)

    def to_json(self) -> str:
        """Return the message as a line without a line end."""
        try:
            text: dict[str, str] = {"payload": self.payload.decode()}
        except UnicodeDecodeError:
            text = {"payload_base64": base64.b64encode(self.payload).decode()}
        line = _Line(time=self.time, topic=self.topic, qos=self.qos, retain=self.retain, **text)
        return line.model_dump_json(exclude_none=True)


def read(lines: Iterable[str], name: str) -> Iterator[Entry]:
    """Yield the messages of a recording called ``name``.

    Skips empty lines and an incomplete last line.

    Raises:
        RecordingError: a line is invalid.

    """
    before: Entry | None = None
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            before = Entry.from_json(line)
        except ValueError as error:
            # 0010: a recording ends in the middle of a line if its writer was killed.
            if before and not line.endswith("\n"):
                return
            raise RecordingError(_problem_at(error, f"{name}, line {number}")) from error
        yield before


def _problem_at(error: ValueError, where: str) -> str:
    if not isinstance(error, ValidationError):
        return f"{where}: {error}"
    return f"{where}: {in_words(error.errors(include_url=False)[:1], whole='line')[0]}"


def read_file(path: Path) -> Iterator[Entry]:
    """Yield the messages of a recording in a file.

    Raises:
        RecordingError: the file cannot be read or is invalid.

    """
    try:
        with path.open(encoding="utf-8") as file:
            yield from read(file, str(path))
    except (OSError, UnicodeDecodeError) as error:
        message = f"{path} cannot be read: {error}"
        raise RecordingError(message) from error


def append(entry: Entry, file: TextIO) -> None:
    """Append a message and flush, so that the recording survives an interruption."""
    file.write(entry.to_json() + "\n")
    file.flush()


@contextmanager
def new_file(path: Path) -> Iterator[TextIO]:
    """Create a file for a recording; never overwrites one, and removes it if it stays empty.

    Raises:
        OSError: the file exists or cannot be created.

    """
    if path.exists():
        message = f"{path} already exists; choose another name or delete it"
        raise FileExistsError(message)
    with path.open("x", encoding="utf-8") as file:
        try:
            yield file
        except BaseException:
            if not file.tell():
                path.unlink()
            raise
