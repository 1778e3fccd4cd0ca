"""Order types that vehicles accept, by plant model and hosts."""

from __future__ import annotations

from datetime import UTC, datetime

from nena_order_service.engine.engine import Engine
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.fleet_api.vehicle import AcceptableOrderType
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine, status_of

ONLY_CHARGE = {"nena:acceptableOrderTypes": "Charge, Park"}
PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 4000 * index) for index, name in enumerate("ABC")),
    paths=tuple(path(ends, 4000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C")),
    vehicles=(Vehicle(name="V1", properties=ONLY_CHARGE),),
)
ANY = AcceptableOrderType(name="*", priority=3)


async def make(store: MemoryStore) -> tuple[Engine, FleetVehicle]:
    fleet = ScriptedFleet({"V1": "A"})
    engine = await make_engine(PLANT, store, fleet)
    fleet.appear("V1", "A")
    vehicle = engine.registry.named("V1")
    assert vehicle
    return engine, vehicle


async def test_an_order_waits_until_its_type_is_accepted_also_after_a_restart() -> None:
    store = MemoryStore()
    engine, vehicle = await make(store)
    engine.create(request("B", type="Transport"), "T")
    engine.run_checks()
    said = "accepts no orders of type 'Transport', only 'Charge', 'Park'"
    assert status_of(engine, "T").reason == f"waits for a robot: each of them {said}"
    assert "no waiting order suits it" in engine.reporter.vehicle_status(vehicle).reason

    engine.accept_order_types(vehicle, ())
    assert status_of(engine, "T").reason.endswith("each of them accepts no orders of any type")
    engine.accept_order_types(vehicle, (ANY,))
    assert status_of(engine, "T").state is TransportOrderState.BEING_PROCESSED

    again, vehicle = await make(store)
    assert again.reporter.vehicle_status(vehicle).acceptable_order_types == (ANY,)


async def test_an_intended_vehicle_that_does_not_accept_the_type_is_named() -> None:
    engine, _ = await make(MemoryStore())
    engine.create(request("B", intendedVehicle="V1"), "T")
    assert status_of(engine, "T").reason.startswith(
        "waits for robot 'V1', which accepts no orders of type '-'"
    )


async def test_an_order_past_its_deadline_is_late_and_continues() -> None:
    engine, vehicle = await make(MemoryStore())
    engine.create(request("B", type="Charge", deadline=datetime(2000, 1, 1, tzinfo=UTC)), "T")
    assert not status_of(engine, "T").late
    engine.run_checks()
    engine.run_checks()
    told = status_of(engine, "T")
    assert told.late
    assert told.state is TransportOrderState.BEING_PROCESSED
    assert [entry.event_code for entry in told.history].count("nena:deadlinePassed") == 1
    assert engine.reporter.vehicle_status(vehicle).transport_order == "T"
