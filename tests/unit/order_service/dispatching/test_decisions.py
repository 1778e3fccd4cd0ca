"""Which orders and vehicles come together, and when orders are told why they wait."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from nena_order_service.dispatching.settings import DispatchSettings
from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.life_cycle import REASONS_PER_CHECK
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.fleet_api.vehicle import IntegrationLevel
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import ForgetfulStore, ScriptedFleet, make_engine
from support.waiting import until

NAMES = "ABCDEFGH"
PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 4000 * index) for index, name in enumerate(NAMES)),
    paths=tuple(path(f"{a} {b}", 4000) for one, two in pairwise(NAMES) for a, b in ((one, two), (two, one))),
    vehicles=tuple(Vehicle(name=name) for name in ("V1", "V2")),
)


async def waiting(number: int, **settings: Any) -> tuple[Engine, ScriptedFleet]:
    """Start an engine whose vehicle V1 works while so many orders wait; V2 is away."""
    fleet = ScriptedFleet({"V1": "A"})
    dispatch = DispatchSettings.model_validate({"energy": {"respected": False}, **settings})
    engine_settings = EngineSettings(default_map_id="map", traffic=False, dispatch=dispatch)
    engine = await make_engine(PLANT, ForgetfulStore(), fleet, settings=engine_settings)
    engine.create(request("B"), "first")
    for index in range(number):
        engine.create(request(NAMES[index % len(NAMES)]), f"T{index}")
    assert len(engine.state.orders.waiting) == number
    return engine, fleet


async def test_wait_reasons_of_a_long_queue_are_updated_bit_by_bit() -> None:
    engine, _ = await waiting(REASONS_PER_CHECK + 50)
    away = engine.registry.named("V2")
    assert away

    def outdated() -> list[str]:
        orders = engine.state.orders.dispatchable()
        return [order.name for order in orders if "is set to" not in order.status.reason]

    engine.set_integration_level(away, IntegrationLevel.TO_BE_RESPECTED)
    assert outdated() == [f"T{index}" for index in range(REASONS_PER_CHECK, REASONS_PER_CHECK + 50)]
    engine.run_checks()
    assert outdated() == []


async def test_no_order_overtakes_one_that_is_of_an_earlier_age_window() -> None:
    engine, fleet = await waiting(0, age_window=10)
    clock = engine.clock
    engine.create(request("H"), "far")
    clock.advance(11)  # type: ignore[attr-defined]
    engine.create(request("B"), "near")
    fleet.finish("V1")
    assert fleet.sent[-1][1].order_id == "far-0"


async def test_a_vehicle_takes_the_order_nearest_to_its_unloading_point() -> None:
    engine, fleet = await waiting(0)
    engine.create(request("H"), "far")
    engine.create(request("B"), "near")
    fleet.finish("V1")
    assert fleet.sent[-1][1].order_id == "near-0"
    far = engine.state.orders.named("far")
    assert far
    assert far.state is TransportOrderState.DISPATCHABLE


async def test_a_whole_fleet_is_dispatched_at_once() -> None:
    number = 60
    points = tuple(point(f"P{index}", 4000 * index) for index in range(number))
    names = [f"V{index}" for index in range(number)]
    plant = PlantModel(name="p", points=points, vehicles=tuple(Vehicle(name=each) for each in names))
    fleet = ScriptedFleet({name: f"P{index}" for index, name in enumerate(names)})
    fleet.out_of_order.update(names)
    settings = EngineSettings(default_map_id="map", traffic=False)
    engine = await make_engine(plant, ForgetfulStore(), fleet, settings=settings)
    for index in range(number):
        engine.create(request(f"P{index}"), f"T{index}")
    assert fleet.sent == []
    fleet.out_of_order.clear()
    engine.run_checks()
    assert not len(engine.state.orders.waiting)
    await until(lambda: len(fleet.sent) == number)
    assert all(robot[1:] == vda_order.order_id[1:-2] for robot, vda_order in fleet.sent)
