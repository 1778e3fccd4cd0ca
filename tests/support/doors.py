"""A row of points with a door between two of them, and devices controlled by the test."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.vda_order import VdaOrder
from nena_order_service.peripherals.settings import PeripheralSettings
from nena_shared.fleet_api.peripherals import (
    DeviceAnswer,
    DeviceCancellation,
    DeviceJobState,
    DeviceRequest,
    PeripheralJobState,
)
from nena_shared.plant import Location, LocationType, PeripheralOperation, PlantModel, Vehicle
from nena_shared.plant_terms import ExecutionTrigger
from support.clocks import ManualClock
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, key, make_engine, status_of


def operation(
    name: str, trigger: ExecutionTrigger, *, required: bool = True, at: str = "Door"
) -> PeripheralOperation:
    return PeripheralOperation(
        name=name, location=at, execution_trigger=trigger, completion_required=required
    )


def hall(*operations: PeripheralOperation, closing: tuple[PeripheralOperation, ...] = ()) -> PlantModel:
    """Make a row of points A to E, with a door on the path from B to C; ``closing`` is on the one to D."""
    return PlantModel(
        name="row",
        points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDE")),
        paths=(
            path("A B"),
            path("B C", peripheral_operations=operations),
            path("C D", peripheral_operations=closing),
            path("D E"),
        ),
        location_types=(LocationType(name="Doors", allowed_peripheral_operations=("open", "close")),),
        locations=(Location(name="Door", x_mm=0, y_mm=0, type="Doors"),),
        vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
    )


@dataclass
class Door:
    """Devices controlled by the test; it records what they are asked."""

    engine: Engine
    asked: list[tuple[str, DeviceRequest]] = field(default_factory=list)
    cancelled: list[str] = field(default_factory=list)

    def request(self, location: str, request: DeviceRequest) -> None:
        self.asked.append((location, request))

    def cancel(self, _location: str, cancellation: DeviceCancellation) -> None:
        self.cancelled.append(cancellation.job_id)

    @property
    def operations(self) -> list[str]:
        return [each.operation for _, each in self.asked]

    def answer(self, state: DeviceJobState, reason: str = "", *, job: int = -1) -> None:
        location, asked = self.asked[job]
        self.engine.on_device_answer(location, DeviceAnswer(job_id=asked.job_id, state=state, reason=reason))


@dataclass
class Site:
    engine: Engine
    fleet: ScriptedFleet
    door: Door
    store: MemoryStore
    clock: ManualClock

    def base(self, vehicle: str = "V1") -> str:
        vda_order = self.fleet.missions.get(key(vehicle))
        return base(vda_order) if vda_order else ""

    def states(self) -> list[PeripheralJobState]:
        return [each.status.state for each in self.engine.state.peripheral_jobs.all_visible()[::-1]]

    def reason(self, order: str = "T-1") -> str:
        return status_of(self.engine, order).reason.rpartition(", but ")[2]


def base(vda_order: VdaOrder) -> str:
    return "".join(node.node_id for node in vda_order.nodes if node.released)


async def started(
    plant: PlantModel,
    *,
    store: MemoryStore | None = None,
    at: dict[str, str] | None = None,
    clock: ManualClock | None = None,
    **settings: Any,
) -> Site:
    store, clock, fleet = store or MemoryStore(), clock or ManualClock(), ScriptedFleet({})
    on_failure = settings.pop("on_failure", ())
    given = EngineSettings(
        release_ahead=settings.pop("release_ahead", 0),
        release_seconds=0.0,
        default_map_id="map",
        peripherals=PeripheralSettings(**{"enabled": True, **settings}),
    )
    engine = await make_engine(plant, store, fleet, settings=given, clock=clock, on_failure=on_failure)
    door = Door(engine)
    engine.peripherals.ports.append(door)
    for name, where in ({"V1": "A"} if at is None else at).items():
        fleet.appear(name, where)
    return Site(engine, fleet, door, store, clock)
