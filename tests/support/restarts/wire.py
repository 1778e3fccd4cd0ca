"""The broker of one robot, and the link of its agent: what was published before the deadly moment stays."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from nena_shared.mqtt import Inbound, MqttLink, Outbound
from support.pausing import time_passes
from support.restarts.fate import Fate


@dataclass
class Wire:
    """All that the robot has published, and who listens."""

    published: list[Outbound] = field(default_factory=list)
    wills: list[Outbound] = field(default_factory=list)
    on_message: Callable[[Outbound], None] = lambda _: None
    link: WiredLink | None = None

    def take(self, message: Outbound) -> None:
        """Receive a message of the robot."""
        self.published.append(message)
        asyncio.get_running_loop().call_soon(self.on_message, message)

    def send(self, topic: str, payload: bytes) -> None:
        """Bring a message to the robot; without an agent it is lost."""
        if self.link:
            self.link.bring(Inbound(topic, payload, retained=False))


class WiredLink(MqttLink):
    """A link that needs no broker."""

    def __init__(self, wire: Wire, fate: Fate, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._wire = wire
        self._fate = fate

    def publish(self, message: Outbound) -> None:
        """Put the message on the wire at once."""
        if not self.state.connected:
            self._queue_message(message)
        elif self._fate.spares(f"before: publish {message.topic}"):
            self._wire.take(message)
            self._fate.spares(f"after: publish {message.topic}")

    async def run(self) -> None:
        """Connect, and stay."""
        will = self._hooks.will()
        await time_passes(0.01)
        self.state.connected = True
        self._publish_all(self._hooks.on_connected())
        self._hooks.on_subscribed()
        self._wire.link = self
        self._publish_all([self._outbox.pop() for _ in range(len(self._outbox))])
        try:
            await asyncio.Event().wait()
        finally:
            self.state.connected, self._wire.link = False, None
            if will:
                self._wire.wills.append(will)

    async def drain(self, seconds: float) -> bool:
        """Wait for nothing: all is on the wire at once."""
        return seconds > 0

    def bring(self, inbound: Inbound) -> None:
        """Deliver a message to the agent, unless it dies first."""
        if self._fate.spares(f"before: take {inbound.topic}"):
            self._handle_message(inbound)

    def _publish_all(self, messages: Iterable[Outbound]) -> None:
        for message in messages:
            self.publish(message)
