"""The client at a broker that behaves differently from Mosquitto: a few bytes on a socket replace it."""

from __future__ import annotations

import asyncio
import gc
import re
import socket
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from time import monotonic
from typing import Any

import pytest

from nena_shared.mqtt import Inbound, Outbound
from nena_shared.mqtt import client as client_module
from nena_shared.mqtt.client import CLOSED_AT_ONCE, CLOSED_UNANSWERED, NOT_ACCEPTED, Client, MqttError
from nena_shared.settings import MqttSettings
from nena_shared.tasks import end
from support.pausing import turn_passes
from support.waiting import PATIENCE, until

CONNECT = 0x10
SUBSCRIBE = 0x82
CONNACK = b"\x20\x02\x00\x00"
PINGREQ = b"\xc0\x00"
PINGRESP = b"\xd0\x00"


def published(topic: bytes, payload: bytes) -> bytes:
    """Write a PUBLISH packet with quality of service 0."""
    content = len(topic).to_bytes(2) + topic + payload
    assert len(content) < 0x80 * 0x80
    return bytes([0x30, len(content) & 0x7F | 0x80, len(content) >> 7]) + content


@dataclass
class OddBroker:
    """Accepts one client, answers CONNECT and PINGREQ, and sends bytes from the test."""

    ends_at: int | None = None
    """The first byte of the packet at which it ends the connection, if it does."""
    port: int = 0
    pings: int = 0
    heard: bool = False
    """Whether anything has come."""
    got: bytearray = field(default_factory=bytearray)
    """What has come behind CONNECT."""
    reads: asyncio.Event = field(default_factory=asyncio.Event)
    ended: asyncio.Event = field(default_factory=asyncio.Event)
    writer: asyncio.StreamWriter | None = None

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve until the client has disconnected."""
        self.writer = writer
        with suppress(ConnectionError):  # the client has not read all
            while (data := await reader.read(1000)) and self._goes_on(data, writer):
                await self.reads.wait()
        writer.close()
        self.ended.set()

    def _goes_on(self, data: bytes, writer: asyncio.StreamWriter) -> bool:
        if self.heard:
            self.got += data
        else:
            self.heard = True
            writer.write(CONNACK)
        if PINGREQ in data:
            self.pings += 1
            writer.write(PINGRESP)
        return data[0] != self.ends_at

    def send(self, data: bytes) -> None:
        """Send bytes as they are."""
        assert self.writer
        self.writer.write(data)


def client_at(port: int, *, timeout: float = PATIENCE, keep_alive: int = 60) -> Client:
    settings = MqttSettings(port=port).model_copy(update={"keep_alive": keep_alive})
    return Client(settings, "client", timeout=timeout)


@asynccontextmanager
async def odd_broker(ends_at: int | None = None) -> AsyncIterator[OddBroker]:
    broker = OddBroker(ends_at)
    broker.reads.set()
    server = await asyncio.start_server(broker.serve, "127.0.0.1", 0)
    broker.port = server.sockets[0].getsockname()[1]
    async with server:
        yield broker


async def test_backlog_does_not_block_the_event_loop() -> None:
    number = 80
    taken: list[Inbound] = []
    turns: list[int] = []
    async with odd_broker() as broker, client_at(broker.port, timeout=PATIENCE) as client:
        handing = asyncio.create_task(client.receive(taken.append), name="receive")
        await turn_passes()
        broker.send(published(b"a/b", b"x" * 1400) * number)
        async with asyncio.timeout(PATIENCE):
            while len(taken) < number:
                before = len(taken)
                await turn_passes()
                turns.append(len(taken) - before)
        handing.cancel()
    assert max(turns) <= 8


async def test_qos_0_messages_keep_their_position_among_the_others() -> None:
    sent = [Outbound(f"t/{number}", b"x", qos=number % 2) for number in range(6)]
    confirmed: list[str] = []
    async with odd_broker() as broker, client_at(broker.port, timeout=PATIENCE) as client:
        for message in sent:
            client.send(message, partial(confirmed.append, message.topic))
        async with asyncio.timeout(PATIENCE):
            while broker.got.count(b"t/") < len(sent):
                await turn_passes()
        assert re.findall(rb"t/\d", broker.got) == [each.topic.encode() for each in sent]
        assert confirmed == ["t/0", "t/2", "t/4"]


async def test_busy_connection_is_not_considered_dead() -> None:
    number, taken = 2000, 0

    def take(_: Inbound) -> None:
        nonlocal taken
        taken += 1
        busy = monotonic() + 0.002
        while monotonic() < busy:
            pass

    async with (
        odd_broker() as broker,
        client_at(broker.port, timeout=PATIENCE, keep_alive=1) as client,
    ):
        handing = asyncio.create_task(client.receive(take), name="receive")
        await turn_passes()
        broker.send(published(b"a/b", b"x" * 1400) * number)
        async with asyncio.timeout(PATIENCE):
            while taken < number and not handing.done():
                await turn_passes()
        assert taken == number, "four times keep_alive have passed"
        handing.cancel()


async def test_malformed_packet_closes_the_connection() -> None:
    async with odd_broker() as broker:
        client = client_at(broker.port, timeout=PATIENCE)
        await client.__aenter__()
        handing = asyncio.create_task(client.receive(lambda _: None), name="receive")
        await turn_passes()
        broker.send(published(b"a/\xff", b"{}"))
        with pytest.raises(MqttError):
            await asyncio.wait_for(handing, PATIENCE)
        await asyncio.wait_for(broker.ended.wait(), PATIENCE)
        assert client.socket is None


async def test_subscribing_ends_when_the_connection_ends() -> None:
    async with odd_broker(SUBSCRIBE) as broker:
        async with client_at(broker.port, timeout=PATIENCE) as client:
            with pytest.raises(MqttError, match=CLOSED_UNANSWERED):
                await client.subscribe([("a/b", 1)])
        await asyncio.wait_for(broker.ended.wait(), PATIENCE)
        assert client.socket is None


@pytest.mark.parametrize(("ends_at", "reason"), [(CONNECT, CLOSED_AT_ONCE), (SUBSCRIBE, CLOSED_UNANSWERED)])
async def test_reason_of_a_lost_connection_is_reported_once(ends_at: int, reason: str) -> None:
    """asyncio logs errors that were never retrieved when they are garbage-collected."""
    faults = kept_faults()

    async def subscribe(port: int) -> None:
        async with client_at(port, timeout=PATIENCE) as client:
            await client.subscribe([("a/b", 1)])

    async with odd_broker(ends_at) as broker:
        with pytest.raises(MqttError) as told:
            await subscribe(broker.port)
    assert str(told.value) == reason
    del told
    gc.collect()
    await turn_passes()
    assert faults == []


async def test_broker_that_disconnects_before_answering_is_reported_at_once_with_a_hint() -> None:
    async def hang_up(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        writer.close()

    faults = kept_faults()
    async with await asyncio.start_server(hang_up, "127.0.0.1", 0) as server:
        client = client_at(server.sockets[0].getsockname()[1], timeout=10 * PATIENCE)
        with pytest.raises(MqttError, match=rf"^the broker closed the connection {NOT_ACCEPTED[:20]}"):
            await asyncio.wait_for(client.__aenter__(), PATIENCE)
    gc.collect()
    await turn_passes()
    assert faults == []


async def test_connection_established_after_the_timeout_is_closed_without_connect() -> None:
    faults, may_connect = kept_faults(), threading.Event()

    def hold(*_: object) -> None:
        may_connect.wait(PATIENCE)

    async with odd_broker() as broker:
        client = client_at(broker.port, timeout=PATIENCE)
        client._paho.on_pre_connect = hold
        entering = asyncio.create_task(client.__aenter__(), name="enter")
        await turn_passes()
        await end(entering)
        may_connect.set()
        await asyncio.get_running_loop().shutdown_default_executor()
        await asyncio.wait_for(broker.ended.wait(), PATIENCE)

        assert not broker.heard
        assert client._keeping_alive is None
        del client, entering
        gc.collect()
        assert faults == []


async def test_broker_that_stops_reading_is_disconnected_soon(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(client_module, "DISCONNECT_TIMEOUT", 0.2)
    loop, taken = asyncio.get_running_loop(), list[Inbound]()
    async with odd_broker() as broker:
        client = client_at(broker.port, timeout=2 * PATIENCE)
        await client.__aenter__()
        number = connected_socket(client).fileno()
        handing = asyncio.create_task(client.receive(taken.append), name="receive")
        await turn_passes()
        broker.reads.clear()
        fill(client)
        await end(handing)
        broker.send(published(b"a/b", b"late"))
        await asyncio.wait_for(client.__aexit__(None, None, None), PATIENCE)

        assert client.socket is None
        assert not loop.remove_reader(number)
        assert not loop.remove_writer(number)
        await until(
            lambda: client._keeping_alive and client._keeping_alive.done(), what="the end of keep alive"
        )
        broker.reads.set()
        await asyncio.wait_for(broker.ended.wait(), PATIENCE)
    assert taken == []


def kept_faults() -> list[dict[str, Any]]:
    """Return the list of errors that the event loop reports as never retrieved."""
    faults = list[dict[str, Any]]()
    asyncio.get_running_loop().set_exception_handler(lambda _, fault: faults.append(fault))
    return faults


def connected_socket(client: Client) -> socket.socket:
    found = client.socket
    assert found is not None
    return found


def fill(client: Client) -> None:
    """Send more than the sockets accept."""
    for _ in range(40):
        client.send(Outbound("a/b", bytes(1_000_000)), lambda: None)


@pytest.mark.parametrize("discarded", [False, True])
async def test_unsent_bytes_are_discarded_with_the_connection(*, discarded: bool) -> None:
    """As at the end of a lease: only the receiver's own buffer may still hold some of it."""
    with socket.socket() as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        serving = asyncio.get_running_loop().run_in_executor(None, _accepted, listening)
        settings = MqttSettings(port=listening.getsockname()[1])
        async with Client(settings, "sender", timeout=PATIENCE) as client:
            accepted = await serving
            client.send(Outbound("filling", bytes(8_000_000)), lambda: None)
            await turn_passes()
            if discarded:
                client.discard_unsent()
            client._end_connection("as at the end of a lease")
        received = await asyncio.to_thread(_all_of, accepted)

    assert (received > 100_000) is not discarded


def _accepted(listening: socket.socket) -> socket.socket:
    """Accept one client and its CONNECT."""
    accepted, _ = listening.accept()
    accepted.recv(1024)
    accepted.sendall(CONNACK)
    return accepted


def _all_of(accepted: socket.socket) -> int:
    """Count what comes until the connection ends, CONNECT included."""
    count = len(b"\x10\x12\x00\x04MQTT\x04\x02\x00\x3c\x00\x06sender")
    with accepted, suppress(ConnectionResetError):
        while part := accepted.recv(65_536):
            count += len(part)
    return count
