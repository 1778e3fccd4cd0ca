"""A proxy to a broker that understands MQTT: it holds, delays, swaps, repeats and drops messages.

Unlike ``support.network`` it needs no privileges, and it can reproduce a broker's errors.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from enum import StrEnum
from random import Random

from nena_shared.tasks import end
from support.broker import BrokerAddress
from support.pausing import time_passes
from support.waiting import PATIENCE

PUBLISH, PUBACK = 3, 4
HOLD_LOOK = 0.02
"""Interval between checks whether a held direction is released, seconds."""
LONGEST_LENGTH = 4
"""Maximum bytes of the remaining length of a packet."""


class Way(StrEnum):
    """A direction of the line."""

    TO_BROKER = "to the broker"
    FROM_BROKER = "from the broker"


@dataclass
class Conduct:
    """Treatment of packets; may be changed at any time, from any thread."""

    held: set[Way] = field(default_factory=set)
    """Held directions, as if the network were cut there; the data arrives once they are released."""
    down: bool = False
    """Whether all connections are closed, and new ones at once."""
    delay: float = 0.0
    """Delay in each direction, seconds."""
    swapped: float = 0.0
    """Share of the broker's messages that are overtaken by the following one."""
    repeated: float = 0.0
    """Share of the messages in each direction that arrive twice."""
    swallowed: bool = False
    """Whether the broker's messages are dropped, but acknowledged."""


class MqttLine(BrokerAddress):
    """Listens on a separate port, and connects to the broker for each client."""

    def __init__(self, broker: BrokerAddress, seed: int) -> None:
        super().__init__()
        self.username, self.password = broker.username, broker.password
        self.conduct = Conduct()
        self.messages = 0
        """Packets received from the broker."""
        self._broker = broker
        self._chance = Random(seed)

    async def serve(self, stop: asyncio.Event, ready: threading.Event) -> None:
        """Serve until ``stop`` is set."""
        connections: set[asyncio.Task[None]] = set()

        def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            task = asyncio.create_task(self._connect(reader, writer))
            connections.add(task)
            task.add_done_callback(connections.discard)

        server = await asyncio.start_server(take, self.host, self.port)
        ready.set()
        await stop.wait()
        server.close()
        await end(*connections)

    async def _connect(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self.conduct.down:
            writer.close()
            return
        try:
            from_broker, to_broker = await asyncio.open_connection(self._broker.host, self._broker.port)
        except OSError:
            writer.close()
            return
        ways = (
            asyncio.create_task(self._carry(Way.TO_BROKER, reader, to_broker, writer)),
            asyncio.create_task(self._carry(Way.FROM_BROKER, from_broker, writer, to_broker)),
            asyncio.create_task(self._until_down()),
        )
        try:
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        finally:
            await end(*ways)
            for each in (writer, to_broker):
                each.close()

    async def _until_down(self) -> None:
        while not self.conduct.down:
            await time_passes(HOLD_LOOK)

    async def _carry(
        self, way: Way, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, back: asyncio.StreamWriter
    ) -> None:
        """Forward packets in one direction until a side closes; ``back`` leads to their sender."""
        kept: bytes | None = None
        with suppress(OSError, asyncio.IncompleteReadError):
            while True:
                packet = await _packet(reader)
                if self.conduct.delay:
                    await time_passes(self.conduct.delay)
                while way in self.conduct.held:
                    await time_passes(HOLD_LOOK)
                if packet[0] >> 4 != PUBLISH:
                    writer.write(packet)
                    continue
                self.messages += way is Way.FROM_BROKER
                if self.conduct.swallowed and way is Way.FROM_BROKER:
                    back.write(_acknowledgement(packet))
                    continue
                if kept is None and way is Way.FROM_BROKER and self._chance.random() < self.conduct.swapped:
                    kept = packet
                    continue
                times = 2 if self._chance.random() < self.conduct.repeated else 1
                writer.write(packet * times + (kept or b""))
                kept = None
                await writer.drain()


async def _packet(reader: asyncio.StreamReader) -> bytes:
    head = await reader.readexactly(2)
    while head[-1] & 0x80 and len(head) <= LONGEST_LENGTH:
        head += await reader.readexactly(1)
    length = sum((byte & 0x7F) << 7 * number for number, byte in enumerate(head[1:]))
    return head + await reader.readexactly(length)


def _acknowledgement(publish: bytes) -> bytes:
    """Return the PUBACK of a message; empty for QoS 0."""
    if not publish[0] >> 1 & 3:
        return b""
    start = 1 + next(number for number, byte in enumerate(publish[1:], 1) if not byte & 0x80)
    topic = int.from_bytes(publish[start : start + 2], "big")
    number = publish[start + 2 + topic : start + 4 + topic]
    return bytes([PUBACK << 4, len(number)]) + number


@contextmanager
def mqtt_line(broker: BrokerAddress, *, seed: int = 1) -> Iterator[MqttLine]:
    """Run a proxy in a separate thread until the block ends."""
    line, ready = MqttLine(broker, seed), threading.Event()
    loop, stop = asyncio.new_event_loop(), asyncio.Event()

    def work() -> None:
        loop.run_until_complete(line.serve(stop, ready))
        loop.close()

    thread = threading.Thread(target=work, name=f"MQTT line {line.port}", daemon=True)
    thread.start()
    assert ready.wait(PATIENCE), "the line listens"
    try:
        yield line
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join(PATIENCE)
