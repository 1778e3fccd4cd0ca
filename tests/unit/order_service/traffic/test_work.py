"""The work of driving does not grow with the vehicles under way; counted in calls, for clocks vary."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
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


async def driving(number: int, length: int) -> tuple[Engine, ScriptedFleet]:
    """Start an engine with so many driving vehicles, each on its own lane, and one at rest."""
    lanes = range(number + 1)
    plant = PlantModel(
        name="lanes",
        points=tuple(
            Point(name=f"{lane}-{end}", x_mm=5000 * end, y_mm=5000 * lane)
            for lane in lanes
            for end in range(length)
        ),
        paths=tuple(
            path(f"{lane}-{end} {lane}-{end + 1}", 5000) for lane in lanes for end in range(length - 1)
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
