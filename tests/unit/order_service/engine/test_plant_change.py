"""What orders and vehicles use keeps the plant model as it is; all else may change."""

from __future__ import annotations

from typing import Any

import pytest

from nena_order_service.engine.engine import Engine
from nena_order_service.engine.plant_change import conflicts
from nena_order_service.vehicles.registry import VehicleRegistry
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.plant.model import Block, BlockType
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine

POINTS = tuple(point(name, 2000 * index) for index, name in enumerate("ABCDEF"))
PLANT = PlantModel(
    name="row",
    points=POINTS,
    paths=tuple(path(ends, 2000) for ends in ("A B", "B C", "C D", "D E", "E F")),
    blocks=(Block(name="Gate", type=BlockType.SINGLE_VEHICLE_ONLY, members=("B", "B --- C")),),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2"), Vehicle(name="V3")),
)


async def busy() -> Engine:
    """Make V1 drive from A to C, V2 rest at F, V3 stay unknown, and an order for V3 wait."""
    fleet = ScriptedFleet({})
    engine = await make_engine(PLANT, MemoryStore(), fleet)
    fleet.appear("V1", "A")
    fleet.appear("V2", "F")
    engine.create(request("C", intendedVehicle="V1"), "T-1")
    engine.create(request("E", intendedVehicle="V3"), "T-2")
    assert len(fleet.sent) == 1
    return engine


def found(engine: Engine, **changes: Any) -> tuple[str, ...]:
    new = PLANT.model_copy(update=changes)
    new = PlantModel.from_json(new.to_json())
    return conflicts(engine, new, VehicleRegistry(new, default_map_id="map", adopt_unknown=False))


def without(*points: str) -> dict[str, Any]:
    gone = set(points)
    return {
        "points": tuple(each for each in POINTS if each.name not in gone),
        "paths": tuple(each for each in PLANT.paths if gone.isdisjoint((each.source, each.destination))),
    }


def moved(name: str) -> dict[str, Any]:
    return {
        "points": tuple(
            each.model_copy(update={"y_mm": 700}) if each.name == name else each for each in POINTS
        )
    }


async def test_unused_objects_may_change() -> None:
    engine = await busy()
    assert found(engine) == ()
    assert found(engine, **without("D")) == ()
    assert found(engine, points=(*POINTS, point("X")), paths=(*PLANT.paths, path("F X"))) == ()
    assert found(engine, **moved("E")) == ()
    assert found(engine, vehicles=PLANT.vehicles[::2]) == ()  # V2 has nothing to do


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (without("E"), "'T-2'"),
        (without("C"), "'T-1'"),
        (without("C"), "vehicle 'V1' uses 'C', which would be removed"),
        (without("F"), "vehicle 'V2' uses 'F', which would be removed"),
        (moved("C"), "vehicle 'V1' uses 'C', which would be moved"),
        ({"paths": PLANT.paths[1:]}, "vehicle 'V1' uses 'A --- B', which would be removed"),
        (
            {"paths": (path("A B", 3000), *PLANT.paths[1:])},
            "vehicle 'V1' uses 'A --- B', which would be moved",
        ),
        ({"blocks": ()}, "vehicle 'V1' uses 'B', which would be in other blocks"),
        ({"vehicles": PLANT.vehicles[1:]}, "vehicle 'V1' has an order, and would be removed"),
        (
            {
                "vehicles": (
                    Vehicle(name="V1", properties={"vda5050:serialNumber": "other"}),
                    *PLANT.vehicles[1:],
                )
            },
            "vehicle 'V1' has an order, and would be another robot",
        ),
        ({"vehicles": PLANT.vehicles[:2]}, "transport order 'T-2' is for vehicle 'V3'"),
    ],
)
async def test_objects_in_use_are_named(changes: dict[str, Any], said: str) -> None:
    problems = found(await busy(), **changes)
    assert any(said in each for each in problems), problems


async def test_not_everything_is_named() -> None:
    fleet = ScriptedFleet({})
    engine = await make_engine(PLANT, MemoryStore(), fleet)
    for number in range(130):
        engine.create(request("F"), f"T-{number}")
    problems = found(engine, **without("F"))
    assert (len(problems), problems[-1]) == (101, "and 30 more")
