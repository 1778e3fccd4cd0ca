"""Publish retained statuses over MQTT: at each change, at each connect, and after a crash."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from typing import Final

from pydantic import BaseModel

from nena_order_service.engine.engine import Engine
from nena_order_service.errors import StoreNotReadyError
from nena_shared.clock import Clock
from nena_shared.fleet_api.epoch import epoch_of, with_epoch
from nena_shared.fleet_api.peripherals import PeripheralJobStatus
from nena_shared.fleet_api.service_status import HEARTBEAT, ServiceStatus
from nena_shared.fleet_api.stops import SetBy, StopStatus
from nena_shared.fleet_api.topics import FleetTopics, PeripheralTopic
from nena_shared.fleet_api.transport_order import OrderSequenceStatus, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, LinkHooks, MqttLink, Outbound
from nena_shared.mqtt.broker_check import BrokerLack
from nena_shared.settings import MqttSettings
from nena_shared.tasks import end, set_within

log = get_logger(__name__)

ENDS_KEPT: Final = 1000
"""Maximum number of ended orders whose status stays retained; beyond, the oldest is cleared at once."""


class EndedOrders:
    """Calls ``clear`` with the name of each order ``kept`` seconds after its end; event loop only.

    Until then, a host that was disconnected finds the final status at the broker, and a broker that has lost
    its data receives it again.
    """

    def __init__(self, kept: float, clear: Callable[[str], None]) -> None:
        self._kept = kept
        self._clear_status = clear
        self._ends: OrderedDict[str, tuple[float, TransportOrderStatus]] = OrderedDict()
        """Statuses by order name, the oldest first, with the time at which they are cleared."""
        self._clearing: asyncio.TimerHandle | None = None

    def add(self, status: TransportOrderStatus) -> None:
        """Keep the final status of an order; if it is published again, for the whole time."""
        # Assigning to a present name would keep its place, and the oldest must stay first.
        self._ends.pop(status.name, None)
        self._ends[status.name] = asyncio.get_running_loop().time() + self._kept, status
        if len(self._ends) > ENDS_KEPT:
            self._forget_oldest()
        if self._clearing is None:
            self._clear_in_time()

    def statuses(self) -> tuple[TransportOrderStatus, ...]:
        """Return the kept statuses of ended orders, the oldest first."""
        return tuple(status for _, status in self._ends.values())

    def close(self) -> None:
        """Clear no more topics."""
        if self._clearing:
            self._clearing.cancel()
        self._ends.clear()

    def _clear_in_time(self) -> None:
        """Clear the topics whose time has come, and call this again at the time of the next one."""
        loop = asyncio.get_running_loop()
        while self._ends and (due := next(iter(self._ends.values()))[0]) <= loop.time():
            self._forget_oldest()
        self._clearing = loop.call_at(due, self._clear_in_time) if self._ends else None

    def _forget_oldest(self) -> None:
        self._clear_status(self._ends.popitem(last=False)[0])


class StatusPublisher:
    """Publishes each change of orders, sequences and vehicles, and the plant model, all retained."""

    def __init__(
        self,
        mqtt: MqttLink,
        topics: FleetTopics,
        engine: Engine,
        *,
        plant_json: bytes,
        end_kept: float,
        epoch: int = 0,
    ) -> None:
        self.mqtt = mqtt
        self.topics = topics
        self._engine = engine
        self._plant_json = plant_json
        self.epoch = epoch
        self._ended = EndedOrders(end_kept, self._clear_status)

    def greeting(self) -> Iterator[Outbound]:
        """Yield the messages for each new connection, because the broker may have lost its data.

        The link reads them in parts; later changes are published after them.
        """
        yield Outbound(self.topics.plant_model, self._plant_json, retain=True)
        yield from self.statuses()

    def statuses(self) -> Iterator[Outbound]:
        """Yield the statuses of all vehicles and devices, and of orders and sequences that are retained."""
        for vehicle in tuple(self._engine.registry):
            yield self._vehicle_message(self._engine.reporter.vehicle_status(vehicle))
        for location in self._engine.peripherals.operations:
            yield self._peripheral_message(location)
        for sequence in tuple(self._engine.state.sequences.unfinished()):
            yield self._sequence_message(sequence.status)
        for order in tuple(self._engine.state.orders.unfinished()):
            yield self._order_message(order.status)
        for status in self._ended.statuses():
            yield self._order_message(status)

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Publish an order's new version; the topic is cleared some time after the last one."""
        self.mqtt.publish(self._order_message(status))
        if status.state.final:
            self._ended.add(status)

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        """Publish an order sequence's new version; after the last one, clear the topic."""
        self.mqtt.publish(self._sequence_message(status))
        if status.finished:
            self.mqtt.publish(Outbound(self.topics.sequence_status(status.name), b"", retain=True))

    def vehicle_changed(self, status: VehicleStatus) -> None:
        """Publish a vehicle's status."""
        self.mqtt.publish(self._vehicle_message(status))

    def job_changed(self, status: PeripheralJobStatus) -> None:
        """Publish nothing: the status of its device has the job."""

    def peripheral_changed(self, location: str) -> None:
        """Publish a device's status."""
        if location in self._engine.peripherals.operations:
            self.mqtt.publish(self._peripheral_message(location))

    def close(self) -> None:
        """Clear no more topics; the next start clears those of ended orders."""
        self._ended.close()

    def _clear_status(self, name: str) -> None:
        self.mqtt.publish(Outbound(self.topics.order_status(name), b"", retain=True))

    def _order_message(self, status: TransportOrderStatus) -> Outbound:
        return self._status_message(self.topics.order_status(status.name), status)

    def _sequence_message(self, status: OrderSequenceStatus) -> Outbound:
        return self._status_message(self.topics.sequence_status(status.name), status)

    def _vehicle_message(self, status: VehicleStatus) -> Outbound:
        return self._status_message(self.topics.vehicle_status(status.serial_number), status)

    def _peripheral_message(self, location: str) -> Outbound:
        topic = self.topics.peripheral(location, PeripheralTopic.STATUS)
        return self._status_message(topic, self._engine.peripherals.device_status(location))

    def _status_message(self, topic: str, status: BaseModel) -> Outbound:
        return Outbound(
            topic, with_epoch(status.model_dump_json(by_alias=True).encode(), self.epoch), retain=True
        )


LOCKED_PATHS_SHOWN: Final = 100
"""Maximum number of locked paths in a heartbeat."""


class Heartbeat:
    """Shows every :data:`HEARTBEAT` seconds that the event loop runs and the broker is connected."""

    def __init__(
        self,
        topics: FleetTopics,
        clock: Clock,
        *,
        epoch: int,
        store_ready: Callable[[], bool],
        stops: Callable[[], tuple[StopStatus, ...]] = tuple,
        broker_lacks: Callable[[], tuple[BrokerLack, ...]] = tuple,
        locked_paths: Callable[[], dict[str, SetBy | None]] = dict,
    ) -> None:
        self._topic = topics.service_status
        self._clock = clock
        self._epoch = epoch
        self._store_ready = store_ready
        self._stops = stops
        self._broker_lacks = broker_lacks
        self._locked_paths = locked_paths
        self._due = asyncio.Event()
        self._ended = False

    def will(self) -> Outbound:
        """Return the last will, which the broker publishes when the connection breaks."""
        return self._status_message(online=False)

    async def run(self, mqtt: MqttLink) -> None:
        """Publish until cancelled, except while the broker is not connected."""
        while True:
            if mqtt.state.connected and not self._ended:
                mqtt.publish(replace(self._status_message(online=True), keep=False))
            await set_within(self._due, HEARTBEAT)
            self._due.clear()

    def hurry(self) -> None:
        """Publish at once, because a stop has begun or ended."""
        self._due.set()

    def end(self, mqtt: MqttLink) -> None:
        """Publish that the service is shutting down."""
        self._ended = True
        mqtt.publish(self.will())

    def _status_message(self, *, online: bool) -> Outbound:
        # 0054: with the stops, which need no topic and outlast a restart of the aggregator that way.
        locked = dict(islice(self._locked_paths().items(), LOCKED_PATHS_SHOWN if online else 0))
        status = ServiceStatus(
            online=online,
            timestamp=self._clock.now(),
            store_ready=online and self._store_ready(),
            broker_lacks=self._broker_lacks() if online else (),
            stops=self._stops() if online else (),
            locked_paths=tuple(locked),
            locked_by={name: setter for name, setter in locked.items() if setter},
        )
        return Outbound(
            self._topic, with_epoch(status.model_dump_json(by_alias=True).encode(), self._epoch), retain=True
        )


TERM_POLL = 0.25
"""Seconds between two checks for the broker's connection in a new term."""

STORE_RETRY = 1.0
"""Pause after the database was unavailable during a sweep, seconds."""

LISTEN = 2.0
"""Seconds within which a broker delivers its retained messages."""


class RetainedSweep:
    """Reads the broker's retained messages once in each term of leadership, over a separate link.

    The service's main link does not subscribe to them: it would receive everything that it publishes.
    """

    def __init__(
        self,
        settings: MqttSettings,
        *,
        client_id: str,
        engine: Engine,
        publisher: StatusPublisher,
    ) -> None:
        self._epoch = publisher.epoch
        self._mqtt = publisher.mqtt
        self._topics = publisher.topics
        self._engine = engine
        self._publisher = publisher
        # With the main link's client ID, the broker would end that connection (MQTT 3.1.1, 3.1.4).
        self._settings = settings.model_copy(update={"client_id": None})
        self._client_id = client_id
        self._names: set[str] = set()
        self._sequences: set[str] = set()
        self._vehicles: set[str] = set()

    async def run(self) -> None:
        """Sweep once the broker is connected; on a shared store, again in each new term.

        Sweep again if the database was unavailable.
        """
        link, swept = self._mqtt.state, None
        while swept is None or self._epoch:
            if link.connected and link.term != swept:
                term = link.term
                try:
                    await self._sweep_statuses()
                except StoreNotReadyError as error:
                    log.warning("retained statuses not corrected yet", reason=str(error))
                    await asyncio.sleep(STORE_RETRY)
                else:
                    swept = term
            else:
                await asyncio.sleep(TERM_POLL)

    async def _sweep_statuses(self) -> None:
        """Listen for a while once the broker is connected, then correct stale statuses."""
        connected = asyncio.Event()

        def greet() -> tuple[Outbound, ...]:
            connected.set()
            return ()

        link = MqttLink(self._settings, client_id=self._client_id, hooks=LinkHooks(on_connected=greet))
        link.subscribe(self._topics.all_order_statuses, self._note_status)
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
            await self._correct_order(name)
        for name in sorted(self._sequences):
            await self._correct_sequence(name)
        self._names.clear()
        self._sequences.clear()
        self._vehicles.clear()

    def _is_stale(self, message: Inbound) -> bool:
        """Return whether another order service published a retained status."""
        return epoch_of(message.payload) != self._epoch

    def _note_status(self, message: Inbound) -> None:
        name = self._name_in(message, self._topics.order_status)
        order = self._engine.state.orders.visible_named(name)
        # 0008: a kill between commit and publishing leaves an earlier status at the broker.
        has_ended = order is None or order.state.final
        if message.retained and message.payload and (self._is_stale(message) or has_ended):
            self._names.add(name)

    def _note_sequence(self, message: Inbound) -> None:
        name = self._name_in(message, self._topics.sequence_status)
        sequence = self._engine.state.sequences.visible(name)
        if message.retained and message.payload and (self._is_stale(message) or not sequence):
            self._sequences.add(name)

    def _note_vehicle(self, message: Inbound) -> None:
        serial_number = self._name_in(message, self._topics.vehicle_status)
        if message.retained and message.payload and self._is_stale(message):
            self._vehicles.add(serial_number)

    def _name_in(self, message: Inbound, topic_of: Callable[[str], str]) -> str:
        """Return the name in a status's topic; clear a topic of an older version, which did not encode it."""
        name = self._topics.name_in(message.topic)
        if message.retained and message.payload and message.topic != topic_of(name):
            self._mqtt.publish(Outbound(message.topic, b"", retain=True))
        return name

    def _correct_vehicle(self, serial_number: str) -> None:
        # The same serial number may exist once per manufacturer.
        vehicles = [
            vehicle for vehicle in self._engine.registry if vehicle.key.serial_number == serial_number
        ]
        for vehicle in vehicles:
            self._publisher.vehicle_changed(self._engine.reporter.vehicle_status(vehicle))
        if not vehicles:
            log.warning("clearing the status of an unknown vehicle", serial_number=serial_number)
            self._mqtt.publish(Outbound(self._topics.vehicle_status(serial_number), b"", retain=True))

    async def _correct_sequence(self, name: str) -> None:
        if sequence := self._engine.state.sequences.visible(name):
            self._publisher.sequence_changed(sequence.status)
            return
        stored = await self._engine.store.read_sequence(name=name)
        if stored and stored.status.finished:
            log.info("publishing the end of an order sequence again", sequence=name)
            self._publisher.sequence_changed(stored.status)
        elif stored is None:
            log.warning("clearing the status of an unknown order sequence", sequence=name)
            self._mqtt.publish(Outbound(self._topics.sequence_status(name), b"", retain=True))

    async def _correct_order(self, name: str) -> None:
        order = self._engine.state.orders.visible_named(name)
        if order is not None and not order.state.final:
            self._publisher.order_changed(order.status)
            return
        stored = await self._engine.store.read_order(name=name)
        if stored and stored.state.final:
            log.info("publishing the end of an order again", order=name, state=stored.state.value)
            self._publisher.order_changed(stored.status)
        elif stored is None:
            log.warning("clearing the status of an unknown order", order=name)
            self._mqtt.publish(Outbound(self._topics.order_status(name), b"", retain=True))
