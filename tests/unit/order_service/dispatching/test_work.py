"""The work of a decision does not grow with the queue; counted in calls, for clocks vary."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import pairwise
from typing import Any

import pytest

from nena_order_service.dispatching.settings import Chooser, DispatchSettings
from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.dispatching import (
    EXPLAINED_AT_ONCE,
    EXPLAINED_FIRST,
    ORDERS_FOR_EACH,
    ORDERS_FOR_MANY,
    ORDERS_FOR_ONE,
)
from nena_order_service.engine.engine import LOOKED_AT_ONCE, Engine
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant import PlantModel, Vehicle
from support.operations import calls_of
from support.order_service import request
from support.pausing import turn_passes
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
FEW, MANY = 60, 600
"""Orders that wait."""
ALIKE = 1.2
"""How much more work one event may be with ten times as many of them."""


async def waiting(number: int, settings: dict[str, Any], **order: Any) -> tuple[Engine, ScriptedFleet]:
    """Start an engine whose vehicle V1 works while so many orders wait; V2 is away."""
    fleet = ScriptedFleet({"V1": "A"})
    dispatch = DispatchSettings.model_validate({"energy": {"respected": False}, **settings})
    engine_settings = EngineSettings(default_map_id="map", traffic=False, dispatch=dispatch)
    engine = await make_engine(PLANT, ForgetfulStore(), fleet, settings=engine_settings)
    engine.create(request("B"), "first")
    for index in range(number):
        engine.create(request(NAMES[index % len(NAMES)], **order), f"T{index}")
    assert len(engine.state.orders.waiting) == number
    return engine, fleet


@pytest.mark.parametrize(
    ("settings", "order"),
    [
        ({"choosers": Chooser.TOGETHER}, {}),
        ({"choosers": Chooser.ORDERS}, {}),
        ({"choosers": Chooser.TOGETHER}, {"intendedVehicle": "V2"}),
    ],
    ids=["together", "orders choose", "for another vehicle"],
)
async def test_the_end_of_an_order_costs_the_same_with_a_long_queue(
    settings: dict[str, Any], order: dict[str, Any]
) -> None:
    calls = []
    for number in (FEW, MANY):
        engine, fleet = await waiting(number, settings, **order)
        fleet.finish("V1")  # what is found out once is found out now
        if not order:
            assert fleet.finish("V1")
            calls.append(calls_of(lambda fleet=fleet: fleet.finish("V1")))  # type: ignore[misc]
        else:
            fleet.appear("V1", "A")
            engine.create(request("B", intendedVehicle="V1"), "again")
            calls.append(calls_of(lambda fleet=fleet: fleet.finish("V1")))  # type: ignore[misc]
    assert calls[1] < calls[0] * ALIKE, calls


async def test_the_end_of_an_order_costs_the_same_with_many_kinds_of_orders() -> None:
    calls = []
    for number in (FEW, MANY):
        engine, fleet = await waiting(0, {})
        for index in range(number):
            engine.create(request(NAMES[index % len(NAMES)], type=f"type {index}"), f"T{index}")
        fleet.finish("V1")
        calls.append(calls_of(lambda fleet=fleet: fleet.finish("V1")))  # type: ignore[misc]
    assert calls[1] < calls[0] * ALIKE, calls


async def test_a_new_order_costs_the_same_with_a_long_queue() -> None:
    calls = []
    for number in (FEW, MANY):
        engine, _ = await waiting(number, {})
        calls.append(calls_of(lambda engine=engine: engine.create(request("C"), "new")))  # type: ignore[misc]
    assert calls[1] < calls[0] * ALIKE, calls


async def test_costs_are_cached_across_decisions(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, fleet = await waiting(FEW, {})
    fleet.finish("V1")
    known = engine._dispatching._costs
    looked_at: list[object] = []
    found = known.ways.of

    def counted(*arguments: Any, **more: Any) -> object:
        looked_at.append(arguments)
        return found(*arguments, **more)

    monkeypatch.setattr(known.ways, "of", counted)
    fleet.finish("V1")
    assert len(looked_at) <= 2  # that of the order that has come nearer to the head of the queue
    engine.plant_changed()
    assert len(looked_at) <= 2
    fleet.finish("V1")
    assert len(looked_at) > 20


async def test_wait_reasons_of_all_orders_are_updated_eventually() -> None:
    engine, fleet = await waiting(FEW, {})
    del fleet.at["V1"]
    engine.on_events()
    for _ in range(3):
        engine.look()
    reasons = {each.status.reason for each in engine.state.orders.dispatchable()}
    assert len(reasons) == 1
    assert "offline" in reasons.pop()


async def test_no_order_overtakes_one_that_is_of_an_earlier_age_window() -> None:
    engine, fleet = await waiting(0, {"age_window": 10})
    clock = engine.clock
    engine.create(request("H"), "far")
    clock.advance(11)  # type: ignore[attr-defined]
    engine.create(request("B"), "near")
    fleet.finish("V1")
    assert fleet.sent[-1][1].order_id == "far-0"


async def test_a_vehicle_takes_the_order_nearest_to_its_unloading_point() -> None:
    engine, fleet = await waiting(0, {})
    engine.create(request("H"), "far")
    engine.create(request("B"), "near")
    fleet.finish("V1")
    assert fleet.sent[-1][1].order_id == "near-0"
    far = engine.state.orders.named("far")
    assert far
    assert far.state is TransportOrderState.DISPATCHABLE


async def test_a_whole_fleet_is_dispatched_in_slices() -> None:
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
    engine.look()
    slices = [len(fleet.sent)]
    while slices[-1] < number and len(slices) < 2 * number:
        await turn_passes()
        slices.append(len(fleet.sent))
    assert slices[-1] == number
    assert (
        max(after - before for before, after in pairwise([0, *slices])) <= EXPLAINED_FIRST + ORDERS_FOR_MANY
    )
    assert all(robot[1:] == vda_order.order_id[1:-2] for robot, vda_order in fleet.sent)


@pytest.mark.parametrize("named", [True, False])
async def test_an_order_for_each_vehicle_costs_the_same_in_a_large_fleet(*, named: bool) -> None:
    calls = []
    for number in (20, 100):
        lanes = [f"{lane}-{end}" for lane in range(number) for end in (0, 1)]
        plant = PlantModel(
            name="lanes",
            points=tuple(point(name, 4000 * index) for index, name in enumerate(lanes)),
            paths=tuple(path(f"{lane}-0 {lane}-1", 4000) for lane in range(number)),
            vehicles=tuple(Vehicle(name=f"V{lane}") for lane in range(number)),
        )
        fleet = ScriptedFleet({f"V{lane}": f"{lane}-0" for lane in range(number)})
        settings = EngineSettings(default_map_id="map")
        engine = await make_engine(plant, ForgetfulStore(), fleet, settings=settings)
        for name, place in tuple(fleet.at.items()):
            fleet.appear(name, place)
        orders = [
            request(f"{lane}-1", **({"intendedVehicle": f"V{lane}"} if named else {}))
            for lane in range(number)
        ]
        counted = calls_of(
            lambda engine=engine, orders=orders: [  # type: ignore[misc]
                engine.create(order, f"T{index}") for index, order in enumerate(orders)
            ]
        )
        assert len(fleet.sent) == number
        calls.append(counted / number)
    assert calls[1] < calls[0] * ALIKE, calls


async def test_a_vehicle_freed_during_an_offer_takes_the_most_urgent_order() -> None:
    far, near = tuple(f"P{index}" for index in range(8)), ("A", "B")
    points = tuple(point(name, 4000 * index) for index, name in enumerate((*far, *near)))
    paths = tuple(path(f"{a} {b}", 4000) for a, b in pairwise(far))
    names = ("V1", "V2")
    plant = PlantModel(
        name="p", points=points, paths=paths, vehicles=tuple(Vehicle(name=each) for each in names)
    )
    fleet = ScriptedFleet({"V1": "A", "V2": "P0"})
    fleet.out_of_order.update(names)
    dispatch = DispatchSettings(age_window=0)
    settings = EngineSettings(default_map_id="map", traffic=False, dispatch=dispatch)
    engine = await make_engine(plant, ForgetfulStore(), fleet, settings=settings)
    for index in range(3 * (ORDERS_FOR_ONE + ORDERS_FOR_EACH)):
        named = {"intendedVehicle": "V1"} if index < EXPLAINED_FIRST else {}  # these are looked at each time
        engine.create(request("P7", **named), f"T{index}")
    fleet.out_of_order.discard("V1")  # which has no way to any of them
    engine.look()
    assert fleet.sent == []
    fleet.out_of_order.discard("V2")
    fleet.appear("V2", "P0")
    await turn_passes()
    assert [vda_order.order_id for _, vda_order in fleet.sent] == [f"T{EXPLAINED_FIRST}-0"]


TWICE = 2 * LOOKED_AT_ONCE
"""Vehicles are looked at once to compare them, and once to publish them."""


async def large_fleet(monkeypatch: pytest.MonkeyPatch) -> tuple[Engine, list[int]]:
    """Start an engine with many vehicles; the numbers count those checked before each pause."""
    names = [f"V{index}" for index in range(3 * LOOKED_AT_ONCE)]
    plant = PlantModel(
        name="p",
        points=(point("A"), point("B", 4000)),
        paths=(path("A B", 4000),),
        vehicles=tuple(Vehicle(name=each) for each in names),
    )
    engine = await make_engine(plant, ForgetfulStore(), ScriptedFleet({}))
    looks: list[int] = [0]
    consider = engine._dispatching.consider

    def counted(vehicle: Any) -> Any:
        looks[-1] += 1
        return consider(vehicle)

    for owner, name in ((engine._dispatching._candidates, "_consider"), (engine._dispatching, "consider")):
        monkeypatch.setattr(owner, name, counted)
    return engine, looks


@asynccontextmanager
async def turns_counted(looks: list[int]) -> AsyncIterator[None]:
    """Begin a new number whenever other tasks have had their turn."""

    async def count() -> None:
        while True:
            looks.append(0)
            await turn_passes()

    task = asyncio.create_task(count())
    try:
        yield
    finally:
        task.cancel()


async def test_after_a_path_lock_a_large_fleet_is_checked_in_slices(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine, looks = await large_fleet(monkeypatch)
    running = asyncio.create_task(engine.run())
    async with turns_counted(looks):
        engine.plant_changed()
        await until(lambda: sum(looks) >= 3 * LOOKED_AT_ONCE)
    running.cancel()
    assert max(looks) <= TWICE


async def test_an_order_is_explained_in_slices(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, looks = await large_fleet(monkeypatch)
    order = engine.create(request("A"), "T")
    async with turns_counted(looks):
        assert len(await engine.explain(order)) == 3 * LOOKED_AT_ONCE
    assert max(looks) <= EXPLAINED_AT_ONCE


async def test_a_large_fleet_is_checked_in_slices(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, looks = await large_fleet(monkeypatch)
    parts = engine._look([*engine.registry])
    while next(parts, parts) is not parts:
        looks.append(0)
    assert sum(looks) >= 3 * LOOKED_AT_ONCE
    assert max(looks) <= TWICE
