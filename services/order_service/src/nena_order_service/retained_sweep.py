"""Tells at the start the end of orders and sequences whose last status a crash has kept from being told."""

from __future__ import annotations

import asyncio

from nena_order_service.kernel.kernel import Kernel
from nena_order_service.mqtt_door import MqttDoor
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.settings import MqttSettings
from nena_shared.tasks import end

log = get_logger(__name__)

LISTEN = 2.0
"""Seconds in which a broker hands out what it has retained."""


class RetainedSweep:
    """Looks once at the statuses that the broker has retained, over a link of its own.

    The program's own link does not subscribe to them: it would get back all that it publishes.
    """

    def __init__(
        self,
        settings: MqttSettings,
        topics: FleetTopics,
        *,
        client_id: str,
        mqtt: MqttLink,
        kernel: Kernel,
        door: MqttDoor,
    ) -> None:
        self._mqtt = mqtt
        self._topics = topics
        self._kernel = kernel
        self._door = door
        own_id = settings.model_copy(update={"client_id": None})
        self._connected = asyncio.Event()
        self._link = MqttLink(own_id, client_id=client_id, on_connected=self._greet)
        self._link.subscribe(topics.all_order_statuses, self._note)
        self._link.subscribe(topics.all_sequence_statuses, self._note_sequence)
        self._names: set[str] = set()
        self._sequences: set[str] = set()

    async def run(self) -> None:
        """Listen for a while once the broker is there, then put right what is stale."""
        listening = asyncio.create_task(self._link.run(), name="retained statuses")
        try:
            await self._connected.wait()
            await asyncio.sleep(LISTEN)
        finally:
            await end(listening)
        for name in sorted(self._names):
            await self._put_right(name)
        for name in sorted(self._sequences):
            await self._put_sequence_right(name)

    def _greet(self) -> tuple[Outbound, ...]:
        self._connected.set()
        return ()

    def _note(self, message: Inbound) -> None:
        name = message.topic.split("/")[-2]
        if message.retained and message.payload and not self._lives(name):
            self._names.add(name)

    def _note_sequence(self, message: Inbound) -> None:
        name = message.topic.split("/")[-2]
        if message.retained and message.payload and not self._kernel.sequence_book.visible(name):
            self._sequences.add(name)

    async def _put_sequence_right(self, name: str) -> None:
        if self._kernel.sequence_book.visible(name):
            return
        stored = await self._kernel.store.sequence(name=name)
        if stored and stored.status.finished:
            log.info("the end of an order sequence is told again", sequence=name)
            self._door.sequence_changed(stored.status)
        elif stored is None:
            log.warning("the status of a sequence that is not in the store is cleared", sequence=name)
            self._mqtt.publish(Outbound(self._topics.sequence_status(name), b"", retain=True))

    async def _put_right(self, name: str) -> None:
        if self._lives(name):
            return
        stored = await self._kernel.store.order(name=name)
        if stored and stored.state.final:
            log.info("the end of an order is told again", order=name, state=stored.state.value)
            self._door.order_changed(stored.status)
        elif stored is None:
            log.warning("the status of an order that is not in the store is cleared", order=name)
            self._mqtt.publish(Outbound(self._topics.order_status(name), b"", retain=True))

    def _lives(self, name: str) -> bool:
        order = self._kernel.book.visible_named(name)
        return order is not None and not order.state.final
