"""When the link sets topics aside, and when it sends on them again."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from enum import Enum, auto

import pytest

from nena_shared.mqtt import MqttLink, Outbound
from nena_shared.mqtt import link as link_module
from nena_shared.settings import MqttSettings
from nena_shared.tasks import end
from support.pausing import time_passes
from support.waiting import until

CONNECT, PUBLISH, SUBSCRIBE = 1, 3, 8
CONNACK, SUBACK = b"\x20\x02\x00\x00", b"\x90\x03"
PUBACK = b"\x40\x02"


class Answer(Enum):
    ACKNOWLEDGE = auto()
    CLOSE = auto()
    NONE = auto()


@dataclass
class ScriptedBroker:
    """Accepts all connections and subscriptions; ``answer`` decides about each topic."""

    answer: Callable[[str], Answer] = lambda _: Answer.ACKNOWLEDGE
    accepted: list[str] = field(default_factory=list)
    """Topics of acknowledged messages."""
    port: int = 0

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(asyncio.IncompleteReadError, ConnectionError):
            while True:
                head, length = await reader.readexactly(2)  # short packets only
                packet = await reader.readexactly(length)
                kind = head >> 4
                if kind == CONNECT:
                    writer.write(CONNACK)
                elif kind == SUBSCRIBE:
                    writer.write(SUBACK + packet[:2] + b"\x01")
                elif kind == PUBLISH and not self._publish(head, packet, writer):
                    break
        writer.close()

    def _publish(self, head: int, packet: bytes, writer: asyncio.StreamWriter) -> bool:
        end_of_topic = 2 + int.from_bytes(packet[:2])
        topic = packet[2:end_of_topic].decode()
        answer = self.answer(topic)
        if answer is Answer.ACKNOWLEDGE:
            self.accepted.append(topic)
            if head & 0b110:
                writer.write(PUBACK + packet[end_of_topic : end_of_topic + 2])
        return answer is not Answer.CLOSE


@asynccontextmanager
async def connected(broker: ScriptedBroker, keep_alive: int = 60) -> AsyncIterator[MqttLink]:
    """Run a link to the broker, which is connected when the block begins."""
    server = await asyncio.start_server(broker.serve, "127.0.0.1", 0)
    broker.port = server.sockets[0].getsockname()[1]
    settings = MqttSettings(port=broker.port, keep_alive=keep_alive, reconnect_min=0.02, reconnect_max=0.1)
    link = MqttLink(settings, client_id="link")
    link.subscribe("commands", lambda _: None)
    task = asyncio.create_task(link.run(), name="link")
    try:
        await until(lambda: link.state.connected)
        yield link
    finally:
        await end(task)
        server.close()


def closes_at(*topics: str) -> Callable[[str], Answer]:
    return lambda topic: Answer.CLOSE if topic in topics else Answer.ACKNOWLEDGE


@pytest.mark.parametrize("qos", [0, 1])
async def test_a_topic_is_sent_again_once_the_broker_accepts_it(
    monkeypatch: pytest.MonkeyPatch, qos: int
) -> None:
    monkeypatch.setattr(link_module, "SET_ASIDE_FOR", 0.2)
    broker = ScriptedBroker(closes_at("order"))
    async with connected(broker) as link:
        link.publish(Outbound("order", b"1", qos=qos))
        while not link.state.set_aside:
            link.publish(Outbound("order", b"1", qos=qos))
            await time_passes(0.05)

        broker.answer = closes_at()
        await until(lambda: link.state.connected and not link.state.set_aside)
        link.publish(Outbound("order", b"2", qos=qos))
        await until(lambda: "order" in broker.accepted)


async def test_a_topic_that_is_still_refused_ends_one_more_connection_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(link_module, "SET_ASIDE_FOR", 0.2)
    broker = ScriptedBroker(closes_at("order"))
    async with connected(broker) as link:
        link.publish(Outbound("order", b"1"))
        await until(lambda: link.state.set_aside)
        await until(lambda: link.state.connected and not link.state.set_aside)
        connects = link.state.connects
        link.publish(Outbound("order", b"2"))
        link.publish(Outbound("other", b"2"))
        await until(lambda: link.state.set_aside)
        await until(lambda: "other" in broker.accepted)
        assert link.state.connects == connects + 1


async def test_other_messages_do_not_wait_for_the_acknowledgement_of_a_suspect(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(link_module, "SOON", 0.3)
    broker = ScriptedBroker(lambda topic: Answer.CLOSE if topic == "last" else Answer.NONE)
    async with connected(broker) as link:
        for topic in ("slow", "a", "b"):
            link.publish(Outbound(topic, b"1"))
        link.publish(Outbound("last", b"1", keep=False))
        await until(lambda: not link.state.connected)

        broker.answer = lambda topic: Answer.NONE if topic == "slow" else Answer.ACKNOWLEDGE
        await until(lambda: {"a", "b"} <= set(broker.accepted))
        assert link.state.set_aside == {}


async def test_a_broker_that_no_longer_answers_refuses_nothing() -> None:
    """The keep-alive ends the connection, not the broker."""
    broker = ScriptedBroker(lambda _: Answer.NONE)
    async with connected(broker, keep_alive=2) as link:
        link.publish(Outbound("order", b"1"))
        await until(lambda: link.state.connects == 3 or link.state.set_aside)
        assert link.state.set_aside == {}
        broker.answer = closes_at()
        await until(lambda: "order" in broker.accepted)
