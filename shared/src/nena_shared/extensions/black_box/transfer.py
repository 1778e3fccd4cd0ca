"""Transfer of a file over MQTT, chunk by chunk: the messages, and the sender's side. Pure.

The sender waits for an answer to each chunk, so at most one is on its way. The receiver answers every chunk
with the number of bytes that it has, and the sender continues there: a lost chunk or answer is sent again, a
repeated one changes nothing, and after a restart of either side the transfer resumes at what was received.

A chunk is a JSON object (:class:`ChunkHeader`), a line feed, and the bytes of the file from ``offset``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from nena_shared.extensions.black_box.folder import FILE_NAME
from nena_shared.extensions.black_box.settings import LARGEST_FILE

CHUNK_SIZE: Final = 32 * 1024
"""Size of the file's part in a chunk, bytes: small, so that states are not delayed on a slow connection."""
LARGEST_CHUNK: Final = 256 * 1024
"""Maximum size of a chunk that is read, bytes."""
_SEPARATOR: Final = b"\n"


class BadChunkError(Exception):
    """A chunk cannot be read, for the reason in the message."""


class ChunkHeader(BaseModel):
    """The file, and where the chunk belongs."""

    model_config = ConfigDict(frozen=True)

    name: str = Field(max_length=130)
    size: int = Field(ge=1, le=LARGEST_FILE)
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    offset: int = Field(ge=0)


@dataclass(frozen=True, slots=True)
class Chunk:
    """A part of a file."""

    header: ChunkHeader
    data: bytes

    def encode(self) -> bytes:
        """Return the chunk as an MQTT payload."""
        return self.header.model_dump_json().encode() + _SEPARATOR + self.data


def read_chunk(payload: bytes) -> Chunk:
    """Read an MQTT payload.

    Raises:
        BadChunkError: it is too large, not a chunk, or reaches beyond the end of its file.
    """
    if len(payload) > LARGEST_CHUNK:
        raise BadChunkError(f"chunk of {len(payload)} bytes exceeds the limit of {LARGEST_CHUNK}")
    head, _, data = payload.partition(_SEPARATOR)
    try:
        header = ChunkHeader.model_validate_json(head)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise BadChunkError(f"{'.'.join(map(str, first['loc'])) or 'header'}: {first['msg']}") from error
    # the receiver stores the file under this name: it must not lead to another folder
    if FILE_NAME.fullmatch(header.name) is None:
        raise BadChunkError("name: not a file name")
    if not data or header.offset + len(data) > header.size:
        raise BadChunkError(
            f"{len(data)} bytes at {header.offset} do not fit into a file of {header.size} bytes"
        )
    return Chunk(header, data)


class Verdict(StrEnum):
    """What the receiver makes of a file."""

    MORE = "more"
    """Continue at ``received``."""
    COMPLETE = "complete"
    """The file is stored; its checksum is right."""
    REFUSED = "refused"
    """The file will not be stored; do not send it again."""


class Answer(BaseModel):
    """The receiver's answer to a chunk."""

    model_config = ConfigDict(frozen=True)

    name: str = Field(max_length=200)
    verdict: Verdict
    received: int = Field(0, ge=0)
    """Bytes that the receiver has, from the start of the file."""
    reason: str = Field("", max_length=500)
    """Why the file was refused."""

    def encode(self) -> bytes:
        """Return the answer as an MQTT payload."""
        return self.model_dump_json().encode()


class Transfer:
    """The sender's side of one file."""

    def __init__(self, name: str, size: int, sha256: str) -> None:
        self.name = name
        self.size = size
        self._sha256 = sha256
        self.offset = 0
        """Where the next chunk begins, bytes."""
        self.end: Answer | None = None
        """The answer that ended the transfer."""

    def chunk(self, data: bytes) -> Chunk:
        """Return the chunk at :attr:`offset` with this data."""
        header = ChunkHeader(name=self.name, size=self.size, sha256=self._sha256, offset=self.offset)
        return Chunk(header, data)

    def take(self, answer: Answer) -> bool:
        """Handle an answer; return whether the next chunk is due or the transfer has ended.

        Answers about another file and repeated ones change nothing.
        """
        if self.end or answer.name != self.name:
            return False
        if answer.verdict is not Verdict.MORE:
            self.end = answer
            return True
        # the second one contradicts MORE, and nothing could be read there
        if answer.received == self.offset or answer.received >= self.size:
            return False
        self.offset = answer.received
        return True
