"""Recordings as MCAP files, which Foxglove opens.

Imported only to write a file: the library ``mcap`` is an extra.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from mcap.writer import CompressionType, Writer
from pydantic import BaseModel

from nena_shared.clock import in_utc
from nena_shared.extensions.black_box.ring import Channel, Entry

LOG_TOPIC: Final = "/nena/log"
LOG_SCHEMA: Final = "foxglove.Log"
"""Foxglove shows messages with this schema in its log panel."""
_TEXT: Final = {"type": "string"}
_LOG_FORM: Final = {
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "level": {"type": "integer"},
        "message": _TEXT,
        "name": _TEXT,
    },
}
_LEVELS: Final = {"debug": 1, "info": 2, "warning": 3, "error": 4, "critical": 5}
_UNKNOWN_LEVEL: Final = 0
_ANY_OBJECT: Final = b'{"type":"object"}'
NOTHING: Final[tuple[object, ...]] = (None, "", (), [])
"""Values of fields that are left out of documents."""
_CHUNK_SIZE: Final = 512 * 1024
_SECOND: Final = 1_000_000_000
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class Recording:
    """What a file contains; plain data, so that a thread can write it."""

    entries: Sequence[Entry]
    lines: Sequence[str]
    """Log lines: time, level and text, oldest first."""
    at: float
    """Time of writing, monotonic, s."""
    utc: datetime
    """The same time, UTC."""
    about: Mapping[str, str] = field(default_factory=dict)
    """Source, reason and program, for the file's metadata."""

    def nanoseconds(self, at: float) -> int:
        """Convert a monotonic time to nanoseconds since 1970, UTC."""
        return _since_1970(self.utc) + round((at - self.at) * _SECOND)


def _since_1970(moment: datetime) -> int:
    """Return nanoseconds, without the rounding of a floating-point number."""
    return (moment - _EPOCH) // timedelta(microseconds=1) * 1000


def write_mcap(path: Path, recording: Recording, *, ros_schema: Callable[[str], bytes] | None = None) -> None:
    """Write a recording to ``path``; blocks, so call it outside the event loop's thread.

    ``ros_schema`` returns the definition (``ros2msg``) of a ROS message type.

    Raises:
        OSError: the disk fails.
    """
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=_CHUNK_SIZE, compression=CompressionType.ZSTD)
        writer.start(library="nena")
        writer.add_metadata("nena", dict(recording.about))
        _write_entries(writer, recording, ros_schema or (lambda _: b""))
        _write_log(writer, recording)
        writer.finish()  # type: ignore[no-untyped-call] # of the library


def _write_entries(writer: Writer, recording: Recording, ros_schema: Callable[[str], bytes]) -> None:
    schemas: dict[str, int] = {}
    channels: dict[Channel, int] = {}
    for number, entry in enumerate(sorted(recording.entries, key=lambda each: each.at)):
        channel = entry.channel
        if channel not in channels:
            if channel.schema not in schemas:
                schemas[channel.schema] = _register_schema(writer, channel.schema, ros_schema)
            encoding = "cdr" if channel.schema else "json"
            channels[channel] = writer.register_channel(channel.topic, encoding, schemas[channel.schema])
        time = recording.nanoseconds(entry.at)
        data = encoded(entry)
        writer.add_message(channels[channel], log_time=time, publish_time=time, data=data, sequence=number)


def _register_schema(writer: Writer, name: str, ros_schema: Callable[[str], bytes]) -> int:
    form = (name, "ros2msg", ros_schema(name)) if name else ("json", "jsonschema", _ANY_OBJECT)
    return int(writer.register_schema(*form))


def encoded(entry: Entry) -> bytes:
    """Return the payload of an entry as the file contains it."""
    payload, channel = entry.payload, entry.channel
    if isinstance(payload, bytes):
        return payload if channel.schema or channel.own else _as_json_object(payload)
    found = {key: value for key, value in payload.items() if value not in NOTHING}
    return json.dumps(found, ensure_ascii=False, default=_as_on_wire).encode()


def _as_on_wire(value: object) -> object:
    """Return a model within a document as it is on the wire."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", by_alias=True, exclude_none=True)
    return str(value)


def _as_json_object(payload: bytes) -> bytes:
    """Return a received payload, in an envelope if it is not a JSON object."""
    try:
        # 0061: one message that is not JSON would make its whole topic unreadable
        if isinstance(json.loads(payload), dict):
            return payload
    except (ValueError, RecursionError):
        pass
    return json.dumps({"unreadable": payload.decode("utf-8", "backslashreplace")}).encode()


def _write_log(writer: Writer, recording: Recording) -> None:
    schema = writer.register_schema(LOG_SCHEMA, "jsonschema", json.dumps(_LOG_FORM).encode())
    channel = writer.register_channel(LOG_TOPIC, "json", schema)
    for number, (time, level, text) in enumerate(_log_entries(recording.lines)):
        seconds, rest = divmod(time, _SECOND)
        line = {
            "timestamp": {"sec": seconds, "nsec": rest},
            "level": level,
            "message": text,
            "name": recording.about.get("source", ""),
        }
        payload = json.dumps(line).encode()
        writer.add_message(channel, log_time=time, publish_time=time, data=payload, sequence=number)


def _log_entries(lines: Iterable[str]) -> Iterable[tuple[int, int, str]]:
    """Yield time (ns), level and text of each line of the log; a line without a time is left out."""
    for line in lines:
        time, _, rest = line.partition(" [")
        level, _, text = rest.partition("] ")
        try:
            moment = datetime.fromisoformat(time)
        except ValueError:
            continue
        yield _since_1970(in_utc(moment)), _LEVELS.get(level.strip(), _UNKNOWN_LEVEL), text
