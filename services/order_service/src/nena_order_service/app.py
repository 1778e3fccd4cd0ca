"""The order service: start up, main loop, shut down."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import dataclass
from secrets import token_hex

from fastapi import FastAPI
from starlette.types import ASGIApp

from nena_order_service.asyncapi import document
from nena_order_service.beginning import has_begun
from nena_order_service.dispatch.way import WayFinder
from nena_order_service.event_stream import EventStream
from nena_order_service.fleet import FleetLink, OperationMap, RobotAddresses
from nena_order_service.kernel import Kernel
from nena_order_service.kernel.host_requests import HostRequests
from nena_order_service.kernel.missions import MissionPlanner
from nena_order_service.kernel.path_locks import PathLocks
from nena_order_service.kernel.sequence_requests import SequenceRequests
from nena_order_service.kernel.vehicles import VehicleRegistry
from nena_order_service.kernel.zone_sets import ZoneSets
from nena_order_service.mqtt_commands import MqttCommands, Verbs
from nena_order_service.mqtt_door import MqttDoor
from nena_order_service.plant_file import PlantFile, load_plant
from nena_order_service.rest.api import make_app
from nena_order_service.rest.bodies import Readiness
from nena_order_service.rest.opentcs import app as opentcs
from nena_order_service.rest.roles import role_needed
from nena_order_service.rest.standby import make_standby_app
from nena_order_service.rest.starting import make_starting_app
from nena_order_service.retained_sweep import RetainedSweep
from nena_order_service.routing import Router, evaluators
from nena_order_service.serving import ChangePlant, Serving
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.database import open_database
from nena_order_service.store.engine import is_shared
from nena_order_service.store.instance_lock import InstanceLock
from nena_order_service.store.lead import Lead
from nena_order_service.store.store import Store
from nena_shared.clock import SystemClock
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.log import get_logger
from nena_shared.mqtt import MqttLink
from nena_shared.plant import PlantModel
from nena_shared.tasks import Supervisor
from nena_shared.vda5050.topics import TopicScheme
from nena_shared.web.access import protect
from nena_shared.web.server import SHUTDOWN_PATIENCE, HttpServer

log = get_logger(__name__)

DRAIN_PATIENCE = 3.0
"""Seconds that store and broker have at the end to take what waits for them."""


@dataclass(slots=True)
class OrderService:
    """All parts of the order service, wired up; nothing runs yet."""

    store: Store
    kernel: Kernel
    fleet: FleetLink
    door: MqttDoor
    sweep: RetainedSweep
    mqtt: MqttLink
    app: FastAPI
    commands: MqttCommands
    stream: EventStream
    locks: PathLocks
    zones: ZoneSets

    async def begin(self, start: Callable[..., asyncio.Task[None]]) -> None:
        """Take up what is in the store, then let all parts run; ``start`` starts their tasks."""
        await self.locks.load()
        await self.zones.load()
        await self.kernel.start(self.fleet)
        start("mqtt", self.mqtt.run())
        start("fleet control", self.fleet.run())
        start("kernel", self.kernel.run())
        start("zone sets", self.zones.run())
        start("retained sweep", self.sweep.run(), vital=False)

    async def end(self) -> None:
        """End all that clients wait for."""
        self.stream.close()
        await self.door.close()
        await self.commands.close()


def build(
    settings: OrderServiceSettings,
    plant: PlantModel,
    store: Store,
    *,
    epoch: int = 0,
    change_plant: ChangePlant | None = None,
) -> OrderService:
    """Wire up the order service; ``epoch`` counts the takeovers of a store that others share.

    Raises:
        ConfigurationError: the plant model names a version that is not spoken here.

    """
    plant_json = plant.to_json().encode()
    clock = SystemClock()
    finder = _make_finder(settings, plant)
    kernel = _make_kernel(settings, plant, finder, store, clock)
    requests = HostRequests(kernel, settings.kernel)
    sequences = SequenceRequests(kernel, settings.kernel)
    locks = PathLocks(
        plant,
        store,
        apply=finder.set_locks,
        changed=kernel.plant_changed,
        closed=lambda: kernel.steps.closed,
        commit_timeout=settings.kernel.commit_timeout,
    )
    client_id = _client_id(settings, epoch)
    mqtt = MqttLink(
        settings.mqtt,
        client_id=client_id,
        on_connected=lambda: door.greeting(),  # noqa: PLW0108 - the door is made below, of this link
    )
    fleet = FleetLink(
        mqtt,
        addresses=_make_addresses(settings, kernel.registry),
        settings=settings.fleet,
        clock=clock,
        on_news=kernel.on_news,
    )
    zones = ZoneSets(kernel, fleet.send_zone_set, commit_timeout=settings.kernel.commit_timeout)
    topics = FleetTopics(settings.topic_prefix)
    door = MqttDoor(
        mqtt,
        topics,
        kernel,
        requests,
        plant_json=plant_json,
        max_body=settings.max_body,
        end_kept=settings.end_kept,
    )
    kernel.steps.listeners.append(door)
    sweep = RetainedSweep(
        settings.mqtt, topics, client_id=f"{client_id}-sweep", mqtt=mqtt, kernel=kernel, door=door
    )
    commands = MqttCommands(
        mqtt, topics, Verbs(requests, sequences, locks, zones), max_body=settings.max_body
    )
    stream = EventStream(kernel, settings.events)
    kernel.steps.listeners.append(stream)
    prefixes = filter(None, [settings.opentcs_prefix])
    app = make_app(
        requests,
        sequences,
        locks,
        stream,
        plant_json=plant_json,
        change_plant=change_plant,
        zones=zones,
        asyncapi=json.dumps(document(topics)).encode(),
        readiness=lambda: readiness(mqtt, store),
        max_body=settings.max_body,
        mounted={
            prefix: opentcs.make_app(requests, sequences, locks, plant=plant, dispatch=kernel.look)
            for prefix in prefixes
        },
    )
    return OrderService(store, kernel, fleet, door, sweep, mqtt, app, commands, stream, locks, zones)


def _client_id(settings: OrderServiceSettings, epoch: int) -> str:
    """Name the program to the broker; of one name, an old and a new one would push each other out.

    Nor can anybody else push it out, who does not know the name.
    """
    name = f"nena-order-service-{settings.interface_name.replace('/', '-')}-{token_hex(4)}"
    return f"{name}-{epoch}" if epoch else name


async def serve(settings: OrderServiceSettings, stop: asyncio.Event) -> None:
    """Run the order service until ``stop`` is set; on a store that others share it stands by at first.

    Raises:
        ConfigurationError: the plant model cannot be used.
        StartError: the store cannot be used, or the port is taken.
        TaskFailedError: a part that the rest cannot do without has failed, or another one has the store now.

    """
    plant = load_plant(settings.plant)
    run = _serve_shared if is_shared(settings.store.location()) else _serve_alone
    await run(settings, plant, stop)
    log.info("order service ended")


async def _serve_alone(settings: OrderServiceSettings, plant: PlantFile, stop: asyncio.Event) -> None:
    url = settings.store.location()
    lock = InstanceLock.take(url)
    store = Store(open_database(url), lock)
    http = HttpServer(_guarded(make_starting_app(lambda: store.why_not_ready), settings), settings.http)
    begun = False
    answering: asyncio.Task[None] | None = None
    async with Supervisor() as supervisor:
        serving = _serving(settings, plant, store, supervisor)
        serving.show = lambda app: setattr(http, "app", _guarded(app, settings))

        def answer() -> None:
            nonlocal answering
            answering = answering or supervisor.start("http", http.run())

        try:
            begun = await has_begun(
                serving.begin(), supervisor, stop, waits=lambda: not store.ready, tell=answer
            )
            if begun:
                serving.show(serving.parts.app)
                answer()
                await supervisor.wait(stop)
        finally:
            await _end_answering(http, answering, serving if begun else None)
            if begun:
                await _shut_down(serving.parts)
    store.close()


async def _serve_shared(settings: OrderServiceSettings, plant: PlantFile, stop: asyncio.Event) -> None:
    lead = Lead(settings.store.location())
    standby = make_standby_app(lambda: lead.active_url, lambda: lead.problem)
    http = HttpServer(_guarded(standby, settings), settings.http)
    serving = None
    async with Supervisor() as supervisor:
        answering = supervisor.start("http", http.run())
        try:
            if await lead.take(stop):
                own_url = str(settings.public_url or http.url).rstrip("/")
                serving = await _take_over(settings, plant, lead, supervisor, own_url)
                serving.show = lambda app: setattr(http, "app", _guarded(app, settings))
                serving.show(serving.parts.app)
                await supervisor.wait(stop)
        finally:
            await _end_answering(http, answering, serving)
            if serving:
                await _shut_down(serving.parts)
    if serving:
        serving.parts.store.close()
    await lead.close()


def _serving(
    settings: OrderServiceSettings,
    plant: PlantFile,
    store: Store,
    supervisor: Supervisor,
    *,
    epoch: int = 0,
) -> Serving[OrderService]:
    def make(model: PlantModel) -> OrderService:
        return build(settings, model, store, epoch=epoch, change_plant=serving.change_plant)

    serving = Serving(plant, store, supervisor, make=make)
    return serving


def _guarded(app: ASGIApp, settings: OrderServiceSettings) -> ASGIApp:
    return opentcs.AccessKey(protect(app, settings.http, role_needed))


async def _take_over(
    settings: OrderServiceSettings, plant: PlantFile, lead: Lead, supervisor: Supervisor, own_url: str
) -> Serving[OrderService]:
    """Become the active one: the other one commits nothing any more, and what it has is taken up."""
    engine, fence = await lead.raise_fence(settings.store.location(), own_url)
    store = Store(engine, fence=fence)
    supervisor.start("lead", lead.keep(store, engine, fence))
    serving = _serving(settings, plant, store, supervisor, epoch=fence.epoch)
    await serving.begin()
    log.info("active on the shared store", epoch=fence.epoch)
    return serving


async def _end_answering(
    http: HttpServer, answering: asyncio.Task[None] | None, serving: Serving[OrderService] | None
) -> None:
    if serving:
        serving.parts.stream.close()
    if answering is None:
        http.close()
        return
    http.stop()
    await asyncio.wait({answering}, timeout=SHUTDOWN_PATIENCE + 1)


async def _shut_down(service: OrderService) -> None:
    """Write and send what waits."""
    await service.end()
    if not await service.store.drain(DRAIN_PATIENCE):
        log.error("the store has not taken all that was not answered yet", reason=service.store.problem)
    await service.mqtt.drain(DRAIN_PATIENCE)


def readiness(mqtt: MqttLink, store: Store) -> Readiness:
    """Tell whether broker and store are there."""
    problems = []
    if not mqtt.state.connected:
        why = mqtt.state.last_error or "not yet"
        problems.append(f"The MQTT broker is not connected ({why}). Orders are taken and wait.")
    elif mqtt.state.refused:
        topics = ", ".join(mqtt.state.refused)
        problems.append(f"The MQTT broker refuses to tell of {topics}: look at its access list.")
    if not store.ready:
        problems.append(f"The store takes nothing ({store.why_not_ready}). Orders are refused.")
    return Readiness(
        ready=not problems,
        broker_connected=mqtt.state.connected,
        store_ready=store.ready,
        problems=tuple(problems),
    )


def _make_addresses(settings: OrderServiceSettings, registry: VehicleRegistry) -> RobotAddresses:
    """Know the robots' topics, as far as settings and plant model tell.

    Raises:
        ConfigurationError: the plant model names a version that is not spoken here.

    """
    addresses = RobotAddresses(
        [TopicScheme(settings.interface_name, "v2"), TopicScheme(settings.interface_name_v3, "v3")]
    )
    addresses.expect((each.key, each.model) for each in registry if each.model)
    return addresses


def _make_finder(settings: OrderServiceSettings, plant: PlantModel) -> WayFinder:
    costs = evaluators(settings.routing.costs, plant)
    return WayFinder(plant, Router(plant, costs), any_day=Router(plant, costs))


def _make_kernel(
    settings: OrderServiceSettings, plant: PlantModel, finder: WayFinder, store: Store, clock: SystemClock
) -> Kernel:
    return Kernel(
        plant,
        store=store,
        registry=VehicleRegistry(
            plant,
            default_map_id=settings.kernel.default_map_id,
            adopt_unknown=settings.kernel.adopt_unknown,
        ),
        finder=finder,
        planner=MissionPlanner(plant, finder, OperationMap(settings.kernel.action_types)),
        clock=clock,
        settings=settings.kernel,
        on_failure=settings.orders.on_failure,
    )
