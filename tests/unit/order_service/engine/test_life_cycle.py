"""Orders between their vehicles' VDA orders."""

from __future__ import annotations

from functools import partial

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, engine_with, status_of

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 4000 * index) for index, name in enumerate("ABCP")),
    paths=tuple(path(ends, 4000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "B P")),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)

make = partial(engine_with, PLANT)


async def test_the_next_drive_order_waits_for_traffic_with_a_reason() -> None:
    engine, fleet = await make(MemoryStore(), V1="A", V2="C")
    fleet.out_of_order.add("V2")
    engine.create(request("B", "C", intendedVehicle="V1"), "T")
    assert fleet.finish("V1")

    assert status_of(engine, "T").current_drive_order_index == 1
    assert status_of(engine, "T").reason.endswith("but it waits for V2, which stands on 'C'")
    fleet.out_of_order.clear()
    fleet.appear("V2", "P")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["T-0", "T-1"]


async def test_a_robot_lost_before_its_order_is_sent_is_named() -> None:
    engine, fleet = await make(MemoryStore(), V1="A", V2="B")
    engine.create(request("C", intendedVehicle="V1"), "T")
    del fleet.at["V1"]
    engine.run_checks()

    assert status_of(engine, "T").reason.endswith("but the robot is offline")
    assert status_of(engine, "T").state is TransportOrderState.BEING_PROCESSED


async def test_an_order_between_two_drive_orders_continues_after_a_restart() -> None:
    store = MemoryStore()
    engine, fleet = await make(store, V1="A", V2="C")
    fleet.out_of_order.add("V2")
    engine.create(request("B", "C", intendedVehicle="V1"), "T")
    assert fleet.finish("V1")

    again, fleet = await make(store, V1="B", V2="P")

    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["T-1"]
    assert fleet.finish("V1")
    assert status_of(again, "T").state is TransportOrderState.FINISHED
