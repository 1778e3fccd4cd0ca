"""Corrects the statuses that the broker has retained from before this program had the lead.

A crash may have kept the last status of an order from being published, and a program that another one has
replaced may have published old ones.
"""

from __future__ import annotations

import asyncio

from nena_order_service.engine import Engine
from nena_order_service.mqtt_door import MqttDoor
from nena_shared.fleet_api.epoch import epoch_of
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.settings import MqttSettings
from nena_shared.tasks import end

log = get_logger(__name__)

TERM_POLL = 0.25
"""Seconds between two looks at whether the broker is connected, in a new term."""

LISTEN = 2.0
"""Seconds in which a broker hands out what it has retained."""


class RetainedSweep:
    """Reads once in each term of leadership what the broker has retained, over a link of its own.

    The program's own link does not subscribe to it: it would get back all that it publishes.
    """

    def __init__(
        self,
        settings: MqttSettings,
        topics: FleetTopics,
        *,
        client_id: str,
        mqtt: MqttLink,
        engine: Engine,
        door: MqttDoor,
        epoch: int = 0,
    ) -> None:
        self._epoch = epoch
        self._mqtt = mqtt
        self._topics = topics
        self._engine = engine
        self._door = door
        self._settings = settings.model_copy(update={"client_id": None})
        self._client_id = client_id
        self._names: set[str] = set()
        self._sequences: set[str] = set()
        self._vehicles: set[str] = set()

    async def run(self) -> None:
        """Sweep once the broker is connected, on a shared store again in each new term."""
        link, swept = self._mqtt.state, None
        while swept is None or self._epoch:
            if link.connected and link.term != swept:
                swept = link.term
                await self._sweep()
            else:
                await asyncio.sleep(TERM_POLL)

    async def _sweep(self) -> None:
        """Listen for a while once the broker is there, then correct what is stale."""
        connected = asyncio.Event()

        def greet() -> tuple[Outbound, ...]:
            connected.set()
            return ()

        link = MqttLink(self._settings, client_id=self._client_id, on_connected=greet)
        link.subscribe(self._topics.all_order_statuses, self._note)
        link.subscribe(self._topics.all_sequence_statuses, self._note_sequence)
        link.subscribe(self._topics.all_vehicle_statuses, self._note_vehicle)
        listening = asyncio.create_task(link.run(), name="retained statuses")
        try:
            await connected.wait()
            await asyncio.sleep(LISTEN)
        finally:
            await end(listening)
        for serial_number in sorted(self._vehicles):
            self._correct_vehicle(serial_number)
        for name in sorted(self._names):
            await self._put_right(name)
        for name in sorted(self._sequences):
            await self._put_sequence_right(name)
        self._names.clear()
        self._sequences.clear()
        self._vehicles.clear()

    def _is_stale(self, message: Inbound) -> bool:
        """Return whether another order service published a retained status."""
        return epoch_of(message.payload) != self._epoch

    def _note(self, message: Inbound) -> None:
        name = message.topic.split("/")[-2]
        if message.retained and message.payload and (self._is_stale(message) or not self._lives(name)):
            self._names.add(name)

    def _note_sequence(self, message: Inbound) -> None:
        name = message.topic.split("/")[-2]
        known = self._engine.state.sequences.visible(name)
        if message.retained and message.payload and (self._is_stale(message) or not known):
            self._sequences.add(name)

    def _note_vehicle(self, message: Inbound) -> None:
        if message.retained and message.payload and self._is_stale(message):
            self._vehicles.add(message.topic.split("/")[-2])

    def _correct_vehicle(self, serial_number: str) -> None:
        found = [each for each in self._engine.registry if each.key.serial_number == serial_number]
        for vehicle in found:
            self._door.vehicle_changed(self._engine.status(vehicle))
        if not found:
            log.warning("clearing the status of an unknown vehicle", serial_number=serial_number)
            self._mqtt.publish(Outbound(self._topics.vehicle_status(serial_number), b"", retain=True))

    async def _put_sequence_right(self, name: str) -> None:
        if sequence := self._engine.state.sequences.visible(name):
            self._door.sequence_changed(sequence.status)
            return
        stored = await self._engine.store.sequence(name=name)
        if stored and stored.status.finished:
            log.info("the end of an order sequence is told again", sequence=name)
            self._door.sequence_changed(stored.status)
        elif stored is None:
            log.warning("the status of a sequence that is not in the store is cleared", sequence=name)
            self._mqtt.publish(Outbound(self._topics.sequence_status(name), b"", retain=True))

    async def _put_right(self, name: str) -> None:
        order = self._engine.state.orders.visible_named(name)
        if order is not None and not order.state.final:
            self._door.order_changed(order.status)
            return
        stored = await self._engine.store.order(name=name)
        if stored and stored.state.final:
            log.info("the end of an order is told again", order=name, state=stored.state.value)
            self._door.order_changed(stored.status)
        elif stored is None:
            log.warning("the status of an order that is not in the store is cleared", order=name)
            self._mqtt.publish(Outbound(self._topics.order_status(name), b"", retain=True))

    def _lives(self, name: str) -> bool:
        order = self._engine.state.orders.visible_named(name)
        return order is not None and not order.state.final
