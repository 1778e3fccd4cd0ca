"""A unit of work that fails: the service is rebuilt from its store by itself; real parts, no broker."""

from __future__ import annotations

from contextlib import suppress

import httpx
import pytest

from nena_demo.plants import sample_plant_path
from nena_order_service import runner as runner_module
from nena_order_service.errors import StoreNotReadyError
from nena_order_service.plant_file import load_plant
from nena_order_service.runner import ServiceRunner
from nena_order_service.service import OrderService
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.schema import open_database
from nena_order_service.store.store import Store
from nena_shared.tasks import Supervisor
from support.order_service import dispatchable_order, request
from support.pausing import turn_passes
from support.waiting import until

pytestmark = pytest.mark.provokes_failures
FILE = load_plant(sample_plant_path())


class ProvokedError(Exception):
    """What the test makes fail."""


def fail_half_way(service: OrderService) -> None:
    """Fail in a unit of work that has changed an order in memory."""
    engine = service.engine
    with suppress(ProvokedError), engine.change():
        engine.state.orders.put(dispatchable_order(number=engine.state.orders.next_number()))
        raise ProvokedError


async def problems_of(service: OrderService) -> tuple[int, str]:
    async with httpx.AsyncClient(transport=httpx.ASGITransport(service.app), base_url="http://it") as client:
        answer = await client.get("/readyz")
        return answer.status_code, answer.text


async def test_it_is_rebuilt_from_the_store(settings: OrderServiceSettings) -> None:
    store = Store(open_database(settings.store.location()))
    shown: list[object] = []
    async with Supervisor() as supervisor:
        runner = ServiceRunner(
            FILE,
            store,
            supervisor,
            make=lambda model: OrderService(settings, model, store),
            show=shown.append,
        )
        await runner.begin()
        failed = runner.service
        failed.engine.create(request("South 2"), "T-0")
        fail_half_way(failed)
        with pytest.raises(StoreNotReadyError, match="restarts from its store"):
            failed.engine.create(request("South 2"), "T-2")
        with pytest.raises(StoreNotReadyError, match="restarts from its store"):
            await failed.engine.unit_of_work.wait_committed()
        status, problems = await problems_of(failed)
        assert (status, "internal error" in problems) == (503, True)

        await until(lambda: shown, what="another application")
        assert runner.service is not failed
        orders = runner.service.engine.state.orders
        assert [order.name for order in orders.unfinished()] == ["T-0"]
        runner.service.engine.create(request("South 2"), "T-2")
        assert "internal error" not in (await problems_of(runner.service))[1]
        assert not supervisor._failed or not supervisor._failed.done()
    store.close()


async def test_periodic_checks_do_not_end_the_program(
    settings: OrderServiceSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nena_order_service.engine.engine.CHECK_INTERVAL", 0.01)
    monkeypatch.setattr("nena_order_service.engine.engine.FIRST_CHECK_INTERVAL", 0.01)
    store = Store(open_database(settings.store.location()))
    async with Supervisor() as supervisor:
        runner = ServiceRunner(
            FILE,
            store,
            supervisor,
            make=lambda model: OrderService(settings, model, store),
            show=lambda _: None,
        )
        await runner.begin()
        failed = runner.service

        def fail(_: object) -> None:
            raise ProvokedError

        monkeypatch.setattr(failed.engine.stops, "pause_or_resume", fail)
        await until(lambda: runner.service is not failed)
        assert supervisor._failed is not None
        assert not supervisor._failed.done()
    store.close()


async def test_it_is_not_rebuilt_again_and_again_without_a_pause(
    settings: OrderServiceSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runner_module, "RESTART_PAUSE", 3600.0)
    store = Store(open_database(settings.store.location()))
    built = []
    async with Supervisor() as supervisor:

        def make(model: object) -> OrderService:
            built.append(model)
            return OrderService(settings, FILE.model, store)

        runner = ServiceRunner(FILE, store, supervisor, make=make, show=lambda _: None)
        await runner.begin()
        failed = runner.service
        fail_half_way(failed)
        await until(lambda: runner.service is not failed)
        fail_half_way(runner.service)
        await turn_passes()
        assert len(built) == 2
    store.close()
