"""The work of driving does not grow with the vehicles under way; counted in calls, for clocks vary.

Waiting vehicles are not tried again before a vehicle changes for which they wait.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_order_service.traffic.scheduler import Scheduler
from nena_shared.plant import PlantModel, Point, Vehicle
from support.operations import calls_of
from support.order_service import request
from support.plants import path
from support.scripted_fleet import ForgetfulStore, ScriptedFleet, make_engine

FEW, MANY = 10, 100
"""Vehicles under way."""
ALIKE = 1.2
"""How much more work one event may be with ten times as many of them."""
SHORT, LONG = 3, 15
"""Points of a lane: the whole route is allocated at once, or part by part."""

lane_lengths = pytest.mark.parametrize("length", [SHORT, LONG])


async def driving(number: int, length: int, *, empty: int = 0) -> tuple[Engine, ScriptedFleet]:
    """Start an engine with so many driving vehicles, each on its own lane, and one at rest.

    ``empty`` is the number of further lanes, without a vehicle.
    """
    lanes = range(number + 1)
    all_lanes = range(number + 1 + empty)
    plant = PlantModel(
        name="lanes",
        points=tuple(
            Point(name=f"{lane}-{end}", x_mm=5000 * end, y_mm=5000 * lane)
            for lane in all_lanes
            for end in range(length)
        ),
        paths=tuple(
            path(f"{lane}-{end} {lane}-{end + 1}", 5000) for lane in all_lanes for end in range(length - 1)
        ),
        vehicles=tuple(Vehicle(name=f"V{lane}") for lane in lanes),
    )
    fleet = ScriptedFleet({f"V{lane}": f"{lane}-0" for lane in lanes})
    settings = EngineSettings(default_map_id="map")
    engine = await make_engine(plant, ForgetfulStore(), fleet, settings=settings)
    for lane in lanes:
        fleet.appear(f"V{lane}", f"{lane}-0")
    for lane in range(number):
        engine.create(request(f"{lane}-{length - 1}", intendedVehicle=f"V{lane}"), f"T{lane}")
    assert len(fleet.missions) == number
    return engine, fleet


async def calls(length: int, event: Callable[[Engine, ScriptedFleet, int], object]) -> list[int]:
    """Count the calls of an event with few and with many vehicles under way."""
    counted = []
    for number in (FEW, MANY):
        engine, fleet = await driving(number, length)
        counted.append(calls_of(lambda e=engine, f=fleet, n=number: event(e, f, n)))  # type: ignore[misc]
    return counted


@lane_lengths
async def test_a_passed_node_costs_the_same_in_a_large_fleet(length: int) -> None:
    few, many = await calls(length, lambda _, fleet, __: fleet.pass_node("V0", 1))
    assert many < few * ALIKE, (few, many)


@lane_lengths
async def test_a_state_of_a_standing_vehicle_costs_the_same_in_a_large_fleet(length: int) -> None:
    few, many = await calls(length, lambda _, fleet, number: fleet.appear(f"V{number}", f"{number}-0"))
    assert many < few * ALIKE, (few, many)


@lane_lengths
async def test_dispatching_one_vehicle_costs_the_same_in_a_large_fleet(length: int) -> None:
    few, many = await calls(
        length,
        lambda engine, _, number: engine.create(request(f"{number}-2", intendedVehicle=f"V{number}"), "more"),
    )
    assert many < few * ALIKE, (few, many)


@lane_lengths
async def test_the_end_of_an_order_costs_the_same_in_a_large_fleet(length: int) -> None:
    few, many = await calls(length, lambda _, fleet, __: fleet.finish("V0"))
    assert many < few * ALIKE, (few, many)


@lane_lengths
@pytest.mark.parametrize(
    "event",
    [
        lambda _, fleet: fleet.pass_node("V0", 1),
        lambda _, fleet: fleet.appear(f"V{FEW}", f"{FEW}-0"),
        lambda engine, _: engine.create(request(f"{FEW}-2", intendedVehicle=f"V{FEW}"), "more"),
        lambda _, fleet: fleet.finish("V0"),
    ],
    ids=["passed node", "state", "new order", "end of an order"],
)
async def test_an_event_costs_the_same_in_a_large_plant(
    length: int, event: Callable[[Engine, ScriptedFleet], object]
) -> None:
    counted = []
    for empty in (0, MANY):
        engine, fleet = await driving(FEW, length, empty=empty)
        counted.append(calls_of(lambda e=engine, f=fleet: event(e, f)))  # type: ignore[misc]
    assert counted[1] < counted[0] * ALIKE, counted


async def waiting(number: int, monkeypatch: pytest.MonkeyPatch) -> tuple[Engine, ScriptedFleet, list[str]]:
    """Start an engine where so many vehicles wait for others that stand in their way, and V0 drives.

    Each claim from now on adds the name of its vehicle to the list.
    """
    lanes = range(number + 1)
    plant = PlantModel(
        name="lanes",
        points=tuple(
            Point(name=f"{lane}-{end}", x_mm=5000 * end, y_mm=5000 * lane)
            for lane in lanes
            for end in range(LONG)
        ),
        paths=tuple(
            path(f"{lane}-{end} {lane}-{end + 1}", 5000) for lane in lanes for end in range(LONG - 1)
        ),
        vehicles=tuple(Vehicle(name=f"{kind}{lane}") for lane in lanes for kind in "VB"),
    )
    places = {f"V{lane}": f"{lane}-0" for lane in lanes}
    places |= {f"B{lane}": f"{lane}-1" for lane in lanes if lane}
    fleet = ScriptedFleet(places)
    fleet.out_of_order.update(name for name in places if name.startswith("B"))
    settings = EngineSettings(default_map_id="map")
    engine = await make_engine(plant, ForgetfulStore(), fleet, settings=settings)
    for name, place in places.items():
        fleet.appear(name, place)
    for lane in lanes:
        engine.create(request(f"{lane}-{LONG - 1}", intendedVehicle=f"V{lane}"), f"T{lane}")
    assert len(engine.traffic.waiting) >= number
    claims: list[str] = []
    claim = Scheduler.claim

    def counted(scheduler: Scheduler, name: str, *more: Any) -> Any:
        claims.append(name)
        return claim(scheduler, name, *more)

    monkeypatch.setattr(Scheduler, "claim", counted)
    return engine, fleet, claims


async def test_waiting_vehicles_are_not_tried_again_while_others_drive(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, fleet, claims = await waiting(FEW, monkeypatch)
    fleet.pass_node("V0", 1)
    fleet.appear("B1", "1-1")
    assert set(claims) <= {"V0"}


async def test_a_waiting_vehicle_is_tried_again_when_the_one_in_its_way_has_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, fleet, claims = await waiting(FEW, monkeypatch)
    fleet.appear("B1", "0-14")
    assert {"V1"} <= set(claims) <= {"V0", "V1"}
    assert "V1" in [name for name, _ in fleet.sent]


async def test_waiting_vehicles_are_tried_again_from_time_to_time(monkeypatch: pytest.MonkeyPatch) -> None:
    engine, _, claims = await waiting(FEW, monkeypatch)
    engine.look()
    assert len(set(claims)) == FEW
