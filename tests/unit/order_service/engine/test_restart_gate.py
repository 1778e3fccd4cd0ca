"""Whom a restart waits for, and how long."""

from __future__ import annotations

import asyncio

import pytest

from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.driving import RestartGate
from nena_order_service.engine.engine import Engine
from nena_shared.fleet_api.vehicle import IntegrationLevel
from nena_shared.plant import PlantModel, Vehicle
from support.clocks import ManualClock
from support.order_service import request
from support.pausing import turn_passes
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_context, make_engine, sent, status_of

PLANT = PlantModel(name="two", vehicles=(Vehicle(name="V1"), Vehicle(name="V2")))


def make(fleet: ScriptedFleet, clock: ManualClock, *remembered: str) -> RestartGate:
    context = make_context(PLANT, clock=clock, settings=EngineSettings(restart_patience=20.0))
    context.connect(fleet)
    gate = RestartGate(context, lambda: None)
    gate.wait_for(tuple(vehicle for vehicle in context.registry if vehicle.name in remembered))
    return gate


def opened(gate: RestartGate) -> bool:
    return gate.is_open


def test_robots_from_before_the_restart_are_waited_for() -> None:
    fleet, clock = ScriptedFleet({"V1": "A"}, mute={"V1"}), ManualClock()
    gate = make(fleet, clock, "V1", "V2")

    assert not opened(gate)
    assert str(gate.wait_reason) == "it waits for the first state of V1"

    fleet.mute.clear()
    assert opened(gate)
    assert gate.wait_reason is None


def test_the_gate_opens_after_the_timeout() -> None:
    fleet, clock = ScriptedFleet({"V1": "A"}, mute={"V1"}), ManualClock()
    gate = make(fleet, clock, "V1")

    clock.advance(19.9)
    assert not opened(gate)
    clock.advance(0.1)
    assert opened(gate)


def test_the_timeout_starts_when_the_broker_is_connected() -> None:
    fleet, clock = ScriptedFleet({"V1": "A"}, mute={"V1"}), ManualClock()
    gate = make(fleet, clock, "V1")
    fleet.connected = 0.0
    clock.advance(100.0)
    assert not opened(gate), "nobody could have spoken"

    fleet.connected = 19.9
    assert not opened(gate)
    fleet.connected = 20.0
    assert opened(gate)


def test_the_gate_stays_open_and_ignores_offline_robots() -> None:
    fleet, clock = ScriptedFleet({}), ManualClock()
    gate = make(fleet, clock, "V1")
    assert opened(gate)

    fleet.mute.add("V1")
    fleet.at["V1"] = "A"
    assert opened(gate)


def test_retained_connection_messages_are_awaited_first() -> None:
    fleet, clock = ScriptedFleet({}), ManualClock()
    fleet.unknown = True
    gate = make(fleet, clock)

    assert not opened(gate)
    assert "each robot" in str(gate.wait_reason)


def test_a_vehicle_that_has_never_been_heard_is_waited_for() -> None:
    fleet, clock = ScriptedFleet({"V1": "A"}, unheard={"V2"}), ManualClock()
    gate = make(fleet, clock, "V1", "V2")

    assert not opened(gate), "it may stand anywhere"
    assert str(gate.wait_reason) == "it waits for the first state of V2"

    fleet.at["V2"] = "B"
    fleet.unheard.clear()
    assert opened(gate)


def test_of_many_awaited_vehicles_the_reason_names_the_first() -> None:
    names = [f"V{number}" for number in range(1000)]
    plant = PlantModel(name="many", vehicles=tuple(Vehicle(name=name) for name in names))
    context = make_context(plant)
    context.connect(ScriptedFleet({}, unheard=set(names)))
    gate = RestartGate(context, lambda: None)
    gate.wait_for(context.registry)

    assert str(gate.wait_reason) == "it waits for the first state of V0, V1, V2, V3, V4, …"


async def test_no_order_is_sent_before_every_vehicle_of_the_plant_has_answered() -> None:
    """With an empty store, on a broker that tells nothing of V2: it stands on the way."""
    plant = PlantModel(
        name="one path",
        points=(point("A"), point("B", 1000), point("C", 2000)),
        paths=(path("A B"), path("B C")),
        vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
    )
    fleet = ScriptedFleet({"V1": "A"}, unheard={"V2"})
    engine = await make_engine(plant, MemoryStore(), fleet)
    fleet.appear("V1", "A")
    engine.create(request("C", intendedVehicle="V1"), "T")
    assert sent(fleet) == []
    assert status_of(engine).reason.endswith("it waits for the first state of V2")

    fleet.unheard.clear()
    fleet.appear("V2", "B")
    released = {
        node.node_id for name, order in fleet.sent for node in order.nodes if node.released and name == "V1"
    }
    assert released <= {"A"}


async def test_after_a_restart_the_others_drive_around_a_vehicle_that_is_not_heard_again() -> None:
    plant = PlantModel(
        name="two ways",
        points=(point("A"), point("B", 1000), point("C", 2000), point("D", 0, 1000), point("E", 9000)),
        paths=(path("A B"), path("B C"), path("A D")),
        vehicles=(Vehicle(name="V1"), Vehicle(name="V2"), Vehicle(name="Planned")),
    )
    store, before = MemoryStore(), ScriptedFleet({}, unheard={"Planned"})
    first = await make_engine(plant, store, before)
    before.appear("V1", "A")
    before.appear("V2", "B")
    first.close("restart")

    fleet = ScriptedFleet({"V1": "A"}, unheard={"V2", "Planned"})
    engine = await make_engine(plant, store, fleet)
    fleet.appear("V1", "A")
    engine.create(request("D", intendedVehicle="V1"), "past V2")
    assert sent(fleet) == [("V1", "past V2-0")], "neither V2 nor Planned stops it"

    fleet.finish("V1")
    engine.create(request("C", intendedVehicle="V1"), "over V2")
    released = {node.node_id for _, order in fleet.sent for node in order.nodes if node.released}
    assert "B" not in released, "V2 may still stand there"


@pytest.mark.parametrize("level", [IntegrationLevel.TO_BE_IGNORED, IntegrationLevel.TO_BE_NOTICED])
async def test_a_vehicle_that_others_do_not_avoid_is_not_waited_for(level: IntegrationLevel) -> None:
    store = MemoryStore()
    engine = await make_engine(PLANT, store, ScriptedFleet({"V1": "A"}, unheard={"V2"}))
    vehicle = engine.registry.named("V2")
    assert vehicle
    engine.set_integration_level(vehicle, level)

    again = await make_engine(PLANT, store, ScriptedFleet({"V1": "A"}, unheard={"V2"}))
    assert again._gate.is_open


async def test_a_changed_plant_model_does_not_wait_again_for_a_robot_that_does_not_exist() -> None:
    fleet, store = ScriptedFleet({}, unheard={"V2"}), MemoryStore()
    plant = PlantModel(name="one", points=(point("A"),), vehicles=PLANT.vehicles)
    engine = await make_engine(plant, store, fleet)
    assert not engine._gate.is_open, "it may stand anywhere"
    fleet.appear("V1", "A")
    vehicle = engine.registry.named("V2")
    assert vehicle
    engine.set_integration_level(vehicle, IntegrationLevel.TO_BE_UTILIZED)

    again = Engine(make_context(plant), store)
    await again.start(fleet)
    assert again._gate.is_open


async def test_an_order_is_sent_as_soon_as_the_gate_opens() -> None:
    plant = PlantModel(
        name="one path",
        points=(point("A"), point("B", 2000)),
        paths=(path("A B"),),
        vehicles=(Vehicle(name="V1"),),
    )
    fleet = ScriptedFleet({"V1": "A"}, unknown=True)
    engine = await make_engine(plant, MemoryStore(), fleet)
    engine.create(request("B"), "T")
    assert sent(fleet) == []

    fleet.unknown = False
    checks = asyncio.create_task(engine.run())
    for _ in range(10):  # turns of the event loop, far fewer than until the next check by the clock
        await turn_passes()
    checks.cancel()
    assert sent(fleet) == [("V1", "T-0")]
