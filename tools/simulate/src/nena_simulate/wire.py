"""An in-process broker: topics, retained messages, delay and loss; and messages that are not encoded."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from random import Random
from typing import TypeVar

from paho.mqtt.client import topic_matches_sub

from nena_shared.mqtt import Handler, Inbound, LinkHooks, LinkState, Outbound
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import codec_for

M = TypeVar("M", bound=Header)

SUBSCRIBING_SECONDS = 0.05
"""Time to connect and to subscribe, seconds."""


class Unencoded(bytes):
    """The payload of a message whose reader is in this process: it gets the message itself."""

    message: Header


class DirectCodec(Codec):
    """Passes messages on as they are; reads encoded ones, which have none for their version yet."""

    @classmethod
    @cache
    def of(cls, version: str) -> DirectCodec:
        """Return the codec of a version: the same one each time, as robots would seem to change theirs."""
        codec = codec_for(version)
        return cls(codec.version, codec.interface_name, codec.forms, codec.rules)

    def encode(self, message: Header) -> bytes:
        """Return a payload with the message."""
        payload = Unencoded(b"{}")
        payload.message = message
        return payload

    def decode(self, kind: type[M], payload: bytes) -> M:
        """Return the message of a payload."""
        if isinstance(payload, Unencoded) and isinstance(payload.message, kind):
            return payload.message
        return super().decode(kind, payload)


class DirectReader(MessageReader):
    """Reads the messages of robots that use a :class:`DirectCodec`."""

    def read(
        self, kind: type[M], topic: str, payload: bytes, major_version: str, robot: RobotKey | None = None
    ) -> M:
        """Return the message of a payload."""
        if isinstance(payload, Unencoded) and isinstance(payload.message, kind):
            return payload.message
        return super().read(kind, topic, payload, major_version, robot)

    def codec_of(self, version: str) -> Codec:
        """Return the codec that passes messages on."""
        return DirectCodec.of(version)


@dataclass(frozen=True, slots=True)
class Conditions:
    """Quality of the network."""

    delay: float = 0.003
    """Delay from publisher to subscriber, seconds."""
    loss: float = 0.0
    """Share of messages that are lost; retained ones never are."""


class Broker:
    """Delivers each message to the subscribers of its topic in the order of publication."""

    def __init__(self, conditions: Conditions, random: Random) -> None:
        self._conditions = conditions
        self._random = random
        self._links: list[Link] = []
        self._retained: dict[str, Outbound] = {}
        self._under_way: deque[tuple[float, Callable[[], None]]] = deque()
        self._hearers: dict[str, tuple[Link, ...]] = {}

    def join(self, link: Link) -> None:
        """Deliver to ``link``, starting with retained messages."""
        self._links.append(link)
        self._hearers.clear()
        for message in self._retained.values():
            if link.wants(message.topic):
                self._send_message(link, message, retained=True)

    def leave(self, link: Link) -> None:
        """Deliver nothing to ``link`` any more."""
        if link in self._links:
            self._links.remove(link)
            self._hearers.clear()

    def publish(self, message: Outbound) -> None:
        """Publish a message."""
        if message.retain and message.payload:
            self._retained[message.topic] = message
        elif message.retain:
            # MQTT 3.1.1, 3.3.1.3: an empty retained message removes the one before.
            self._retained.pop(message.topic, None)
        elif self._conditions.loss and self._random.random() < self._conditions.loss:
            return
        hearers = self._hearers.get(message.topic)
        if hearers is None:
            hearers = self._hearers[message.topic] = tuple(
                link for link in self._links if link.wants(message.topic)
            )
        for hearer in hearers:
            self._send_message(hearer, message, retained=False)

    def _send_message(self, link: Link, message: Outbound, *, retained: bool) -> None:
        loop = asyncio.get_running_loop()
        inbound = Inbound(message.topic, message.payload, retained, message.qos)
        if not self._under_way:
            loop.call_later(self._conditions.delay, self._deliver_messages)
        self._under_way.append((loop.time() + self._conditions.delay, lambda: link.receive(inbound)))

    def _deliver_messages(self) -> None:
        """Deliver the messages that have arrived; all have the same delay, so the oldest arrives first."""
        loop = asyncio.get_running_loop()
        # asyncio may run a timer early, by up to the resolution of its clock.
        while self._under_way and self._under_way[0][0] <= loop.time() + 1e-9:
            self._under_way.popleft()[1]()
        if self._under_way:
            loop.call_at(self._under_way[0][0], self._deliver_messages)


class Link:
    """Replaces a program's link to a broker; a :class:`nena_shared.mqtt.BrokerLink`."""

    def __init__(self, broker: Broker, hooks: LinkHooks | None = None) -> None:
        self.state = LinkState()
        self._broker = broker
        self._events = hooks or LinkHooks()
        self._topics: list[tuple[str, Handler]] = []
        self._by_topic: dict[str, tuple[Handler, ...]] = {}
        self._away = asyncio.Event()
        self._away_for = 0.0

    @classmethod
    def maker(cls, broker: Broker) -> Callable[..., Link]:
        """Return a factory with the parameters of ``MqttLink``."""

        def make(_settings: object, *, client_id: str, hooks: LinkHooks) -> Link:
            del client_id
            return cls(broker, hooks)

        return make

    def subscribe(self, topic_filter: str, handler: Handler, *, qos: int = 1, needed: bool = True) -> None:
        """Call ``handler`` with each message under ``topic_filter``."""
        del qos, needed
        self._topics.append((topic_filter, handler))

    def subscribe_by_name(self, topic: str) -> None:
        """Do nothing: wildcard subscriptions get all retained messages here."""

    def publish(self, message: Outbound) -> None:
        """Send ``message``, if the link is up."""
        if self.state.connected:
            self.state.published += 1
            self._broker.publish(message)
        else:
            self.state.dropped += 1

    def wants(self, topic: str) -> bool:
        """Return whether the program has subscribed to a topic."""
        return bool(self._handlers_of(topic))

    def receive(self, message: Inbound) -> None:
        """Receive a message from the broker."""
        if not self.state.connected:
            return
        self.state.received += 1
        for handler in self._handlers_of(message.topic):
            handler(message)

    async def run(self) -> None:
        """Keep the link up until cancelled, except while it is cut."""
        while True:
            await asyncio.sleep(SUBSCRIBING_SECONDS)
            self.state.connected = True
            self.state.connects += 1
            for message in self._events.on_connected():
                self._broker.publish(message)
            self._broker.join(self)
            self._events.on_subscribed()
            self._away.clear()
            await self._away.wait()
            self.state.connected = False
            self._broker.leave(self)
            if will := self._events.will():
                self._broker.publish(will)
            self._events.on_lost()
            await asyncio.sleep(self._away_for)

    def cut(self, seconds: float) -> None:
        """Cut the link for ``seconds``."""
        self._away_for = seconds
        self._away.set()

    async def read_waiting(self, seconds: float) -> None:
        """Return at once, because each message is read when it arrives."""

    async def drain(self, seconds: float) -> bool:
        """Return at once, because no messages are queued here."""
        del seconds
        return self.state.connected

    def _handlers_of(self, topic: str) -> tuple[Handler, ...]:
        handlers = self._by_topic.get(topic)
        if handlers is None:
            handlers = self._by_topic[topic] = tuple(
                handler for each, handler in self._topics if topic_matches_sub(each, topic)
            )
        return handlers
