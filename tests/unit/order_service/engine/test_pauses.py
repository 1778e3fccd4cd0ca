"""Vehicles that wait with an order, and why."""

from __future__ import annotations

from nena_order_service.engine.engine import Engine
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine, status_of

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("AB")),
    paths=(path("A B"),),
    vehicles=(Vehicle(name="V1"),),
)


async def restarted(**places: str) -> tuple[Engine, ScriptedFleet]:
    """Restart after an order was assigned, before its robot was sent anything."""
    store = MemoryStore()
    engine = await make_engine(PLANT, store, ScriptedFleet({"V1": "A"}))
    engine.create(request("B"), "T")
    store.found.drives.clear()
    fleet = ScriptedFleet(places)
    return await make_engine(PLANT, store, fleet), fleet


async def test_a_robot_whose_first_state_does_not_locate_it_is_waited_for() -> None:
    engine, fleet = await restarted()
    engine.run_checks()
    assert status_of(engine).reason.endswith("but the robot is offline")

    fleet.appear("V1", "nowhere")
    assert status_of(engine).state is TransportOrderState.BEING_PROCESSED
    assert "set its initial pose" in status_of(engine).reason
    assert fleet.sent == []

    fleet.appear("V1", "A")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["T-0"]
    assert status_of(engine).reason == "robot V1 travels to destination 1 of 1"
