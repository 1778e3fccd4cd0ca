"""Positions of vehicles by their robots' reports, and their integration levels."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest

from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_shared.fleet_api.vehicle import IntegrationLevel
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.vda5050.state import Load
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import (
    MemoryStore,
    ScriptedFleet,
    engine_with,
    key,
    make_engine,
    reason_of,
    status_of,
)

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 4000 * index) for index, name in enumerate("ABCD")),
    paths=tuple(path(ends, 4000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "C D")),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)

make = partial(engine_with, PLANT)


def held(engine: Engine, name: str) -> set[str]:
    return {resource for each in engine.traffic.held_by(name) for resource in each.uses}


def pose(x: float, y: float = 0.0, *, localized: bool = True, map_id: str = "map") -> dict[str, Any]:
    place = {"x": x, "y": y, "theta": 0.0, "map_id": map_id, "localized": localized}
    return {"mobile_robot_position": place}


async def test_a_robot_holds_its_position_and_frees_what_it_left() -> None:
    engine, fleet = await make(V1="A")
    assert held(engine, "V1") == {"A"}

    fleet.appear("V1", "C")
    assert held(engine, "V1") == {"C"}


async def test_a_robot_without_a_position_keeps_its_resources() -> None:
    engine, fleet = await make(V1="A")

    fleet.fields["V1"] = pose(9.0, localized=False)
    fleet.appear("V1", "nowhere")
    assert held(engine, "V1") == {"A"}

    del fleet.at["V1"]  # offline
    engine.run_checks()
    assert held(engine, "V1") == {"A"}


async def test_a_robot_beside_its_point_holds_the_path_and_drives_to_the_point_first() -> None:
    engine, fleet = await make(V2="A")
    fleet.fields["V1"] = pose(6.2, 0.1)
    fleet.appear("V1", "B")
    assert held(engine, "V1") == {"B --- C"}

    engine.create(request("D", intendedVehicle="V1"), "T")

    ((_, vda_order),) = fleet.sent
    assert [node.node_id for node in vda_order.nodes] == ["start:T-0", "C", "D"]
    assert {"C", "D", "B --- C"} <= held(engine, "V1")


async def test_a_robot_off_the_plant_holds_nothing_until_it_drives_there() -> None:
    engine, fleet = await make()
    fleet.fields["V1"] = pose(4.0, 7.0)
    fleet.appear("V1", "")
    assert ("V1" in engine.traffic, held(engine, "V1")) == (True, set())

    engine.create(request("C", intendedVehicle="V1"), "T")

    assert held(engine, "V1") == {"B", "B --- C", "C"}


async def test_a_manually_driven_robot_keeps_its_resources_until_it_stands() -> None:
    engine, fleet = await make(V1="A")
    fleet.fields["V1"] = {"driving": True, "operating_mode": "MANUAL"}
    fleet.out_of_order.add("V1")
    fleet.appear("V1", "B")
    assert held(engine, "V1") == {"A", "B"}

    fleet.fields["V1"] = {"operating_mode": "MANUAL"}
    fleet.appear("V1", "B")
    assert held(engine, "V1") == {"B"}


async def test_two_robots_on_one_point_are_reported_and_can_leave() -> None:
    engine, fleet = await make(V1="A", V2="A")
    assert reason_of(engine, "V1").endswith("stands on 'A' together with V2")

    engine.create(request("B", intendedVehicle="V2"), "T")
    assert fleet.finish("V2")
    assert "together" not in reason_of(engine, "V1")


async def test_a_robot_unknown_to_the_plant_holds_resources_only_on_the_plants_map() -> None:
    engine, fleet = await make()
    fleet.fields["stranger"] = pose(0.0)
    fleet.appear("stranger", "A")
    assert held(engine, "stranger") == {"A"}

    fleet.fields["alien"] = pose(0.0, map_id="other hall")
    fleet.appear("alien", "A")
    assert "alien" not in engine.traffic


async def test_an_operator_frees_what_a_lost_robot_holds() -> None:
    store = MemoryStore()
    engine, fleet = await make(store, V1="A", V2="D")
    engine.create(request("C", intendedVehicle="V1"), "T-1")
    engine.create(request("A", intendedVehicle="V2"), "T-2")
    vehicle = engine.registry.discover(key("V1"))
    assert held(engine, "V1") >= {"A", "B", "C"}

    engine.set_integration_level(vehicle, IntegrationLevel.TO_BE_IGNORED)

    assert "V1" not in engine.traffic
    assert fleet.cancelled == ["V1"]
    assert "Ignored" in status_of(engine, "T-1").reason
    assert fleet.finish("V2")
    assert engine.reporter.vehicle_status(vehicle).integration_level is IntegrationLevel.TO_BE_IGNORED

    again, fleet = await make(store, V1="B", V2="A")
    assert "V1" not in again.traffic


async def test_a_respected_robot_gets_no_orders_and_is_kept_away_from() -> None:
    engine, fleet = await make(V1="A")
    vehicle = engine.registry.discover(key("V1"))
    engine.set_integration_level(vehicle, IntegrationLevel.TO_BE_RESPECTED)

    engine.create(request("C"), "T")

    assert fleet.sent == []
    assert held(engine, "V1") == {"A"}
    assert reason_of(engine, "V1") == "is set to “Out of use”"
    engine.set_integration_level(vehicle, IntegrationLevel.TO_BE_UTILIZED)
    assert [robot for robot, _ in fleet.sent] == ["V1"]


async def test_a_restart_keeps_the_position_of_a_robot_unknown_to_the_plant() -> None:
    store = MemoryStore()
    _, fleet = await make(store, V1="D")
    fleet.fields["stranger"] = pose(4.0)
    fleet.appear("stranger", "B")

    fleet = ScriptedFleet({"V1": "D", "stranger": "B"}, mute={"V1", "stranger"})
    again = await make_engine(PLANT, store, fleet, settings=EngineSettings())
    again.run_checks()
    assert held(again, "stranger") == {"B"}

    fleet.mute.clear()
    fleet.fields["stranger"] = pose(4.0)
    fleet.appear("stranger", "B")
    assert held(again, "stranger") == {"B"}
    fleet.fields["V1"] = pose(12.0)
    fleet.appear("V1", "D")
    again.run_checks()
    assert held(again, "stranger") == {"B"}

    fleet.fields["stranger"] = pose(4.0, map_id="other hall")
    again = await make_engine(PLANT, store, fleet, settings=EngineSettings())
    fleet.appear("V1", "D")
    fleet.appear("stranger", "B")
    assert "stranger" not in again.traffic


async def test_a_robot_with_an_unknown_order_names_it() -> None:
    engine, fleet = await make(V1="A")
    left = ({"node_id": "B", "sequence_id": 2, "released": False},)
    fleet.fields["V1"] = {"order_id": "lost-0", "node_states": left}
    fleet.appear("V1", "A")
    assert "still works on the order 'lost-0'" in reason_of(engine, "V1")

    fleet.fields["V1"] = {"order_id": "lost-0"}
    fleet.appear("V1", "A")
    assert "idle: no waiting orders" in reason_of(engine, "V1")


LENGTHS = {"vda5050:vehicleLengthLoaded": "5000", "vda5050:vehicleLengthUnloaded": "800"}
SHORT, LONG = {"B --- C", "C"}, {"A --- B", "B", "B --- C", "C"}


@pytest.mark.parametrize(
    ("properties", "loads", "covered"),
    [
        (LENGTHS, (), SHORT),
        (LENGTHS, (Load(),), LONG),
        (LENGTHS, None, LONG),  # unknown: the greater length
        ({"vda5050:vehicleLengthLoaded": "long"}, (Load(),), SHORT),
        ({}, (Load(),), SHORT),
    ],
)
async def test_what_a_vehicle_covers_depends_on_its_load(
    properties: dict[str, str], loads: tuple[Load, ...] | None, covered: set[str]
) -> None:
    plant = PLANT.model_copy(update={"vehicles": (Vehicle(name="V1", properties=properties),)})
    fleet = ScriptedFleet({})
    engine = await make_engine(plant, MemoryStore(), fleet)
    fleet.fields["V1"] = {"loads": ()}
    fleet.appear("V1", "A")
    fleet.fields["V1"] = {"loads": loads}
    fleet.appear("V1", "A")  # where it is loaded
    engine.create(request("C", name="T-1"), "T-1")
    fleet.finish("V1")
    assert held(engine, "V1") == covered
