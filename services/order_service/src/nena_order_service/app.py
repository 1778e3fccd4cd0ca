"""The order service: start, main loop, shutdown."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from nena_order_service.api.server import RestServer, make_standby_app, make_starting_app
from nena_order_service.extension import installed
from nena_order_service.fleet.guard import FleetGuard
from nena_order_service.fleet.link import HeaderIds
from nena_order_service.plant_file import PlantFile, load_plant
from nena_order_service.runner import ServiceRunner
from nena_order_service.service import OrderService
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.instance_lock import InstanceLock
from nena_order_service.store.leadership import Leadership, begin_epoch, store_id
from nena_order_service.store.schema import is_shared, open_database
from nena_order_service.store.store import Store
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.log import get_logger
from nena_shared.mqtt import Term, always
from nena_shared.plant import PlantModel
from nena_shared.settings import settings_of
from nena_shared.tasks import Supervisor, end

log = get_logger(__name__)

LOOK = 0.25
"""Seconds between checks of the store during the start."""

DRAIN_TIMEOUT = 3.0
"""Timeout at shutdown for store and broker to accept pending writes and messages, seconds."""


async def has_begun(
    begin: Coroutine[Any, Any, None],
    supervisor: Supervisor,
    stop: asyncio.Event,
    *,
    waits: Callable[[], bool],
    show: Callable[[], None],
) -> bool:
    """Wait for ``begin`` to end; return False if the program must stop first.

    ``show`` is called once, as soon as ``waits`` returns that the store cannot be written; the start
    continues when it can.

    Raises:
        TaskFailedError: an essential part has failed.
    """
    beginning = asyncio.create_task(begin, name="begin")
    ending = asyncio.create_task(supervisor.wait(stop), name="wait for the end")
    shown = False
    try:
        while not beginning.done() and not ending.done():
            await asyncio.wait((beginning, ending), timeout=LOOK, return_when=asyncio.FIRST_COMPLETED)
            if not shown and waits():
                shown = True
                show()
    finally:
        await end(beginning, ending)
    if beginning.cancelled():
        ending.result()
        return False
    beginning.result()
    return True


async def serve(settings: OrderServiceSettings, stop: asyncio.Event) -> None:
    """Run the order service until ``stop`` is set; on a shared store it starts as standby.

    Raises:
        ConfigurationError: the plant model or an extension cannot be used.
        StartError: the store cannot be used, or the port is in use.
        TaskFailedError: an essential part has failed, or another order service has taken over the store.
    """
    plant = load_plant(settings.plant)
    run = _serve_shared if is_shared(settings.store.location()) else _serve_alone
    # Before it stands by: an error that shows only at a takeover would leave the fleet without a service.
    for name, extension in installed().items():
        extension.check(settings_of(settings, name, extension))
    await run(settings, plant, stop)


async def _serve_alone(settings: OrderServiceSettings, plant: PlantFile, stop: asyncio.Event) -> None:
    url = settings.store.location()
    # Before the tables are created or checked: the file may be that of a running order service (0008).
    lock = InstanceLock.take(url)
    engine = open_database(url)
    epoch = begin_epoch(engine)
    store = Store(engine, lock)
    server = RestServer(make_starting_app(lambda: store.why_not_ready), settings.http)
    async with Supervisor() as supervisor:
        guard = _guard_fleet(settings, store_id(engine), epoch, always)
        await _lead_fleet(settings, plant, store, supervisor, stop, server=server, guard=guard)
    store.close()


async def _serve_shared(settings: OrderServiceSettings, plant: PlantFile, stop: asyncio.Event) -> None:
    leadership = Leadership(settings.store.location())
    app = make_standby_app(lambda: leadership.active_url, lambda: leadership.problem)
    server = RestServer(app, settings.http)
    store = None
    async with Supervisor() as supervisor:
        server.open(supervisor)
        try:
            if await leadership.win(stop):
                own_url = str(settings.public_url or server.url).rstrip("/")
                engine, fence = await leadership.take_over(own_url)
                # 0022: the lock alone does not fence, because its holder learns late that it is lost.
                store = Store(engine, fence=fence)
                supervisor.start("leadership", leadership.keep(store, engine, fence))
                log.info("shared store taken over", epoch=fence.epoch)
                # 0022: without the lease, a program that hung would go on resending after a takeover.
                guard = _guard_fleet(settings, store_id(engine), fence.epoch, leadership.lease.term)
                await _lead_fleet(settings, plant, store, supervisor, stop, server=server, guard=guard)
        finally:
            await server.close()
    if store:
        store.close()
    await leadership.close()


def _guard_fleet(settings: OrderServiceSettings, store: str, epoch: int, term: Term) -> FleetGuard:
    topic = FleetTopics(settings.topic_prefix).leader(settings.interface_name)
    return FleetGuard(settings.mqtt, topic, store=store, epoch=epoch, term=term)


async def _lead_fleet(
    settings: OrderServiceSettings,
    plant: PlantFile,
    store: Store,
    supervisor: Supervisor,
    stop: asyncio.Event,
    *,
    server: RestServer,
    guard: FleetGuard,
) -> None:
    """Serve until ``stop``; during the start, the server reports if the store cannot be written."""
    # Each service that is built for another plant model continues them, because the epoch stays the same.
    header_ids: HeaderIds = {}

    def make(model: PlantModel) -> OrderService:
        return OrderService(
            settings,
            model,
            store,
            epoch=guard.epoch,
            header_ids=header_ids,
            term=guard.term,
            change_plant=runner.change_plant,
            guard=guard,
            answers=server.answers,
        )

    async def begin() -> None:
        await runner.begin()
        await guard.decided()

    def show() -> None:
        server.show(make_starting_app(lambda: store.why_not_ready))
        server.open(supervisor)

    # 0108: of two order services with different stores at one broker, the second one exits.
    supervisor.start("fleet guard", guard.run())
    runner = ServiceRunner(plant, store, supervisor, make=make, show=server.show)
    begun = False
    try:
        begun = await has_begun(begin(), supervisor, stop, waits=lambda: not store.ready, show=show)
        if begun:
            server.show(runner.service.app)
            server.open(supervisor)
            await supervisor.wait(stop)
    finally:
        if begun:
            runner.service.close_streams()  # the server would wait for them until its timeout
        await server.close()
        if begun:
            await _shut_down(runner.service)


async def _shut_down(service: OrderService) -> None:
    """Write and send everything that is pending."""
    await service.end()
    # The store first: what it still commits is then published (0008).
    if not await service.store.drain(DRAIN_TIMEOUT):
        log.error(
            "exiting with unanswered requests that the store did not accept",
            reason=service.store.why_not_ready,
        )
    await service.mqtt.drain(DRAIN_TIMEOUT)
    for extension in service.extensions.values():
        await extension.close()
