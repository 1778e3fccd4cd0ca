"""Read and write MQTT packets of messages and acknowledgements (MQTT 3.1.1 sections 2.2 to 3.4).

Only plain messages and awaited acknowledgements are decoded here; all other packets, including malformed
ones, are passed to paho unchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from struct import Struct
from typing import Final, NamedTuple

from nena_shared.mqtt.message import Outbound

CHUNK: Final = 65_536
"""Maximum bytes per read or write."""

PUBLISH: Final = 0x30
PUBACK: Final = 0x40
PINGREQ: Final = 0xC0
PINGRESP: Final = 0xD0
ID_BYTES: Final = 2
_ACKNOWLEDGEMENT: Final = Struct("!BBH")
MORE: Final = 0x80
"""Bit in a byte of the remaining length: another byte follows."""
LENGTH_BYTES: Final = 4
"""Maximum number of bytes of the remaining length."""
LONGEST: Final = (1 << 7 * LENGTH_BYTES) - 1
LONGEST_TOPIC: Final = 65_535
AT_LEAST_ONCE: Final = 1 << 1
"""QoS 1 in the first byte of a PUBLISH packet."""


class Published(NamedTuple):
    """A received message; ``packet_id`` is 0 for QoS 0, which is not acknowledged."""

    topic: str
    payload: bytes
    qos: int
    retained: bool
    packet_id: int


class Offered(NamedTuple):
    """A packet that paho must read."""

    head: int
    """Its first byte."""


class PacketReader:
    """Splits data from a socket into packets.

    ``receive`` reads from the socket: it raises BlockingIOError if no data is available, returns b"" if the
    connection has ended, and raises other OSErrors if it is broken.
    """

    def __init__(self, receive: Callable[[int], bytes]) -> None:
        self._receive = receive
        self._data = bytearray()
        self._at = 0
        """Start of the next packet, or of the rest of the one offered to paho."""
        self._offered = 0
        """End of the offered packet."""
        self.why_ended = ""
        """Reason why no more data follows; empty while the connection is open."""

    @property
    def ready(self) -> bool:
        """Whether a complete packet, or the end of the connection, is available."""
        return self._bounds() is not None or bool(self.why_ended)

    def fill(self) -> bool:
        """Read available data; return whether there was any.

        Call it only when no packet is ready, to limit the buffer.
        """
        try:
            received = self._receive(CHUNK)
        except BlockingIOError:
            return False
        except OSError as error:
            self.why_ended = f"the connection broke: {error}"
            return False
        if not received:
            self.why_ended = "the broker closed the connection"
        del self._data[: self._at]
        self._at = self._offered = 0
        self._data += received
        return bool(received)

    def next_packet(self, awaited: Container[int]) -> Published | int | Offered | None:
        """Remove and return the next packet: a plain message, or the identifier of an ``awaited`` message.

        Any other packet is offered to paho. None: the packet is incomplete.
        """
        bounds = self._bounds()
        if bounds is None:
            return None
        (start, end), head = bounds, self._data[self._at]
        found: Published | int | None = None
        if head & 0xF0 == PUBLISH:
            found = _read(self._data, start, end, head=head)
        elif head == PUBACK and end - start == ID_BYTES:
            packet_id = int.from_bytes(self._data[start:end])
            found = packet_id if packet_id in awaited else None
        if found is None:
            self._offered = end
            return Offered(head)
        self._at = end
        return found

    def read(self, bufsize: int) -> bytes:
        """Return at most ``bufsize`` bytes of the offered packet.

        Raises:
            BlockingIOError: all of it has been read.

        """
        if self._at >= self._offered:
            raise BlockingIOError
        start, self._at = self._at, min(self._at + bufsize, self._offered)
        return bytes(self._data[start : self._at])

    def _bounds(self) -> tuple[int, int] | None:
        """Return start and end of the next packet's content; None if the packet is incomplete.

        A malformed length is passed on unchanged.
        """
        data, at, length = self._data, self._at + 1, 0
        if at < len(data) and data[at] < MORE:  # most packets
            end = at + 1 + data[at]
            return (at + 1, end) if end <= len(data) else None
        for place in range(LENGTH_BYTES):
            if at >= len(data):
                return None
            length |= (data[at] & ~MORE) << 7 * place
            at += 1
            if not data[at - 1] & MORE:
                return (at, at + length) if at + length <= len(data) else None
        return at, len(data)


def acknowledgements(packet_ids: Iterable[int]) -> bytes:
    """Return PUBACK packets for the messages with these identifiers (section 3.4)."""
    return b"".join(_ACKNOWLEDGEMENT.pack(PUBACK, 2, packet_id) for packet_id in packet_ids)


def publication(message: Outbound, packet_id: int | None = None) -> bytes:
    """Return a PUBLISH packet (section 3.3), with QoS 1 if ``packet_id`` is given, else QoS 0.

    Raises:
        ValueError: the topic is invalid for publishing, or the message is too long.

    """
    name, payload = message.topic.encode(), message.payload
    if not 0 < len(name) <= LONGEST_TOPIC or "+" in message.topic or "#" in message.topic:
        problem = f"{message.topic[:100]!r} is not a valid topic for publishing"
        raise ValueError(problem)
    number = b"" if packet_id is None else packet_id.to_bytes(ID_BYTES)
    length = ID_BYTES + len(name) + len(number) + len(payload)
    if length > LONGEST:
        problem = f"{len(payload)} bytes are too long for a message"
        raise ValueError(problem)
    head = bytes((PUBLISH | (AT_LEAST_ONCE if number else 0) | message.retain,)) + _length(length)
    return b"".join((head, len(name).to_bytes(2), name, number, payload))


def _length(number: int) -> bytes:
    """Encode the remaining length of a packet (section 2.2.3)."""
    written = bytearray()
    while number >= MORE:
        written.append(number & ~MORE & 0xFF | MORE)
        number >>= 7
    written.append(number)
    return bytes(written)


def _read(data: bytearray, at: int, end: int, *, head: int) -> Published | None:
    """Decode a message; None if it is malformed or must be handled by paho."""
    qos = head >> 1 & 3
    rest = at + 2 + int.from_bytes(data[at : at + 2])
    payload = rest + 2 if qos else rest
    if qos > 1 or rest <= at + 2 or payload > end:
        return None
    try:
        topic = data[at + 2 : rest].decode()
    except UnicodeDecodeError:
        return None
    packet_id = int.from_bytes(data[rest:payload])
    return Published(topic, bytes(data[payload:end]), qos, bool(head & 1), packet_id)
