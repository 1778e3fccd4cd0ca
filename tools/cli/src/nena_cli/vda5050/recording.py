"""A recorded conversation: JSON lines with the time, the topic and the payload of each message."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Self, TextIO

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError

from nena_shared.misfits import in_words


class RecordingError(Exception):
    """A file is no recording; the text says in which line, and why."""


class _Line(BaseModel):
    model_config = ConfigDict(extra="ignore")

    time: AwareDatetime
    topic: Annotated[str, Field(min_length=1)]
    payload: str | None = None
    payload_base64: str | None = None
    """In place of ``payload`` where it is no UTF-8."""
    qos: Annotated[int, Field(ge=0, le=2)] = 0
    retain: bool = False


@dataclass(frozen=True, slots=True)
class Entry:
    """One message as it went over the broker; ``retain``: the broker had kept it from before."""

    time: datetime
    topic: str
    payload: bytes
    qos: int = 0
    retain: bool = False

    @classmethod
    def from_json(cls, line: str) -> Self:
        """Read a line of a recording.

        Raises:
            ValueError: it is none.

        """
        read = _Line.model_validate_json(line)
        if read.payload_base64 is not None:
            payload = base64.b64decode(read.payload_base64, validate=True)
        else:
            payload = (read.payload or "").encode()
        return cls(read.time, read.topic, payload, read.qos, read.retain)

    def to_json(self) -> str:
        """Write the message as a line, without the line's end."""
        try:
            text: dict[str, str] = {"payload": self.payload.decode()}
        except UnicodeDecodeError:
            text = {"payload_base64": base64.b64encode(self.payload).decode()}
        line = _Line(time=self.time, topic=self.topic, qos=self.qos, retain=self.retain, **text)
        return line.model_dump_json(exclude_none=True)


def read(lines: Iterable[str], name: str) -> Iterator[Entry]:
    """Read a recording called ``name``, message by message.

    Empty lines are passed over, and a last line that was not written to its end.

    Raises:
        RecordingError: a line is no message.

    """
    before: Entry | None = None
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            before = Entry.from_json(line)
        except ValueError as error:
            if before and not line.endswith("\n"):
                return
            raise RecordingError(_problem(error, f"{name}, line {number}")) from error
        yield before


def _problem(error: ValueError, where: str) -> str:
    if not isinstance(error, ValidationError):
        return f"{where}: {error}"
    return f"{where}: {in_words(error.errors(include_url=False)[:1], whole='line')[0]}"


def read_file(path: Path) -> Iterator[Entry]:
    """Read the recording in a file.

    Raises:
        RecordingError: the file cannot be read, or is none.

    """
    try:
        with path.open(encoding="utf-8") as file:
            yield from read(file, str(path))
    except (OSError, UnicodeDecodeError) as error:
        message = f"{path} cannot be read: {error}"
        raise RecordingError(message) from error


def append(entry: Entry, file: TextIO) -> None:
    """Write a message behind the others, so that what was recorded survives an interruption."""
    file.write(entry.to_json() + "\n")
    file.flush()


@contextmanager
def new_file(path: Path) -> Iterator[TextIO]:
    """Make a file for a recording; one that is there is never written over, an empty one is not left.

    Raises:
        OSError: the file is there, or cannot be made.

    """
    if path.exists():
        message = f"{path} is there already; name another file, or remove that one"
        raise FileExistsError(message)
    with path.open("x", encoding="utf-8") as file:
        try:
            yield file
        except BaseException:
            if not file.tell():
                path.unlink()
            raise
