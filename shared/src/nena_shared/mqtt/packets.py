"""What comes from the broker, cut into packets (MQTT 3.1.1 sections 2.2 to 3.4), with messages taken out.

paho calls the socket four times for each packet, and makes of each message, and of each acknowledgement,
objects with locks and lines for a log that nobody keeps. Here the socket is read once for all that has come.
All that is neither a plain message nor an acknowledgement that is waited for, and all that is wrong, is left
to paho, as it came. Messages to the broker with quality of service 1 are written here as well.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from struct import Struct
from typing import Final, NamedTuple

CHUNK: Final = 65_536
"""Bytes that are read at once."""

PUBLISH: Final = 0x30
PUBACK: Final = 0x40
MID_BYTES: Final = 2
_ACKNOWLEDGEMENT: Final = Struct("!BBH")
MORE: Final = 0x80
"""In a byte of a packet's length: another one follows."""
LENGTH_BYTES: Final = 4
"""That a packet's length has at the most."""
LONGEST: Final = (1 << 7 * LENGTH_BYTES) - 1
LONGEST_TOPIC: Final = 65_535
AT_LEAST_ONCE: Final = 1 << 1
"""Quality of service 1 in the first byte of a message."""


class Published(NamedTuple):
    """A message; ``mid`` is 0 for quality of service 0, which is not acknowledged."""

    topic: str
    payload: bytes
    qos: int
    retained: bool
    mid: int


class Packets:
    """Stands between a socket and paho, which reads by :meth:`read` what it is offered.

    ``receive`` reads from the socket: it raises BlockingIOError where nothing has come, gives nothing where
    the connection has ended, and raises other OSErrors where it is broken. paho is told so in its turn.
    """

    def __init__(self, receive: Callable[[int], bytes]) -> None:
        self._receive = receive
        self._data = bytearray()
        self._at = 0
        """Where in the data the next packet begins, or what paho has not read of one that it was offered."""
        self._offered = 0
        """Where what was offered ends."""
        self._ended: OSError | bytes | None = None

    @property
    def ready(self) -> bool:
        """Whether there is a packet, or the end."""
        return self._bounds() is not None or self._ended is not None

    @property
    def why_ended(self) -> str:
        """Say in words why nothing comes any more; empty while something may."""
        if self._ended is None:
            return ""
        if isinstance(self._ended, OSError):
            return f"the connection has broken: {self._ended}"
        return "the broker has ended the connection"

    def fill(self) -> bool:
        """Read what has come, and tell whether that is anything.

        To be called where nothing is ready, so that no more than that is kept here.
        """
        try:
            came = self._receive(CHUNK)
        except BlockingIOError:
            return False
        except OSError as error:
            self._ended = error
            return False
        if not came:
            self._ended = came
        del self._data[: self._at]
        self._at = self._offered = 0
        self._data += came
        return bool(came)

    def take(self) -> Published | None:
        """Take out the next packet, if all of it is here and it is a message."""
        bounds = self._bounds()
        if bounds is None or self._data[self._at] & 0xF0 != PUBLISH:
            return None
        message = _read(self._data, *bounds, head=self._data[self._at])
        if message:
            self._at = bounds[1]
        return message

    def take_acknowledgement(self, awaited: Container[int]) -> int | None:
        """Take out the next packet, if it acknowledges one of these messages; gives the message's number."""
        bounds = self._bounds()
        if bounds is None or self._data[self._at] != PUBACK or bounds[1] - bounds[0] != MID_BYTES:
            return None
        mid = int.from_bytes(self._data[bounds[0] : bounds[1]])
        if mid not in awaited:
            return None
        self._at = bounds[1]
        return mid

    def offer(self) -> bool:
        """Let paho read the next packet, or that the connection has ended; False: there is nothing."""
        bounds = self._bounds()
        if bounds:
            self._offered = bounds[1]
        return bounds is not None or self._ended is not None

    def read(self, bufsize: int) -> bytes:
        """Give paho at most so many bytes of what it was offered.

        Raises:
            OSError: there is no more of it, or the connection has broken.

        """
        if self._at < self._offered:
            start, self._at = self._at, min(self._at + bufsize, self._offered)
            return bytes(self._data[start : self._at])
        if isinstance(self._ended, bytes):
            return self._ended
        raise self._ended or BlockingIOError

    def _bounds(self) -> tuple[int, int] | None:
        """Give where the next packet's content begins and ends; None: not all of it is here.

        A length without end is offered as it is.
        """
        data, at, length = self._data, self._at + 1, 0
        for place in range(LENGTH_BYTES):
            if at >= len(data):
                return None
            length |= (data[at] & ~MORE) << 7 * place
            at += 1
            if not data[at - 1] & MORE:
                return (at, at + length) if at + length <= len(data) else None
        return at, len(data)


def acknowledgements(mids: Iterable[int]) -> bytes:
    """Write PUBACK packets for the messages of these numbers (section 3.4)."""
    return b"".join(_ACKNOWLEDGEMENT.pack(PUBACK, 2, mid) for mid in mids)


def publication(topic: str, payload: bytes, mid: int, *, retained: bool) -> bytes:
    """Write a message with quality of service 1 (section 3.3).

    Raises:
        ValueError: a message has no such topic, or it is too long.

    """
    name = topic.encode()
    if not 0 < len(name) <= LONGEST_TOPIC or "+" in topic or "#" in topic:
        message = f"{topic[:100]!r} is no topic of a message"
        raise ValueError(message)
    length = len(name) + len(payload) + 2 * MID_BYTES
    if length > LONGEST:
        message = f"{len(payload)} bytes are too long for a message"
        raise ValueError(message)
    head = bytes((PUBLISH | AT_LEAST_ONCE | retained,)) + _length(length)
    return b"".join((head, len(name).to_bytes(2), name, mid.to_bytes(2), payload))


def _length(number: int) -> bytes:
    """Write a packet's remaining length (section 2.2.3)."""
    written = bytearray()
    while number >= MORE:
        written.append(number & ~MORE & 0xFF | MORE)
        number >>= 7
    written.append(number)
    return bytes(written)


def _read(data: bytearray, at: int, end: int, *, head: int) -> Published | None:
    """Read a message; None: it is of a kind, or wrong in a way, that paho knows what to do with."""
    qos = head >> 1 & 3
    rest = at + 2 + int.from_bytes(data[at : at + 2])
    payload = rest + 2 if qos else rest
    if qos > 1 or rest <= at + 2 or payload > end:
        return None
    try:
        topic = data[at + 2 : rest].decode()
    except UnicodeDecodeError:
        return None
    mid = int.from_bytes(data[rest:payload])
    return Published(topic, bytes(data[payload:end]), qos, bool(head & 1), mid)
