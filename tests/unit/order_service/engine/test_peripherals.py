"""Peripheral jobs along routes: no robot drives through a door that has not answered."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import pytest

from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.vda_order import VdaOrder
from nena_order_service.peripherals.settings import PeripheralSettings
from nena_shared.fleet_api.peripherals import (
    DeviceAnswer,
    DeviceCancellation,
    DeviceJobState,
    DeviceRequest,
    PeripheralJobRequest,
    PeripheralJobState,
    PeripheralState,
)
from nena_shared.fleet_api.transport_order import FailureMeasure, FailureStep, TransportOrderState
from nena_shared.plant import Location, LocationType, Path, PeripheralOperation, PlantModel, Vehicle
from nena_shared.plant.track import ExecutionTrigger
from support.clocks import ManualClock
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, key, make_engine, status_of

T = ExecutionTrigger
D = DeviceJobState


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
    peripherals = PeripheralSettings(**{"enabled": True, **settings})
    given = EngineSettings(release_seconds=0.0, default_map_id="map", peripherals=peripherals)
    engine = await make_engine(plant, store, fleet, settings=given, clock=clock, on_failure=on_failure)
    door = engine.peripherals.port = Door(engine)
    for name, where in ({"V1": "A"} if at is None else at).items():
        fleet.appear(name, where)
    return Site(engine, fleet, door, store, clock)


@pytest.mark.parametrize("trigger", [T.IMMEDIATE, T.BEFORE_ALLOCATION, T.AFTER_ALLOCATION])
async def test_the_base_ends_before_a_door_until_it_is_open(trigger: ExecutionTrigger) -> None:
    site = await started(hall(operation("open", trigger)))

    site.engine.create(request("E", name="T-1"), "T-1")
    assert site.base() == "AB"
    assert site.door.operations == ["open"]
    assert site.reason() == "it waits for peripheral 'Door' to acknowledge 'open'"

    site.door.answer(D.ACKNOWLEDGED)
    assert site.base() == "AB"
    assert site.reason() == "it waits for peripheral 'Door' to finish 'open'"

    site.door.answer(D.FINISHED)
    assert site.base() == "ABCDE"
    assert site.states() == [PeripheralJobState.FINISHED]
    assert site.fleet.finish("V1")
    assert status_of(site.engine, "T-1").state is TransportOrderState.FINISHED
    assert site.door.operations == ["open"]


async def test_only_an_operation_after_the_allocation_holds_the_path_while_the_door_opens() -> None:
    before = await started(hall(operation("open", T.BEFORE_ALLOCATION)))
    before.engine.create(request("E", name="T-1"), "T-1")
    after = await started(hall(operation("open", T.AFTER_ALLOCATION)))
    after.engine.create(request("E", name="T-1"), "T-1")

    assert before.engine.traffic.holders("Door") == frozenset()
    assert after.engine.traffic.holders("Door") == {"V1"}


@pytest.mark.parametrize("trigger", [T.IMMEDIATE, T.BEFORE_ALLOCATION, T.AFTER_ALLOCATION])
async def test_a_robot_before_the_door_is_sent_nothing_until_it_is_open(trigger: ExecutionTrigger) -> None:
    site = await started(hall(operation("open", trigger)), at={"V1": "B"})

    site.engine.create(request("E", name="T-1"), "T-1")
    assert site.fleet.sent == []
    assert site.door.operations == ["open"]
    site.door.answer(D.FINISHED)

    assert site.base() == "BCDE"


async def test_an_operation_whose_end_is_not_required_does_not_stop_the_robot() -> None:
    site = await started(hall(operation("light", T.AFTER_ALLOCATION, required=False)))

    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.FAILED, "lamp broken")

    assert site.base() == "ABCDE"
    assert status_of(site.engine, "T-1").state is TransportOrderState.BEING_PROCESSED


async def test_the_door_closes_after_the_movement() -> None:
    site = await started(
        hall(
            operation("open", T.AFTER_ALLOCATION),
            closing=(operation("close", T.AFTER_MOVEMENT, required=False),),
        )
    )
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.FINISHED)

    site.fleet.pass_node("V1", 2)
    assert site.door.operations == ["open"]
    site.fleet.pass_node("V1", 3)
    site.fleet.pass_node("V1", 3)

    assert site.door.operations == ["open", "close"]


async def test_a_required_operation_after_a_movement_stops_the_robot_at_the_end_of_the_path() -> None:
    site = await started(hall(operation("close", T.AFTER_MOVEMENT)))
    site.engine.create(request("E", name="T-1"), "T-1")
    assert site.base() == "ABC"
    assert site.door.operations == []

    site.fleet.pass_node("V1", 2)
    assert site.base() == "ABC"
    assert "to acknowledge 'close'" in site.reason()
    site.door.answer(D.FINISHED)

    assert site.base() == "ABCDE"


async def test_a_vehicle_drives_its_next_order_only_after_the_required_operation_of_its_last_movement() -> (
    None
):
    site = await started(hall(closing=(operation("close", T.AFTER_MOVEMENT),)))
    site.engine.create(request("D", name="T-1"), "T-1")
    site.fleet.finish("V1")
    assert status_of(site.engine, "T-1").state is TransportOrderState.FINISHED

    site.engine.create(request("E", name="T-2"), "T-2")
    assert len(site.fleet.sent) == 1
    site.door.answer(D.FINISHED)

    assert site.base() == "DE"


async def test_two_vehicles_pass_a_door_one_after_the_other() -> None:
    site = await started(
        hall(
            operation("open", T.AFTER_ALLOCATION),
            closing=(operation("close", T.AFTER_MOVEMENT, required=False),),
        ),
        at={"V1": "B", "V2": "A"},
    )
    site.engine.create(request("E", name="T-1", intendedVehicle="V1"), "T-1")
    site.door.answer(D.FINISHED)
    site.engine.create(request("D", name="T-2", intendedVehicle="V2"), "T-2")
    for index in (1, 2):
        site.fleet.pass_node("V1", index)
    assert site.door.operations == ["open", "close"]  # V2 may not ask while V1 could still be in the door
    assert site.base("V2") == "AB"

    site.fleet.finish("V1")
    assert site.door.operations == ["open", "close"]
    site.door.answer(D.FINISHED)
    assert site.door.operations == ["open", "close", "open"]
    assert site.base("V2") == "AB"
    site.door.answer(D.FINISHED)

    assert site.base("V2").startswith("ABC")


async def test_an_unacknowledged_job_is_sent_again_with_its_name_and_then_fails_its_order() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), acknowledge_timeout=5.0, sends=3)
    site.engine.create(request("E", name="T-1"), "T-1")

    for _ in range(2):
        site.clock.advance(5.0)
        site.engine.look()
    assert len({each.job_id for _, each in site.door.asked}) == 1
    assert site.door.operations == ["open"] * 3
    site.clock.advance(5.0)
    site.engine.look()

    assert site.states() == [PeripheralJobState.FAILED]
    assert site.door.cancelled == [site.door.asked[0][1].job_id]
    assert site.base() == "AB"
    assert site.fleet.finish("V1")
    order = status_of(site.engine, "T-1")
    assert order.state is TransportOrderState.FAILED
    assert order.reason == (
        "peripheral 'Door' has not executed 'open': peripheral 'Door' has not answered 3 requests"
    )


async def test_nothing_times_out_while_the_broker_is_not_connected() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), acknowledge_timeout=5.0, sends=1)
    site.engine.create(request("E", name="T-1"), "T-1")
    site.fleet.connected = 0.0

    site.clock.advance(1000.0)
    site.engine.look()

    assert site.states() == [PeripheralJobState.BEING_PROCESSED]


async def test_a_job_that_takes_too_long_fails_and_a_late_answer_changes_nothing() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), execution_timeout=60.0)
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.ACKNOWLEDGED)

    site.clock.advance(60.0)
    site.engine.look()
    site.door.answer(D.FINISHED)

    assert site.states() == [PeripheralJobState.FAILED]
    assert site.base() == "AB"
    assert site.engine.peripherals.answers == {"accepted": 1, "ignored": 1}


async def test_the_failure_policy_asks_the_door_again_by_a_new_job() -> None:
    retry = (FailureStep(do=FailureMeasure.RETRY),)
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), on_failure=retry)
    site.engine.create(request("E", name="T-1"), "T-1")

    site.door.answer(D.FAILED, "blocked")
    assert site.fleet.finish("V1")
    assert site.door.operations == ["open", "open"]
    assert site.door.asked[0][1].job_id != site.door.asked[1][1].job_id
    site.door.answer(D.FINISHED)

    assert site.base() == "BCDE"


async def test_a_failed_door_fails_an_order_that_was_not_sent_yet() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), at={"V1": "B"})
    site.engine.create(request("E", name="T-1"), "T-1")

    site.door.answer(D.FAILED, "blocked")

    assert site.fleet.sent == []
    assert status_of(site.engine, "T-1").state is TransportOrderState.FAILED
    assert site.engine.traffic.holders("Door") == frozenset()
    assert site.engine.traffic.holders("B") == {"V1"}


async def test_withdrawing_the_order_withdraws_its_job_at_the_device() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)))
    order = site.engine.create(request("E", name="T-1"), "T-1")

    site.engine.withdraw(order.number, "no longer wanted")

    assert site.states() == [PeripheralJobState.FAILED]
    assert site.door.cancelled == [site.door.asked[0][1].job_id]
    site.door.answer(D.FINISHED)
    assert site.base() == "AB"


async def test_an_unavailable_device_is_not_asked_until_it_is_back() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)))
    site.engine.on_device_state("Door", PeripheralState.UNAVAILABLE)
    site.engine.create(request("E", name="T-1"), "T-1")
    assert site.door.asked == []
    assert site.reason() == "it waits for peripheral 'Door' to execute 'open'; it reports UNAVAILABLE"

    site.engine.on_device_state("Door", PeripheralState.IDLE)

    assert site.door.operations == ["open"]


async def test_after_a_restart_the_job_under_way_is_asked_again_and_its_answer_counts() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)))
    site.engine.create(request("E", name="T-1"), "T-1")
    (asked,) = site.door.asked

    again = await started(site.engine.plant, store=site.store, at={"V1": "A"})
    ((location, request_again),) = again.engine.peripherals.under_way()
    assert (location, request_again.job_id) == ("Door", asked[1].job_id)
    assert base(again.fleet.missions[key("V1")]) == "AB"
    again.engine.on_device_answer("Door", DeviceAnswer(job_id=asked[1].job_id, state=D.FINISHED))

    assert again.base() == "ABCDE"
    assert again.door.asked == []


async def test_after_a_restart_a_finished_job_is_not_asked_again() -> None:
    plant = hall(
        operation("open", T.BEFORE_ALLOCATION),
        closing=(operation("close", T.AFTER_MOVEMENT, required=False),),
    )
    site = await started(plant)
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.FINISHED)
    site.fleet.pass_node("V1", 3)
    site.door.answer(D.FINISHED)

    again = await started(plant, store=site.store, at={"V1": "D"})
    again.fleet.pass_node("V1", 3)

    assert again.engine.peripherals.under_way() == []
    assert again.door.asked == []


async def test_before_the_first_message_a_robot_at_the_door_waits_through_a_restart() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), at={"V1": "B"})
    site.engine.create(request("E", name="T-1"), "T-1")
    (asked,) = site.door.asked

    again = await started(site.engine.plant, store=site.store, at={"V1": "B"})
    again.engine.look()
    assert again.fleet.sent == []
    assert again.door.cancelled == []
    again.engine.on_device_answer("Door", DeviceAnswer(job_id=asked[1].job_id, state=D.FINISHED))

    assert again.base() == "BCDE"


async def test_a_host_may_not_move_the_door_while_another_vehicle_uses_it() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)))
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.FINISHED)
    by_host = PeripheralJobRequest(location="Door", operation="close", reservation_token="host")

    job = site.engine.create_peripheral_job(by_host, "J-1")
    assert site.door.operations == ["open"]
    assert site.engine.peripherals.job_status(job).reason == (
        "waits for the device to execute 'close'; V1 uses it"
    )
    for index in (1, 2, 3):
        site.fleet.pass_node("V1", index)

    assert site.door.operations == ["open", "close"]


async def test_an_operation_of_a_destination_is_done_before_the_robot_gets_there() -> None:
    site = await started(hall())
    step = {"location": "Door", "operation": "open"}
    after = {
        "location": "Door",
        "operation": "close",
        "executionTrigger": "AFTER_MOVEMENT",
        "completionRequired": False,
    }
    destinations = [{"locationName": "C", "peripheralOperations": [step, after]}, {"locationName": "E"}]
    site.engine.create(request(name="T-1", destinations=destinations), "T-1")
    assert site.base() == "AB"
    site.door.answer(D.FINISHED)
    assert site.base() == "ABC"

    site.fleet.finish("V1")

    assert site.door.operations == ["open", "close"]
    assert site.base() == "CDE"


async def test_an_operation_of_a_destination_at_the_robots_own_point_comes_first() -> None:
    site = await started(hall(), at={"V1": "C"})
    destination = {"locationName": "C", "peripheralOperations": [{"location": "Door", "operation": "open"}]}
    site.engine.create(request(name="T-1", destinations=[destination]), "T-1")
    assert site.fleet.sent == []

    site.door.answer(D.FINISHED)

    assert [base(vda_order) for _, vda_order in site.fleet.sent] == ["C"]


async def test_disabled_peripherals_are_ignored() -> None:
    site = await started(hall(operation("open", T.BEFORE_ALLOCATION)), enabled=False)

    site.engine.create(request("E", name="T-1"), "T-1")

    assert site.base() == "ABCDE"
    assert site.door.asked == []


async def test_a_rerouted_vehicle_no_longer_needs_the_door() -> None:
    detour: tuple[Path, ...] = (path("B X", 9000), path("X E", 9000))
    plant = hall(operation("open", T.AFTER_ALLOCATION))
    plant = plant.model_copy(
        update={"paths": (*plant.paths, *detour), "points": (*plant.points, point("X", 0, 9000))}
    )
    site = await started(PlantModel.model_validate(plant.model_dump()))
    site.engine.create(request("E", name="T-1"), "T-1")
    assert site.base() == "AB"

    site.engine.traffic.resources.set_locks({"B --- C": True})
    site.engine.context.finder.set_locks({"B --- C": True})
    site.engine.plant_changed()

    assert site.base() == "ABXE"
    assert site.states() == [PeripheralJobState.FAILED]
    assert site.engine.traffic.holders("Door") == frozenset()
