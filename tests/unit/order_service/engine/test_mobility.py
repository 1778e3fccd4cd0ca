"""Which vehicles traffic control may send away, and which have an unknown departure time."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from nena_order_service.engine.driving import RELOCATION_PAUSE, Mobility
from nena_order_service.engine.engine import Engine
from nena_order_service.orders.drive import Drive
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import assigned_order, request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine, reason_of

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("AB")),
    paths=(path("A B"),),
    vehicles=(Vehicle(name="V1"),),
)


async def make() -> tuple[Engine, ScriptedFleet, Mobility]:
    fleet = ScriptedFleet({"V1": "A"})
    engine = await make_engine(PLANT, MemoryStore(), fleet)
    fleet.appear("V1", "A")
    return engine, fleet, engine._driving.mobility


async def test_a_free_vehicle_may_be_sent_away() -> None:
    _, _, mobility = await make()
    assert (mobility.can_move("V1"), mobility.is_lost("V1")) == (True, False)
    assert (mobility.can_move("nobody"), mobility.is_lost("nobody")) == (False, True)


async def test_a_vehicle_with_a_held_order_stays_and_others_do_not_wait_for_it() -> None:
    engine, fleet, mobility = await make()
    order = engine.create(request("B"), "T")
    engine.hold(order.number, "Ann", "tea")
    fleet.confirm_cancel("V1")
    assert (mobility.can_move("V1"), mobility.is_lost("V1")) == (False, True)


async def test_a_vehicle_that_did_not_make_room_is_left_alone_for_a_while() -> None:
    engine, _, mobility = await make()
    vehicle = engine.registry.named("V1")
    assert vehicle
    mobility.relocation_failed(vehicle)
    assert not mobility.can_move("V1")
    drive = Drive.to_current_destination(assigned_order("B"), vehicle.key)
    engine.state.drives.put(drive)
    assert mobility.can_move("V1"), "its order needs it to drive"
    engine.state.drives.drop(drive)
    assert not mobility.can_move("V1")
    engine.clock.advance(RELOCATION_PAUSE)  # type: ignore[attr-defined] # the clock of make_engine
    assert mobility.can_move("V1")


async def test_the_reason_why_a_vehicle_stays_is_reported() -> None:
    engine, fleet, mobility = await make()
    vehicle = engine.registry.named("V1")
    assert vehicle
    assert mobility.why_it_stays(vehicle) is None
    fleet.out_of_order.add("V1")
    assert str(mobility.why_it_stays(vehicle)).startswith("the robot is ")


def press_emergency_stop(fleet: ScriptedFleet) -> None:
    fleet.fields["V1"] = {"safety_state": {"active_emergency_stop": "MANUAL", "field_violation": False}}


def lose_track(fleet: ScriptedFleet) -> None:
    fleet.unreadable.add("V1")


@pytest.mark.parametrize("stop", [press_emergency_stop, lose_track])
async def test_no_robot_drives_up_to_a_stopped_one(stop: Callable[[ScriptedFleet], None]) -> None:
    plant = PlantModel(
        name="one way",
        points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDE")),
        paths=tuple(map(path, ("A B", "B C", "C D", "D E"))),
        vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
    )
    fleet = ScriptedFleet({})
    engine = await make_engine(plant, MemoryStore(), fleet, release_ahead=1)
    fleet.appear("V1", "C")
    fleet.appear("V2", "A")
    engine.create(request("E", intendedVehicle="V1"), "T1")
    stop(fleet)
    engine.run_checks()

    engine.create(request("D", intendedVehicle="V2"), "T2")

    assert [name for name, _ in fleet.sent] == ["V1"]
    assert "V1" in reason_of(engine, "V2")
    fleet.fields.clear()
    fleet.unreadable.clear()
    engine.run_checks()
    assert [name for name, _ in fleet.sent] == ["V1", "V2"]
