"""Recorded conversations: JSON lines with time, topic and payload of each message."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Final, Self, TextIO

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic import ValidationInfo as Info
from pydantic_core import to_json

from nena_shared.findings import in_words

EXPECTED: Final = (
    "A recording has one JSON object per line with time, topic and payload, as from `nena vda5050 record` or "
    "`mosquitto_sub -F %j`; lines with topic and payload, as from `mosquitto_sub -v`, are read too"
)
_VERBOSE: Final = re.compile(r"(?:(?P<time>\d\S*) )?(?P<topic>[^\s{\"]*/[^\s{\"]+) (?P<payload>\{.*\})")
_TIMESTAMP: Final = re.compile(r'"timestamp":\s*"(\d{4}-\d\d-\d\dT[\d:.]+(?:Z|[+-]\d\d:?\d\d))"')
_UTF_16: Final = (b"\xff\xfe", b"\xfe\xff")
EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
"""Time of messages before the first time in a recording."""


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

    @model_validator(mode="before")
    @classmethod
    def _of_other_tools(cls, content: Any, info: Info) -> Any:  # noqa: ANN401 - whatever the JSON holds
        """Read what `mosquitto_sub` and others write: payloads as JSON, other names of the time or none."""
        if isinstance(content, dict) and {"payload", "payload_base64"}.isdisjoint(content):
            raise ValueError(f"payload is missing; the fields are {', '.join(content)}")
        if not isinstance(content, dict) or content.get("payload") is None:
            return content
        payload = content["payload"]
        text = payload if isinstance(payload, str) else to_json(payload).decode()
        times = (content[key] for key in ("time", "tst", "timestamp") if content.get(key))
        time = next(times, (_TIMESTAMP.findall(text) or [info.context])[0])
        # mosquitto_sub writes both Z and a zone.
        return {**content, "payload": text, "time": re.sub(r"Z(?=[+-]\d{4}$)", "", str(time))}


@dataclass(frozen=True, slots=True)
class Entry:
    """A message as it passed the broker; ``retain``: delivered as a retained message."""

    time: datetime
    topic: str
    payload: bytes
    qos: int = 0
    retain: bool = False

    @classmethod
    def from_json(cls, line: str, time: datetime | None = None) -> Self:
        """Parse a line of a recording, or of another tool's; without a time, its message has ``time``.

        Raises:
            ValueError: the line is invalid.
        """
        if verbose := _VERBOSE.fullmatch(line.strip()):
            read = _Line.model_validate(verbose.groupdict(), context=time)
        else:
            read = _Line.model_validate_json(line, context=time)
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
            before = Entry.from_json(line, before.time if before else EPOCH)
        except ValueError as error:
            # 0010: a recording ends in the middle of a line if its writer was killed.
            if before and not line.endswith("\n"):
                return
            raise RecordingError(_problem_at(error, f"{name}, line {number}")) from error
        yield before


def _problem_at(error: ValueError, where: str) -> str:
    problem = str(error)
    if isinstance(error, ValidationError):
        problem = in_words(error.errors(include_url=False)[:1], whole="line")[0]
    return f"{where}: {problem}. {EXPECTED}"


def read_file(path: Path) -> Iterator[Entry]:
    """Yield the messages of a recording in a file.

    Raises:
        RecordingError: the file cannot be read or is invalid.
    """
    try:
        with path.open("rb") as binary:
            start = binary.read(5)
        # PowerShell writes UTF-16.
        with path.open(encoding="utf-16" if start[:2] in _UTF_16 else "utf-8-sig") as file:
            yield from read(file, str(path))
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error
    except UnicodeError as error:
        what = "a black box; open it in Foxglove" if start == b"\x89MCAP" else "no text"
        raise RecordingError(f"{path} is {what}. {EXPECTED}") from error


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
        raise FileExistsError(f"{path} already exists; choose another name or delete it")
    with path.open("x", encoding="utf-8") as file:
        try:
            yield file
        except BaseException:
            if not file.tell():
                path.unlink()
            raise
