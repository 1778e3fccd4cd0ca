"""The order service: start up, main loop, shut down."""

from __future__ import annotations

import asyncio

from starlette.types import ASGIApp

from nena_order_service.beginning import has_begun
from nena_order_service.parts import OrderService, build
from nena_order_service.plant_file import PlantFile, load_plant
from nena_order_service.rest.opentcs import app as opentcs
from nena_order_service.rest.roles import role_needed
from nena_order_service.rest.standby import make_standby_app
from nena_order_service.rest.starting import make_starting_app
from nena_order_service.serving import Serving
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.database import open_database
from nena_order_service.store.engine import is_shared
from nena_order_service.store.instance_lock import InstanceLock
from nena_order_service.store.lead import Lead
from nena_order_service.store.store import Store
from nena_shared.log import get_logger
from nena_shared.plant import PlantModel
from nena_shared.tasks import Supervisor
from nena_shared.web.access import protect
from nena_shared.web.server import SHUTDOWN_PATIENCE, HttpServer

log = get_logger(__name__)

DRAIN_PATIENCE = 3.0
"""Seconds that store and broker have at the end to take what waits for them."""


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
