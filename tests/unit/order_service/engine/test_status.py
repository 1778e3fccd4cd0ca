from __future__ import annotations

from typing import Any

import pytest

from nena_order_service.engine.engine import Engine
from nena_order_service.engine.status import Essentials
from nena_order_service.fleet.robot import LinkStatus
from nena_shared.fleet_api.traffic import WaitCause
from nena_shared.fleet_api.vehicle import ProcessingState, VehicleState, VehicleStatus
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel
from nena_shared.vda5050.state import PowerSupply
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, engine_at, make_engine

PLANT = PlantModel(
    name="line",
    points=(point("A"), point("B", 2000)),
    paths=(path("A B"), path("B A")),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)
BROKEN = ErrorEntry(error_type="wheel", error_level=ErrorLevel.FATAL, error_description="lost")


class Ear:
    """Records the published statuses of vehicles."""

    def __init__(self) -> None:
        self.vehicles: list[VehicleStatus] = []

    def vehicle_changed(self, status: VehicleStatus) -> None:
        self.vehicles.append(status)


async def looked_at() -> tuple[Engine, ScriptedFleet, Ear]:
    """Return an engine that has published the status of its two vehicles; one works, the other is unknown."""
    fleet, ear = ScriptedFleet({"V1": "A"}), Ear()
    engine = await make_engine(PLANT, MemoryStore(), fleet)
    engine.create(request("B", intendedVehicle="V1"), "T")
    engine.unit_of_work.vehicle_listeners.append(ear)
    engine.run_checks()
    return engine, fleet, ear


async def test_status_describes_a_vehicle() -> None:
    engine, _, _ = await looked_at()
    working, unheard = (engine.reporter.vehicle_status(vehicle) for vehicle in engine.registry)
    assert (working.processing_state, working.transport_order) == (ProcessingState.PROCESSING_ORDER, "T")
    assert (working.current_position, working.last_state is None) == ("A", False)
    assert (unheard.state, unheard.connection) == (VehicleState.UNKNOWN, LinkStatus.OFFLINE)
    assert (unheard.current_position, unheard.last_state) == (None, None)


@pytest.mark.parametrize(
    ("at", "fields", "told"),
    [
        ("A", {}, []),
        ("A", {"power_supply": PowerSupply(state_of_charge=41.5, charging=False)}, []),
        ("A", {"errors": (BROKEN,)}, ["V1"]),
        ("B", {}, ["V1"]),
    ],
)
async def test_a_check_publishes_only_significant_changes(
    at: str, fields: dict[str, Any], told: list[str]
) -> None:
    engine, fleet, ear = await looked_at()
    ear.vehicles.clear()
    fleet.at["V1"], fleet.fields["V1"] = at, fields
    engine.run_checks()
    assert [status.name for status in ear.vehicles] == told


async def test_essentials_of_a_status_are_its_own() -> None:
    engine, _, _ = await looked_at()
    for vehicle in engine.registry:
        status = engine.reporter.vehicle_status(vehicle)
        assert status.model_copy(update=Essentials.of(status)._asdict()) == status


TRACK = PlantModel(
    name="single track",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCD")),
    paths=tuple(path(ends, 2000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "C D")),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)


async def test_blocking_vehicles_are_published_until_a_vehicle_continues() -> None:
    engine, fleet = await engine_at(TRACK, {"V1": "A", "V2": "C"})
    ear = Ear()
    engine.unit_of_work.vehicle_listeners.append(ear)
    engine.create(request("D", intendedVehicle="V2"), "T-2")
    assert [each.wait for each in ear.vehicles] == [None]

    engine.create(request("C", intendedVehicle="V1"), "T-1")

    status = ear.vehicles[-1]
    assert status.name == "V1"
    assert status.wait
    assert (status.wait.vehicles, status.wait.at, status.wait.cause) == (("V2",), "C", WaitCause.PASSES)
    assert status.reason.endswith(status.wait.reason)

    fleet.pass_node("V2", 1)

    assert (ear.vehicles[-1].name, ear.vehicles[-1].wait) == ("V1", None)
