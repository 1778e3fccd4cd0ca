"""After a restart robots hold their last reported positions and everything granted since."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nena_order_service.engine.engine import Engine
from nena_order_service.engine.state import VehicleRecord
from nena_order_service.fleet.failures import FailureKind
from nena_shared.fleet_api.transport_order import OrderSequenceRequest, TransportOrderState
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, later, make_engine, status_of

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 4000 * index) for index, name in enumerate("ABCDE")),
    paths=tuple(path(ends, 4000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "C D", "D E")),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)

S = TransportOrderState


def with_vehicles(**robots: str) -> PlantModel:
    """Return the plant with other vehicles: names by the serial numbers of their robots."""
    named = tuple(
        Vehicle(name=name, properties={"vda5050:serialNumber": robot}) for robot, name in robots.items()
    )
    return PLANT.model_copy(update={"vehicles": named})


def held(engine: Engine, name: str) -> list[str]:
    return [each.point for each in engine.traffic.held_by(name)]


def of_an_older_release(store: MemoryStore) -> None:
    """Remove the former names of vehicles from the store."""
    documents = {
        robot: VehicleRecord.model_validate_json(document).model_copy(update={"name": ""}).model_dump_json()
        for robot, document in store.found.vehicles.items()
    }
    store.found = replace(store.found, vehicles=documents)


async def before(store: MemoryStore, ahead: int = 1) -> None:
    """Put V1 on its way from A to C with a base to B, and V2 at E."""
    fleet = ScriptedFleet({"V1": "A", "V2": "E"})
    engine = await make_engine(PLANT, store, fleet, release_ahead=ahead)
    for name, at in tuple(fleet.at.items()):
        fleet.appear(name, at)
    engine.create(request("C", intendedVehicle="V1"), "T-1")
    fleet.accept("V1")


async def test_granted_resources_are_held_before_any_report() -> None:
    store = MemoryStore()
    await before(store)

    engine = await make_engine(PLANT, store, ScriptedFleet({}), release_ahead=1)

    assert held(engine, "V1") == ["A", "B"]
    assert held(engine, "V2") == ["E"]


async def test_no_base_is_extended_before_all_robots_have_reported() -> None:
    store = MemoryStore()
    await before(store)
    fleet = ScriptedFleet({"V1": "A", "V2": "E"}, mute={"V1", "V2"})
    engine = await make_engine(PLANT, store, fleet, release_ahead=1)

    fleet.mute.discard("V1")
    fleet.appear("V1", "A")
    fleet.pass_node("V1", 1)
    engine.create(request("D", intendedVehicle="V1"), "T-2")
    assert fleet.extended == []
    reason = status_of(engine, "T-1").reason
    assert reason.endswith("but it waits for the first state of V2")

    fleet.mute.clear()
    fleet.appear("V2", "D")
    assert held(engine, "V2") == ["D"]
    assert [len([node for node in vda_order.nodes if node.released]) for _, vda_order in fleet.extended] == [
        3
    ]


async def test_a_robot_that_stays_silent_keeps_its_resources() -> None:
    store = MemoryStore()
    await before(store)
    fleet = ScriptedFleet({"V1": "A", "V2": "E"}, mute={"V2"})
    engine = await make_engine(PLANT, store, fleet, release_ahead=1)
    fleet.appear("V1", "A")
    fleet.pass_node("V1", 1)
    assert fleet.extended == []

    engine.clock.advance(30.0)  # type: ignore[attr-defined] # the clock of make_engine
    engine.run_checks()

    assert len(fleet.extended) == 1
    assert held(engine, "V2") == ["E"]


async def test_what_an_unreadable_robot_may_still_drive_on_stays_held_until_it_is_read() -> None:
    store = MemoryStore()
    await before(store, ahead=2)
    fleet = ScriptedFleet({"V1": "A", "V2": "E"}, mute={"V1", "V2"})
    engine = await make_engine(PLANT, store, fleet)
    fleet.mute.clear()
    fleet.appear("V1", "A")
    fleet.appear("V2", "E")
    base = set(held(engine, "V1"))
    assert {"A", "B", "C"} <= base

    fleet.unreadable.add("V1")
    fleet.fail("V1", "unknown whether the robot has accepted it", FailureKind.UNCLEAR)
    later(engine, 1.0)
    fleet.appear("V1", "A")
    assert set(held(engine, "V1")) == base, "it stands, but perhaps with the order"

    fleet.unreadable.clear()
    later(engine, 1.0)
    fleet.appear("V1", "A")
    assert held(engine, "V1") == ["A"]


async def test_breaking_off_keeps_possible_positions_until_seen_standing() -> None:
    store = MemoryStore()
    await before(store, ahead=0)
    fleet = ScriptedFleet({"V1": "A", "V2": "E"}, mute={"V1", "V2"})
    engine = await make_engine(PLANT, store, fleet)
    fleet.mute.clear()
    fleet.fields["V1"] = {"driving": True}
    fleet.appear("V1", "A")
    fleet.appear("V2", "E")
    fleet.fail("V1", "it has lost its way")
    assert engine.traffic.broke_off("V1")
    beside = engine.traffic.sets_beside("V1")

    fleet = ScriptedFleet({"V1": "A", "V2": "E"}, mute={"V1", "V2"})
    again = await make_engine(PLANT, store, fleet)

    assert (held(again, "V1"), again.traffic.sets_beside("V1")) == (held(engine, "V1"), beside)
    assert again.traffic.broke_off("V1")
    fleet.mute.clear()
    fleet.fields["V1"] = {
        "mobile_robot_position": {"x": 2.0, "y": 1.5, "theta": 0.0, "map_id": "map", "localized": True}
    }
    fleet.appear("V1", "A")
    assert not again.traffic.broke_off("V1")
    assert {"A", "B"} <= set(held(again, "V1")), "the path between may be curved"

    del fleet.fields["V1"]
    fleet.appear("V1", "B")
    assert again.traffic.sets_beside("V1") is None
    last = await make_engine(PLANT, store, ScriptedFleet({}))
    assert last.traffic.sets_beside("V1") is None


async def test_a_path_lock_before_all_robots_report_grants_nothing() -> None:
    store = MemoryStore()
    await before(store)
    fleet = ScriptedFleet({"V1": "A", "V2": "E"}, mute={"V1", "V2"})
    engine = await make_engine(PLANT, store, fleet, release_ahead=1)

    engine.plant_changed()

    assert (fleet.sent, fleet.extended) == ([], [])
    assert held(engine, "V1") == ["A", "B"]
    assert status_of(engine, "T-1").state is S.BEING_PROCESSED
    fleet.mute.clear()
    for name in ("V1", "V2"):
        fleet.appear(name, fleet.at[name])
    fleet.pass_node("V1", 1)
    assert [robot for robot, _ in fleet.extended] == ["V1"]


async def test_points_and_paths_removed_from_the_plant_are_dropped() -> None:
    store = MemoryStore()
    await before(store)
    smaller = PlantModel(
        name="small", points=PLANT.points[:3], paths=PLANT.paths[:2], vehicles=PLANT.vehicles
    )

    engine = await make_engine(smaller, store, ScriptedFleet({}))

    assert held(engine, "V1") == ["A", "B"]
    assert "V2" not in engine.traffic


@pytest.mark.parametrize(
    "plant", [with_vehicles(V1="Truck", V2="V2"), with_vehicles(V1="V2", V2="V1")], ids=["new", "swapped"]
)
async def test_an_order_stays_with_its_renamed_robot(plant: PlantModel) -> None:
    store = MemoryStore()
    await before(store, ahead=0)
    now_called = plant.vehicles[0].name
    fleet = ScriptedFleet({"V1": "A", "V2": "E"})
    engine = await make_engine(plant, store, fleet)
    for name, at in tuple(fleet.at.items()):
        fleet.appear(name, at)
    order = engine.state.orders.named("T-1")
    assert order
    assert status_of(engine, "T-1").processing_vehicle == now_called

    engine.hold(order.number, "Ann", "tea")
    assert fleet.cancelled == ["V1"]
    fleet.confirm_cancel("V1")
    engine.resume(order.number, "Ann", "go")
    assert [robot for robot, _ in fleet.sent] == ["V1"]
    fleet.finish("V1")
    assert status_of(engine, "T-1").state is S.FINISHED
    assert status_of(engine, "T-1").reason == f"done by robot {now_called}"


async def test_an_order_of_a_removed_vehicle_is_held_and_ends() -> None:
    store = MemoryStore()
    await before(store, ahead=0)
    fleet = ScriptedFleet({"V1": "A", "V2": "E"})
    engine = await make_engine(with_vehicles(V2="V2"), store, fleet)
    order = engine.state.orders.named("T-1")
    assert order

    engine.hold(order.number, "Ann", "tea")
    assert fleet.cancelled == ["V1"]
    fleet.confirm_cancel("V1")
    assert status_of(engine, "T-1").state is S.FAILED
    assert status_of(engine, "T-1").reason == "robot 'V1' no longer exists"


async def test_an_unsent_order_is_not_executed_by_a_robot_with_another_order() -> None:
    store = MemoryStore()
    await before(store, ahead=0)
    fleet = ScriptedFleet({"V1": "A", "V2": "E"})
    engine = await make_engine(PLANT, store, fleet)
    for name, at in tuple(fleet.at.items()):
        fleet.appear(name, at)
    order = engine.state.orders.named("T-1")
    assert order
    engine.hold(order.number, "Ann", "tea")
    fleet.confirm_cancel("V1")
    engine.create(request("D", intendedVehicle="V2"), "T-2")
    of_an_older_release(store)

    again = await make_engine(with_vehicles(V2="V1"), store, ScriptedFleet({"V2": "E"}))

    assert status_of(again, "T-1").state is S.FAILED
    assert "'V1' is now another robot" in status_of(again, "T-1").reason
    other = status_of(again, "T-2")
    assert (other.state, other.processing_vehicle) == (S.BEING_PROCESSED, "V1")


@pytest.mark.parametrize(
    ("plant", "robot"),
    [
        (with_vehicles(V1="Truck", V2="V2"), "V1"),
        (with_vehicles(V1="V2", V2="V1"), "V1"),
        (with_vehicles(V1="Truck", V2="V1"), "V1"),
    ],
    ids=["new", "swapped", "its name is another's"],
)
async def test_a_held_order_continues_on_its_robot(plant: PlantModel, robot: str) -> None:
    store = MemoryStore()
    fleet = ScriptedFleet({"V1": "A", "V2": "E"})
    engine = await make_engine(PLANT, store, fleet)
    for name, at in tuple(fleet.at.items()):
        fleet.appear(name, at)
    engine.create(request("B", "C", intendedVehicle="V1"), "T-1")
    fleet.finish("V1")
    fleet.accept("V1")
    order = engine.state.orders.named("T-1")
    assert order
    engine.hold(order.number, "Ann", "tea")
    fleet.confirm_cancel("V1")

    after = ScriptedFleet(dict(fleet.at))
    again = await make_engine(plant, store, after)
    for name, at in tuple(after.at.items()):
        after.appear(name, at)
    again.resume(order.number, "Ann", "go")

    assert status_of(again, "T-1").processing_vehicle == plant.vehicles[0].name
    assert [sent for sent, _ in after.sent] == [robot]


@pytest.mark.parametrize(
    "plant", [with_vehicles(V1="Truck", V2="V2"), with_vehicles(V1="V2", V2="V1")], ids=["new", "swapped"]
)
async def test_a_sequence_stays_with_its_renamed_robot(plant: PlantModel) -> None:
    store, fleet = MemoryStore(), ScriptedFleet({"V1": "A", "V2": "E"})
    engine = await make_engine(PLANT, store, fleet)
    for name, at in tuple(fleet.at.items()):
        fleet.appear(name, at)
    with engine.change():
        engine.sequences.create(OrderSequenceRequest(), "S")
    engine.create(request("C", wrappingSequence="S"), "S-1")
    engine.create(request("A", wrappingSequence="S"), "S-2")
    first = fleet.sent[0][0]
    fleet.accept(first)

    after = ScriptedFleet({"V1": "A", "V2": "E"})
    again = await make_engine(plant, store, after)
    for name, at in tuple(after.at.items()):
        after.appear(name, at)
    after.finish(first)
    again.run_checks()

    assert [robot for robot, _ in after.sent] == [first]
    sequence = again.state.sequences.visible("S")
    assert sequence
    assert sequence.status.processing_vehicle == status_of(again, "S-2").processing_vehicle
    assert status_of(again, "S-2").state is S.BEING_PROCESSED


async def test_dependents_of_a_lost_order_fail_with_it() -> None:
    store = MemoryStore()
    await before(store)
    engine = await make_engine(PLANT, store, ScriptedFleet({}))
    engine.create(request("D", dependencies=["T-1"]), "T-2")
    store.found = replace(store.found, drives={1: "spoilt"})

    again = await make_engine(PLANT, store, ScriptedFleet({}))

    assert status_of(again, "T-1").reason == "the VDA order of the robot is unreadable"
    assert status_of(again, "T-2").state is S.FAILED
