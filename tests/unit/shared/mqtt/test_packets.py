from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.mqtt.message import Outbound
from nena_shared.mqtt.packets import (
    LONGEST,
    PUBACK,
    Offered,
    PacketReader,
    Published,
    acknowledgements,
    publication,
)

PINGRESP = b"\xd0\x00"


def length(number: int) -> bytes:
    """Write a packet's remaining length (section 2.2.3)."""
    written = bytearray()
    while True:
        number, digit = divmod(number, 128)
        written.append(digit | (0x80 if number else 0))
        if not number:
            return bytes(written)


def publish(topic: bytes, payload: bytes, *, qos: int = 0, retained: bool = False, mid: int = 7) -> bytes:
    content = len(topic).to_bytes(2) + topic + (mid.to_bytes(2) if qos else b"") + payload
    return bytes([0x30 | qos << 1 | retained]) + length(len(content)) + content


def wire(*came: bytes | OSError) -> PacketReader:
    """Return a reader of a socket with this input, piece by piece, and then nothing."""
    left = list(came)

    def receive(_: int) -> bytes:
        if not left:
            raise BlockingIOError
        piece = left.pop(0)
        if isinstance(piece, OSError):
            raise piece
        return piece

    return PacketReader(receive)


def read_all(packets: PacketReader) -> bytes:
    """Read as paho does what is offered: byte by byte."""
    found = b""
    while True:
        try:
            byte = packets.read(1)
        except BlockingIOError:
            return found
        if not byte:
            return found
        found += byte


def test_messages_are_extracted_and_other_packets_offered() -> None:
    packets = wire(publish(b"a/b", b"one") + PINGRESP + publish(b"c", b"two", qos=1, retained=True, mid=300))
    assert packets.fill()
    assert packets.next_packet(()) == Published("a/b", b"one", 0, retained=False, packet_id=0)
    assert packets.next_packet(()) == Offered(PINGRESP[0])
    assert read_all(packets) == PINGRESP
    assert packets.next_packet(()) == Published("c", b"two", 1, retained=True, packet_id=300)
    assert not packets.ready
    assert packets.next_packet(()) is None


def test_incomplete_packets_are_not_offered() -> None:
    whole = publish(b"a", bytes(300))
    packets = wire(whole[:1], whole[1:2], whole[2:200], whole[200:] + PINGRESP[:1], PINGRESP[1:])
    for _ in range(3):
        packets.fill()
        assert not packets.ready
        assert packets.next_packet(()) is None
    packets.fill()
    assert packets.next_packet(()) == Published("a", bytes(300), 0, retained=False, packet_id=0)
    assert not packets.ready
    packets.fill()
    assert packets.next_packet(()) == Offered(PINGRESP[0])
    assert read_all(packets) == PINGRESP


@pytest.mark.parametrize(
    "packet",
    [
        publish(b"a", b"x", qos=2),
        publish(b"a", b"x", qos=3),
        publish(b"\xff\xfe", b"x"),
        publish(b"", b"x"),
        b"\x30\x03\x00\x09a",
        b"\x32\x03\x00\x01a",
        b"\x30\x00",
        b"\x30\x01\x00",
        b"\x30\xff\xff\xff\xff\x01",
    ],
    ids=[
        "qos 2",
        "qos 3",
        "not UTF-8",
        "not a valid topic",
        "short topic",
        "no number",
        "empty",
        "cut",
        "endless length",
    ],
)
def test_unusual_or_malformed_packets_are_unchanged(packet: bytes) -> None:
    packets = wire(packet)
    packets.fill()
    assert packets.next_packet(()) == Offered(packet[0])
    assert read_all(packets) == packet


@pytest.mark.parametrize(
    ("end", "why"),
    [
        (b"", "the broker closed the connection"),
        (ConnectionResetError("reset"), "the connection broke: reset"),
    ],
)
def test_end_of_connection_follows_the_remaining_packets(end: bytes | OSError, why: str) -> None:
    packets = wire(PINGRESP, end)
    packets.fill()
    packets.fill()
    assert packets.next_packet(()) == Offered(PINGRESP[0])
    assert packets.read(2) == PINGRESP
    assert packets.ready
    assert packets.next_packet(()) is None
    assert packets.why_ended == why


def test_acknowledgements_follow_each_other() -> None:
    assert acknowledgements([1, 300]) == b"\x40\x02\x00\x01\x40\x02\x01\x2c"


@pytest.mark.parametrize("size", [0, 1, 120, 121, 16_376, 16_377, 2_097_144, 2_097_145])
def test_a_message_is_written_as_the_standard_has_it(size: int) -> None:
    written = publication(Outbound("a/é", bytes(size), retain=size == 0), 300)
    assert written == publish("a/é".encode(), bytes(size), qos=1, retained=size == 0, mid=300)
    unconfirmed = publication(Outbound("a/é", bytes(size), 0, retain=size == 0))
    assert unconfirmed == publish("a/é".encode(), bytes(size), retained=size == 0)


@pytest.mark.parametrize("topic", ["", "a/+", "#", "ä" * 32_768, "\ud800"])
def test_invalid_topic_is_refused(topic: str) -> None:
    with pytest.raises(ValueError, match=r"topic|surrogates"):
        publication(Outbound(topic, b"x"), 1)


class Endless(bytes):
    """Bytes longer than any message, which are never materialised."""

    def __len__(self) -> int:
        return LONGEST


def test_a_message_that_is_too_long_is_not_written() -> None:
    with pytest.raises(ValueError, match="too long"):
        publication(Outbound("a", Endless()), 1)


def test_awaited_acknowledgements_are_extracted() -> None:
    packets = wire(acknowledgements([1, 300, 2]))
    packets.fill()
    assert packets.next_packet({1, 300}) == 1
    assert packets.next_packet({1, 300}) == 300
    assert packets.next_packet({1, 300}) == Offered(PUBACK)
    assert read_all(packets) == acknowledgements([2])


@pytest.mark.parametrize(
    "packet",
    [PINGRESP, b"\x40\x00", b"\x40\x03\x00\x01\x00", b"\x42\x02\x00\x01", b"\x40\x02\x00", b""],
    ids=["another", "no number", "too long", "flags", "cut", "nothing"],
)
def test_other_acknowledgements_are_not_extracted(packet: bytes) -> None:
    packets = wire(packet or PINGRESP)
    if packet:
        packets.fill()
    assert not isinstance(packets.next_packet(range(65_536)), int)


@given(
    st.lists(
        st.tuples(
            st.text(st.characters(codec="utf-8"), min_size=1, max_size=20),
            st.binary(max_size=400),
            st.integers(0, 1),
            st.booleans(),
        ),
        max_size=8,
    ),
    st.lists(st.integers(1, 300), min_size=1, max_size=10),
)
def test_messages_are_reassembled_from_any_chunks(
    messages: list[tuple[str, bytes, int, bool]], cuts: list[int]
) -> None:
    stream = b"".join(
        publish(topic.encode(), payload, qos=qos, retained=retained) + PINGRESP
        for topic, payload, qos, retained in messages
    )
    pieces, number = [], 0
    while stream:
        size = cuts[number % len(cuts)]
        number += 1
        pieces.append(stream[:size])
        stream = stream[size:]
    packets, found, others = wire(*pieces), [], b""
    for _ in pieces:
        packets.fill()
        while packets.ready:
            packet = packets.next_packet(())
            if isinstance(packet, Published):
                found.append(packet)
            else:
                assert packet == Offered(PINGRESP[0])
                others += read_all(packets)
    assert found == [
        Published(topic, payload, qos, retained, 7 if qos else 0)
        for topic, payload, qos, retained in messages
    ]
    assert others == PINGRESP * len(messages)
