"""Six robots and one single track: sixty orders are finished, and no two robots are ever in the same place.

The order service and the robots are separate processes, with a real broker between them. What the robots were
granted and what they report is read from the conversation alone.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path as File
from random import Random

import pytest

from nena_shared.plant import Link, Location, LocationType, Path, PlantModel, Point, Vehicle
from nena_shared.plant_terms import PointType
from support.order_service_fleet import Fleet, every_order_ended, vehicle_idle
from support.traffic.conversation import Conversation

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

ROBOTS = 6
ORDERS = 60


def single_track() -> PlantModel:
    """Make two yards with a track between them that has one passing place; 3 m from point to point."""
    track = [f"T{number}" for number in range(5)]
    places = {name: (6 + 3 * index, 10) for index, name in enumerate(track)}
    places |= {"Siding": (12, 13)}
    places |= {f"West {number}": (3, 1 + 3 * number) for number in range(6)}
    places |= {f"East {number}": (21, 1 + 3 * number) for number in range(6)}
    ends = [*pairwise(track), ("T1", "Siding"), ("Siding", "T3")]
    ends += [(f"West {number}", "T0") for number in range(6)]
    ends += [("T4", f"East {number}") for number in range(6)]
    yards = [name for name in places if name.startswith(("West", "East"))]
    return PlantModel(
        name="single track",
        points=tuple(
            Point(
                name=name,
                x_mm=1000 * x,
                y_mm=1000 * y,
                type=PointType.PARK_POSITION if name in yards else PointType.HALT_POSITION,
            )
            for name, (x, y) in places.items()
        ),
        paths=tuple(
            Path(name=f"{a} --- {b}", source=a, destination=b, length_mm=3000, max_reverse_velocity_mm_s=1000)
            for a, b in ends
        ),
        vehicles=tuple(
            Vehicle(
                name=f"Robot-{number}",
                properties={
                    "vda5050:manufacturer": "NeNa",
                    "vda5050:serialNumber": f"robot-{number}",
                    "vda5050:mapId": "sample-hall",
                },
            )
            for number in range(ROBOTS)
        ),
        location_types=(LocationType(name="Station", allowed_operations=("Load cargo", "Unload cargo")),),
        locations=tuple(
            Location(name=f"At {yard}", type="Station", links=(Link(point=yard),)) for yard in yards
        ),
    )


@pytest.mark.long
@pytest.mark.timeout(600)
async def test_sixty_orders_over_a_single_track_finish_without_conflicts(
    fleet: Fleet, tmp_path: File
) -> None:
    plant = single_track()
    (tmp_path / "plant.json").write_text(plant.to_json())
    wire = fleet.peer(f"{fleet.interface}/v2/#")
    program = fleet.order_service("--plant", tmp_path / "plant.json", "--engine.release_ahead", 2)
    client = await program.client()
    for number in range(ROBOTS):
        yard = plant.point(f"{'West' if number < 3 else 'East'} {number}")
        fleet.agent(f"robot-{number}", x=yard.x_m, y=yard.y_m, speed=40.0)
        await vehicle_idle(client, f"Robot-{number}")

    random, yards = Random(1), [each.name for each in plant.locations]
    for number in range(ORDERS):
        first, last = random.sample(yards, 2)
        load = {"locationName": first, "operation": "Load cargo"}
        unload = {"locationName": last, "operation": "Unload cargo"}
        body = {"name": f"T-{number}", "destinations": [load, unload]}
        assert (await client.post("/v1/transportOrders", json=body)).status_code == 201

    orders = await every_order_ended(client, 400)
    assert {order["state"] for order in orders} == {"FINISHED"}, [order["reason"] for order in orders]
    assert len(orders) == ORDERS
    checker = Conversation()
    checker.read(wire.history)
    assert len(checker.on) == ROBOTS
    assert checker.clashes == []
