"""What changes a plant model and what keeps it as it is; with real parts over a broker: test_plant_change."""

from __future__ import annotations

import pytest

from nena_demo.plants import sample_plant_path
from nena_order_service.app import OrderService, build
from nena_order_service.errors import InvalidPlantError, PlantInUseError, StoreNotReadyError
from nena_order_service.plant_file import load_plant
from nena_order_service.serving import CHANGING, Serving
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.database import open_database
from nena_order_service.store.store import Store
from nena_shared.plant import PlantModel
from nena_shared.tasks import Supervisor
from support.order_service import request

SAMPLE = load_plant(sample_plant_path())


def without(point: str) -> PlantModel:
    return PlantModel(
        name="less",
        points=tuple(each for each in SAMPLE.points if each.name != point),
        paths=tuple(each for each in SAMPLE.paths if point not in (each.source, each.destination)),
        vehicles=SAMPLE.vehicles,
    )


def serving_of(settings: OrderServiceSettings, store: Store, supervisor: Supervisor) -> Serving[OrderService]:
    return Serving(SAMPLE, store, supervisor, make=lambda model: build(settings, model, store))


async def test_model_is_put_in_use_as_a_whole_and_kept(settings: OrderServiceSettings) -> None:
    store = Store(open_database(settings.store.location()))
    shown: list[object] = []
    async with Supervisor() as supervisor:
        serving = serving_of(settings, store, supervisor)
        serving.show = shown.append
        await serving.begin()
        before = serving.parts
        before.kernel.create(request("South 2"), "T-1")

        with pytest.raises(PlantInUseError) as refused:
            await serving.change_plant(without("South 2"))
        assert "'T-1'" in str(refused.value.problems)
        await serving.change_plant(without("South 3"), check_only=True)
        assert (serving.parts, shown) == (before, [])

        await serving.change_plant(without("South 3"))
        assert serving.parts.kernel.plant == without("South 3")
        assert shown == [serving.parts.app]
        assert [order.name for order in serving.parts.kernel.book.unfinished()] == ["T-1"]
        with pytest.raises(StoreNotReadyError, match=CHANGING):
            before.kernel.create(request("South 2"), "T-2")
    async with Supervisor() as supervisor:
        again = serving_of(settings, store, supervisor)
        await again.begin()
        assert again.parts.kernel.plant == without("South 3")
    store.close()


async def test_model_that_cannot_be_led_is_refused(settings: OrderServiceSettings) -> None:
    store = Store(open_database(settings.store.location()))
    strange = SAMPLE.vehicles[0].model_copy(update={"properties": {"vda5050:version": "9.9"}})
    async with Supervisor() as supervisor:
        serving = serving_of(settings, store, supervisor)
        await serving.begin()
        with pytest.raises(InvalidPlantError):
            await serving.change_plant(SAMPLE.model_copy(update={"vehicles": (strange,)}))
        assert serving.parts.kernel.plant == SAMPLE
    store.close()
