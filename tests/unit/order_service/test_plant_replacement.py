"""What changes a plant model and what keeps it as it is; with real parts over a broker: test_plant_change."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable

import pytest

from nena_demo.plants import sample_plant_path
from nena_order_service.errors import InvalidPlantError, PlantInUseError, StoreNotReadyError
from nena_order_service.extension import EditPlant
from nena_order_service.plant_file import PlantFile, load_plant
from nena_order_service.runner import ServiceRunner
from nena_order_service.service import CHANGING, OrderService
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.schema import open_database
from nena_order_service.store.store import Store
from nena_shared.extensions.tracing import TracingSettings
from nena_shared.plant import Path, PlantModel
from nena_shared.tasks import Supervisor
from support.opentcs_routes import changes_of
from support.order_service import request
from support.pausing import time_passes

FILE = load_plant(sample_plant_path())
SAMPLE = FILE.model


def without(point: str) -> PlantModel:
    return PlantModel(
        name="less",
        points=tuple(each for each in SAMPLE.points if each.name != point),
        paths=tuple(each for each in SAMPLE.paths if point not in (each.source, each.destination)),
        vehicles=SAMPLE.vehicles,
    )


def runner_of(
    settings: OrderServiceSettings,
    store: Store,
    supervisor: Supervisor,
    file: PlantFile = FILE,
    *,
    show: Callable[[object], None] = lambda _: None,
) -> ServiceRunner:
    return ServiceRunner(
        file, store, supervisor, make=lambda model: OrderService(settings, model, store), show=show
    )


async def taken_up(settings: OrderServiceSettings, store: Store, file: PlantFile = FILE) -> PlantModel:
    """Return the plant used after a restart with this file."""
    async with Supervisor() as supervisor:
        runner = runner_of(settings, store, supervisor, file)
        await runner.begin()
        return runner.service.engine.plant


async def test_uploaded_model_is_activated_and_kept(settings: OrderServiceSettings) -> None:
    store = Store(open_database(settings.store.location()))
    shown: list[object] = []
    async with Supervisor() as supervisor:
        runner = runner_of(settings, store, supervisor, show=shown.append)
        await runner.begin()
        before = runner.service
        before.engine.create(request("South 2"), "T-1")

        with pytest.raises(PlantInUseError) as refused:
            await runner.change_plant(without("South 2"))
        assert "'T-1'" in str(refused.value.problems)
        await runner.change_plant(without("South 3"), check_only=True)
        assert (runner.service, shown) == (before, [])

        await runner.change_plant(without("South 3"))
        assert runner.service.engine.plant == without("South 3")
        assert shown == [runner.service.app]
        assert [order.name for order in runner.service.engine.state.orders.unfinished()] == ["T-1"]
        with pytest.raises(StoreNotReadyError, match=CHANGING):
            before.engine.create(request("South 2"), "T-2")
    assert await taken_up(settings, store) == without("South 3")
    store.close()


async def test_a_checked_model_opens_no_connection_to_the_collector(settings: OrderServiceSettings) -> None:
    tracing = TracingSettings.model_validate({"endpoint": "http://127.0.0.1:1/v1/traces"})
    traced = settings.model_copy(update={"tracing": tracing})
    store = Store(open_database(settings.store.location()))
    async with Supervisor() as supervisor:
        runner = runner_of(traced, store, supervisor)
        await runner.begin()
        for _ in range(3):
            await runner.change_plant(without("South 3"), check_only=True)
        assert "span export" not in [each.name for each in threading.enumerate()]
    store.close()


async def test_edits_that_are_requested_at_once_are_all_kept(settings: OrderServiceSettings) -> None:
    store = Store(open_database(settings.store.location()))

    def named(suffix: str) -> EditPlant:
        return lambda present: PlantModel(
            name=present.name + suffix, points=present.points, paths=present.paths, vehicles=present.vehicles
        )

    async with Supervisor() as supervisor:
        runner = runner_of(settings, store, supervisor)
        await runner.begin()
        numbered = changes_of(runner.service)
        numbered.count += 7

        async def later() -> None:
            await time_passes(0)  # the first one is out of the queue
            await runner.change_plant(named("-2"))

        await asyncio.gather(runner.change_plant(named("-1")), later())
        service = runner.service
        assert service.engine.plant.name == f"{SAMPLE.name}-1-2"
        assert changes_of(service).count >= 7, "a client of openTCS's events misses none for lower numbers"
        await runner.change_plant(lambda present: present)
        assert runner.service is service, "nothing has changed"
    store.close()


async def put_in_use(settings: OrderServiceSettings, store: Store, model: PlantModel) -> None:
    async with Supervisor() as supervisor:
        runner = runner_of(settings, store, supervisor)
        await runner.begin()
        await runner.change_plant(model)


async def test_uploaded_model_keeps_its_defaults_over_a_restart(
    settings: OrderServiceSettings,
) -> None:
    """Speeds that are not given limit nothing."""
    store = Store(open_database(settings.store.location()))
    first, *others = SAMPLE.paths
    unlimited = Path(
        name=first.name, source=first.source, destination=first.destination, length_mm=first.length_mm
    )
    model = SAMPLE.model_copy(update={"paths": (unlimited, *others)})
    await put_in_use(settings, store, model)
    kept = (await taken_up(settings, store)).paths
    assert [("max_velocity_mm_s" in each.model_fields_set) for each in kept[:2]] == [False, True]
    store.close()


async def test_uploaded_model_is_used_until_the_file_changes(
    settings: OrderServiceSettings,
) -> None:
    store = Store(open_database(settings.store.location()))
    await put_in_use(settings, store, without("South 3"))
    read_otherwise = PlantFile(without("South 2"), FILE.digest)
    assert await taken_up(settings, store, read_otherwise) == without("South 3")
    changed = PlantFile(SAMPLE, "of other bytes")
    assert await taken_up(settings, store, changed) == SAMPLE
    assert await taken_up(settings, store) == SAMPLE, "it does not come back with the bytes"
    store.close()


async def test_path_is_not_locked_while_the_plant_is_changed(settings: OrderServiceSettings) -> None:
    store = Store(open_database(settings.store.location()))
    path = without("South 3").paths[0].name
    async with Supervisor() as supervisor:
        runner = runner_of(settings, store, supervisor)
        await runner.begin()
        before = runner.service
        await runner.change_plant(without("South 3"))
        with pytest.raises(StoreNotReadyError, match=CHANGING):
            await before.hosts.locks.set(path, locked=True)
        assert await store.read_path_locks() == {}
        assert (await runner.service.hosts.locks.set(path, locked=True)).locked
    store.close()


async def test_unusable_model_is_refused(settings: OrderServiceSettings) -> None:
    store = Store(open_database(settings.store.location()))
    strange = SAMPLE.vehicles[0].model_copy(update={"properties": {"vda5050:version": "9.9"}})
    async with Supervisor() as supervisor:
        runner = runner_of(settings, store, supervisor)
        await runner.begin()
        with pytest.raises(InvalidPlantError):
            await runner.change_plant(SAMPLE.model_copy(update={"vehicles": (strange,)}))
        assert runner.service.engine.plant == SAMPLE
    store.close()
