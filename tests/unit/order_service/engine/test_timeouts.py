"""Orders that are not done in time."""

from __future__ import annotations

from datetime import timedelta

from nena_order_service.engine.engine import Engine
from nena_shared.fleet_api.transport_order import OrderOutcome, TransportOrderState
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, later, make_engine, status_of

S = TransportOrderState

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("AB")),
    paths=(path("A B"),),
    vehicles=(Vehicle(name="V1"),),
)


async def make(store: MemoryStore) -> tuple[Engine, ScriptedFleet]:
    fleet = ScriptedFleet({"V1": "A"})
    return await make_engine(PLANT, store, fleet), fleet


async def test_an_order_that_takes_too_long_is_cancelled_at_the_robot() -> None:
    engine, fleet = await make(MemoryStore())
    engine.create(request("B", timeout=60), "T")
    later(engine, 59)
    assert (status_of(engine).state, fleet.cancelled) == (S.BEING_PROCESSED, [])
    later(engine, 1)
    assert (status_of(engine).state, fleet.cancelled) == (S.WITHDRAWN, ["V1"])
    later(engine, 5)
    assert fleet.cancelled == ["V1"]
    fleet.confirm_cancel("V1")
    assert status_of(engine).state is S.FAILED
    assert status_of(engine).reason == (
        "withdrawn: timeout: not done within 60 s of its creation; the robot has released it"
    )
    assert status_of(engine).outcome is OrderOutcome.FAILED, "nobody wanted its end"


async def test_a_changed_deadline_and_timeout_replace_the_earlier_ones() -> None:
    engine, fleet = await make(MemoryStore())
    fleet.out_of_order.add("V1")
    soon = engine.clock.now() + timedelta(seconds=60)
    number = engine.create(request("B", deadline=soon, timeout=60), "T").number
    engine.change_order(number, {"deadline": None, "timeout": 300})
    later(engine, 61)
    assert (status_of(engine).state, status_of(engine).late) == (S.DISPATCHABLE, False)
    engine.change_order(number, {"deadline": soon})
    later(engine, 1)
    assert status_of(engine).late
    later(engine, 300)
    assert status_of(engine).state is S.FAILED


async def test_an_order_is_late_only_after_its_deadline() -> None:
    engine, _ = await make(MemoryStore())
    engine.create(request("B", deadline=engine.clock.now() + timedelta(seconds=60)), "T")
    later(engine, 60)
    assert not status_of(engine).late
    later(engine, 1)
    assert status_of(engine).late


async def test_an_order_that_is_not_started_times_out_at_once() -> None:
    engine, fleet = await make(MemoryStore())
    fleet.out_of_order.add("V1")
    engine.create(request("B", timeout=60), "T")
    later(engine, 61)
    assert status_of(engine).reason == "timeout: not done within 60 s of its creation"


async def test_the_processing_time_starts_with_the_first_vehicle_and_survives_a_restart() -> None:
    store = MemoryStore()
    engine, fleet = await make(store)
    fleet.out_of_order.add("V1")
    engine.create(request("B", processingTimeout=60), "T")
    later(engine, 100)
    fleet.out_of_order.clear()
    later(engine, 0)
    assert status_of(engine).state is S.BEING_PROCESSED

    again, fleet = await make(store)
    later(again, 100)
    later(again, 60)
    assert fleet.cancelled == ["V1"]
    fleet.confirm_cancel("V1")
    assert "within 60 s of its assignment" in status_of(again).reason


async def test_orders_done_in_time_do_not_time_out() -> None:
    engine, fleet = await make(MemoryStore())
    engine.create(request("B", timeout=60), "T")
    fleet.finish("V1")
    later(engine, 100)
    assert status_of(engine).state is S.FINISHED


async def test_a_gentle_withdrawal_becomes_an_immediate_one_in_time() -> None:
    engine, fleet = await make(MemoryStore())
    order = engine.create(request("B", timeout=60), "T")
    engine.withdraw(order.number, "not wanted", immediate=False)
    assert fleet.cancelled == []
    later(engine, 60)
    assert fleet.cancelled == ["V1"]
