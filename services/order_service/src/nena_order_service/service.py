"""The order service as a whole: build its parts, start and end them."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterable, Mapping
from functools import cache, partial
from itertools import chain
from secrets import token_hex
from types import MappingProxyType

from fastapi import FastAPI

from nena_order_service.api.asyncapi import document
from nena_order_service.api.audit import record_current
from nena_order_service.api.broker_check import BrokerCheck
from nena_order_service.api.direct_stops import DirectStopTakeover
from nena_order_service.api.events import EventStream
from nena_order_service.api.hosts import HostServices
from nena_order_service.api.metrics import exposition
from nena_order_service.api.mqtt import MqttApi, MqttLimits
from nena_order_service.api.operations import HostOperations
from nena_order_service.api.peripheral_link import PeripheralLink
from nena_order_service.api.plant import ChangePlant
from nena_order_service.api.rest import Service, make_app
from nena_order_service.api.statuses import Heartbeat, RetainedSweep, StatusPublisher
from nena_order_service.building import make_engine, make_fleet
from nena_order_service.engine.zone_sets import ZoneSets
from nena_order_service.errors import StoreNotReadyError
from nena_order_service.extension import Core, EditPlant, Extension, Listeners, installed
from nena_order_service.fleet.guard import FleetGuard
from nena_order_service.fleet.link import HeaderIds
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.store import Store
from nena_shared.certificates import Certificates
from nena_shared.clock import SystemClock
from nena_shared.fleet_api.requests import Readiness
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.log import get_logger
from nena_shared.loop_lag import LoopLag
from nena_shared.mqtt import LinkHooks, MqttLink, Term, always
from nena_shared.mqtt.broker_check import LACKS, BrokerLack
from nena_shared.plant import PlantModel
from nena_shared.settings import settings_of
from nena_shared.tasks import forever

log = get_logger(__name__)

CHANGING = "the plant model is being changed; retry in a moment"


class OrderService:
    """All parts of the order service; nothing runs before :meth:`begin`."""

    def __init__(
        self,
        settings: OrderServiceSettings,
        plant: PlantModel,
        store: Store,
        *,
        epoch: int = 0,
        header_ids: HeaderIds | None = None,
        term: Term = always,
        change_plant: ChangePlant | None = None,
        guard: FleetGuard | None = None,
        answers: Mapping[int, int] = MappingProxyType({}),
    ) -> None:
        """Build the parts and the extensions; nothing is connected or restored yet.

        Args:
            settings: its own, with those of the extensions.
            plant: the plant model.
            store: the store of orders.
            epoch: see :class:`StatusPublisher`.
            header_ids: the last ``headerId`` of each topic, if another service was built for this epoch.
            term: see :data:`Term`.
            change_plant: replaces the plant model; None: it is read-only.
            guard: finds out whether this service leads the fleet; nothing is sent before. None: no election.
            answers: number of HTTP answers by status, for the metrics.

        Raises:
            ConfigurationError: the plant model names an unsupported version, or an extension cannot be built.
        """
        clock, topics = SystemClock(), FleetTopics(settings.topic_prefix)
        client_id, plant_json = _client_id(settings, epoch), plant.to_json().encode()
        self.guard, self.answers, self.store = guard, answers, store
        self.loop_lag = LoopLag(clock)
        self.certificates = Certificates(settings.http.tls_certificate, settings.mqtt.tls.certificate)

        self.engine = engine = make_engine(settings, plant, store, clock)
        stops, work = engine.stops, engine.unit_of_work
        self.heartbeat = Heartbeat(
            topics,
            clock,
            epoch=epoch,
            store_ready=lambda: store.ready,
            stops=stops.statuses,
            broker_lacks=lambda: self.broker_check.lacks,
            locked_paths=engine.context.locked_paths.locked_by_hosts,
        )
        hooks = LinkHooks(self.heartbeat.will, lambda: chain(self.publisher.greeting(), devices.greeting()))
        self.mqtt = mqtt = MqttLink(settings.mqtt, client_id=client_id, hooks=hooks, term=term)
        self.fleet = make_fleet(settings, mqtt, engine, clock, epoch=epoch, header_ids=header_ids)
        devices = PeripheralLink(mqtt, topics, engine)
        self.publisher = StatusPublisher(
            mqtt, topics, engine, plant_json=plant_json, end_kept=settings.end_kept, epoch=epoch
        )
        self.broker_check = BrokerCheck(
            mqtt,
            settings.mqtt,
            client_id=client_id,
            prefix=settings.topic_prefix,
            signs="".join(
                sign for sign in ". " if any(sign in str(vehicle.key) for vehicle in engine.registry)
            ),
            statuses=self.publisher.statuses,
        )
        self.sweep = RetainedSweep(
            settings.mqtt, client_id=f"{client_id}-sweep", engine=engine, publisher=self.publisher
        )
        self.stream = EventStream(engine, settings.events)

        self.hosts = hosts = HostServices(engine, ZoneSets(engine, self.fleet.send_zone_set))
        core = Core(clock, store, engine, self.fleet, hosts, mqtt, topics, change_plant or _no_change(plant))
        self.extensions: Mapping[str, Extension] = {
            name: extension(settings_of(settings, name, extension), core)
            for name, extension in installed().items()
        }
        extensions = list(self.extensions.values())
        added = [handler for extension in extensions for handler in extension.handlers()]
        self.operations = HostOperations(hosts.trail, chain(hosts.handlers(), added))

        listeners = Listeners(extensions)
        work.listeners += [self.publisher, self.stream, listeners]
        work.vehicle_listeners += [self.publisher, self.stream, listeners]
        work.peripheral_listeners += [self.publisher, listeners]
        # 0055: the row of a request joins the transaction of its change: no change is without one.
        work.recorders.append(record_current)
        hosts.trail.listeners.append(listeners)
        self.fleet.listeners.append(listeners)
        stops.listeners.append(self.heartbeat.hurry)

        limits = MqttLimits(settings.hosts, clock)
        self.mqtt_api = MqttApi(mqtt, topics, self.operations, limits, max_body=settings.max_body)
        self.direct_stops = DirectStopTakeover(mqtt, topics, engine, hosts.trail)
        service = Service(
            plant_json=plant_json,
            change_plant=change_plant,
            asyncapi=cache(lambda: json.dumps(document(topics)).encode()),
            readiness=lambda: readiness(
                mqtt,
                store,
                self.loop_lag.longest,
                lacks=self.broker_check.lacks,
                not_leading=guard.problem if guard else "",
                failed=work.failed.is_set(),
            ),
            max_body=settings.max_body,
            metrics=exposition(self, extensions),
            routers=[router for extension in extensions for router in extension.routers()],
            mounted=dict(chain.from_iterable(extension.apps().items() for extension in extensions)),
        )
        self.app: FastAPI = make_app(self.operations, self.stream, service)

    @property
    def leads(self) -> bool:
        """Whether this instance certainly is the only one that uses the store."""
        return not self.store.lead_problem

    @property
    def store_ready(self) -> bool:
        """Whether new orders can be accepted."""
        return self.store.ready

    async def begin(
        self,
        start: Callable[..., asyncio.Task[None]],
        previous: Mapping[str, Extension] = MappingProxyType({}),
    ) -> None:
        """Restore the store's content, then start all parts; ``start`` starts their tasks.

        ``previous``: the extensions of the order service that this one replaces.
        """
        await self.hosts.load()
        for name, extension in self.extensions.items():
            await extension.begin(previous.get(name))
        await asyncio.to_thread(self.engine.prepare)
        await self.engine.start(self.fleet)
        start("mqtt", self._once_elected(self.mqtt.run))
        start("fleet control", self.fleet.run())
        start("engine", self.engine.run())
        start("loop lag", self.loop_lag.run())
        start("heartbeat", self.heartbeat.run(self.mqtt))
        start("zone sets", self.hosts.zones.run())
        start("retained sweep", self.sweep.run(), vital=False)
        start("broker check", self.broker_check.run(), vital=False)
        for extension in self.extensions.values():
            for name, work in extension.tasks().items():
                start(name, self._once_elected(partial(forever, name, work)), vital=False)

    async def _once_elected(self, work: Callable[[], Awaitable[None]]) -> None:
        if self.guard:
            await self.guard.won.wait()
        await work()

    def close_streams(self) -> None:
        """Close the event streams."""
        self.stream.close()
        for extension in self.extensions.values():
            extension.close_streams()

    async def end(self) -> None:
        """Close streams, and end publishing and all open requests."""
        self.close_streams()
        self.publisher.close()
        self.heartbeat.end(self.mqtt)
        await self.mqtt_api.close()
        await self.direct_stops.close()
        for extension in self.extensions.values():
            await extension.end()


def _no_change(plant: PlantModel) -> ChangePlant:
    """Return a function that refuses all changes of the plant model except those without effect."""

    async def refuse(change: PlantModel | EditPlant, *, check_only: bool = False) -> None:  # noqa: ARG001
        if isinstance(change, PlantModel) or change(plant) is not plant:
            raise StoreNotReadyError(CHANGING)

    return refuse


def _client_id(settings: OrderServiceSettings, epoch: int) -> str:
    """Return the client ID for the broker, unique per start.

    Two clients with the same ID would disconnect each other; other clients cannot guess this one.
    """
    name = f"nena-order-service-{settings.interface_name.replace('/', '-')}-{token_hex(4)}"
    return f"{name}-{epoch}" if epoch else name


def readiness(
    mqtt: MqttLink,
    store: Store,
    loop_lag: float = 0.0,
    *,
    lacks: Iterable[BrokerLack] = (),
    not_leading: str = "",
    failed: bool = False,
) -> Readiness:
    """Return whether the broker is connected and the store can be written, and any problems."""
    problems = []
    if not mqtt.state.connected:
        why = mqtt.state.last_error or not_leading or "not yet"
        problems.append(f"The MQTT broker is not connected ({why}). Orders are accepted and wait.")
    elif mqtt.state.refused:
        topics = ", ".join(mqtt.state.refused)
        problems.append(f"The MQTT broker refuses the subscription to {topics}: check its access list.")
    if not store.ready:
        problems.append(f"Database unavailable ({store.why_not_ready}). Orders are refused.")
    if failed:
        problems.append("An internal error has stopped a change (see the log). Restarting from the store.")
    ready = not problems
    if mqtt.state.set_aside:
        topics = ", ".join(mqtt.state.set_aside)
        problems.append(f"The MQTT broker ends the connection at messages on {topics}: they are not sent.")
    problems += [LACKS[lack] for lack in lacks]
    return Readiness(
        ready=ready,
        broker_connected=mqtt.state.connected,
        store_ready=store.ready,
        loop_lag=round(loop_lag, 4),
        problems=tuple(problems),
    )
