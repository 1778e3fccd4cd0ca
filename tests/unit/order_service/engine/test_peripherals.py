"""Peripheral jobs along routes: no robot drives through a door that has not answered."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from nena_order_service.engine.peripherals import ENDED_SHOWN, MOST_WAITING, UNFINISHED_SHOWN
from nena_shared.fleet_api.peripherals import (
    DeviceAnswer,
    DeviceJobState,
    PeripheralJobRequest,
    PeripheralJobState,
    PeripheralJobStatus,
    PeripheralState,
)
from nena_shared.fleet_api.traffic import WaitCause
from nena_shared.fleet_api.transport_order import FailureMeasure, FailureStep, TransportOrderState
from nena_shared.plant import Location, Path, PlantModel
from nena_shared.plant_terms import ExecutionTrigger
from nena_shared.vda5050.state import MobileRobotPosition
from support.doors import base, hall, operation, started
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import key, status_of

T = ExecutionTrigger
D = DeviceJobState


@dataclass
class Changed:
    """Records which devices are published."""

    locations: list[str] = field(default_factory=list)

    def job_changed(self, _status: PeripheralJobStatus) -> None:
        """Record nothing: this is about devices."""

    def peripheral_changed(self, location: str) -> None:
        self.locations.append(location)


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

    assert before.engine.traffic.scheduler.holders_of("Door") == frozenset()
    assert after.engine.traffic.scheduler.holders_of("Door") == {"V1"}


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
    site.engine.create(request("E", name="T-2"), "T-2")
    assert len(site.fleet.sent) == 1
    site.door.answer(D.FINISHED)

    assert status_of(site.engine, "T-1").state is TransportOrderState.FINISHED
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
        site.engine.run_checks()
    assert len({each.job_id for _, each in site.door.asked}) == 1
    assert site.door.operations == ["open"] * 3
    site.clock.advance(5.0)
    site.engine.run_checks()

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
    site.engine.run_checks()

    assert site.states() == [PeripheralJobState.BEING_PROCESSED]


async def test_a_job_that_takes_too_long_fails_and_a_late_answer_changes_nothing() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), execution_timeout=60.0)
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.ACKNOWLEDGED)

    site.clock.advance(60.0)
    site.engine.run_checks()
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
    assert site.engine.traffic.scheduler.holders_of("Door") == frozenset()
    assert site.engine.traffic.scheduler.holders_of("B") == {"V1"}


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
    assert site.reason() == "it waits for peripheral 'Door' to execute 'open'; it reports unavailable"

    site.engine.on_device_state("Door", PeripheralState.IDLE)

    assert site.door.operations == ["open"]


async def test_after_a_restart_the_job_under_way_is_asked_again_and_its_answer_counts() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)))
    site.engine.create(request("E", name="T-1"), "T-1")
    (asked,) = site.door.asked

    again = await started(site.engine.plant, store=site.store, at={"V1": "A"})
    ((location, request_again),) = again.engine.peripherals.requests_under_way()
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

    assert again.engine.peripherals.requests_under_way() == []
    assert again.door.asked == []


async def test_before_the_first_message_a_robot_at_the_door_waits_through_a_restart() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), at={"V1": "B"})
    site.engine.create(request("E", name="T-1"), "T-1")
    (asked,) = site.door.asked

    again = await started(site.engine.plant, store=site.store, at={"V1": "B"})
    again.engine.run_checks()
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
    assert site.engine.traffic.scheduler.holders_of("Door") == frozenset()


def with_paths(plant: PlantModel, *paths: Path, points: str = "") -> PlantModel:
    """Return a plant with further paths and points; a path of the same name replaces the old one."""
    names = {each.name for each in paths}
    kept = (each for each in plant.paths if each.name not in names)
    more = tuple(point(name, 0, 9000 + index) for index, name in enumerate(points.split()))
    changes = {"paths": (*kept, *paths), "points": (*plant.points, *more)}
    return PlantModel.model_validate(plant.model_copy(update=changes).model_dump())


@pytest.mark.parametrize("restarts", [False, True])
async def test_an_order_that_was_held_before_its_robot_had_it_asks_the_door_again(*, restarts: bool) -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), at={"V1": "B"})
    order = site.engine.create(request("E", name="T-1"), "T-1")
    site.engine.hold(order.number, "Ada", "lunch")
    assert site.door.cancelled == [site.door.asked[0][1].job_id]

    if restarts:
        site = await started(site.engine.plant, store=site.store, at={"V1": "B"})
    site.engine.resume(order.number, "Ada", "back")
    assert site.fleet.sent == []
    assert site.reason() == "it waits for peripheral 'Door' to acknowledge 'open'"
    site.door.answer(D.FINISHED)

    assert site.base() == "BCDE"


async def test_a_vehicle_rerouted_away_from_a_door_and_back_asks_it_again() -> None:
    plant = with_paths(
        hall(operation("open", T.AFTER_ALLOCATION)),
        path("B X", 9000, peripheral_operations=(operation("lift", T.AFTER_ALLOCATION, at="Gate"),)),
        path("X E", 9000),
        points="X",
    )
    gate = Location(name="Gate", x_mm=0, y_mm=0, type="Doors")
    site = await started(plant.model_copy(update={"locations": (*plant.locations, gate)}))
    site.engine.create(request("E", name="T-1"), "T-1")
    for locks in ({"B --- C": True}, {"B --- X": True}):
        site.engine.traffic.resources.set_locks(locks)
        site.engine.context.finder.set_locks(locks)
        site.engine.plant_changed()
        assert site.base() == "AB"

    assert site.door.operations == ["open", "lift", "open"]
    site.door.answer(D.FINISHED)
    assert site.base() == "ABCDE"


async def test_a_door_that_was_closed_since_is_opened_again_right_before_the_allocation() -> None:
    site = await started(hall(operation("open", T.IMMEDIATE)), release_ahead=1)
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.FINISHED)
    site.engine.create_peripheral_job(
        PeripheralJobRequest(location="Door", operation="close", reservation_token="host"), "J-1"
    )
    site.fleet.pass_node("V1", 1)  # while the door closes
    assert site.base() == "AB"

    site.door.answer(D.FINISHED)
    assert site.door.operations == ["open", "close", "open"]
    assert site.base() == "AB"
    site.door.answer(D.FINISHED)

    assert site.base() == "ABC"


async def test_a_door_is_closed_behind_the_first_pass_before_it_is_opened_for_the_second() -> None:
    opened = operation("open", T.AFTER_ALLOCATION)
    plant = hall(opened, closing=(operation("close", T.AFTER_MOVEMENT, required=False),))
    site = await started(with_paths(plant, path("D E", peripheral_operations=(opened,))))
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.FINISHED)
    assert site.base() == "ABCD"
    assert site.door.operations == ["open"]

    site.fleet.pass_node("V1", 3)
    site.door.answer(D.FINISHED)
    assert site.door.operations == ["open", "close", "open"]
    assert site.base() == "ABCD"
    site.door.answer(D.FINISHED)

    assert site.base() == "ABCDE"


async def test_a_closing_job_that_waited_for_its_device_comes_before_an_older_opening_one() -> None:
    door = (operation("open", T.IMMEDIATE),)
    close = operation("close", T.AFTER_MOVEMENT, required=False)
    site = await started(hall(*door, closing=(close,)), at={"V1": "B", "V2": "A"})
    site.engine.create(request("E", name="T-1", intendedVehicle="V1"), "T-1")
    site.door.answer(D.FINISHED)
    site.engine.create(request("D", name="T-2", intendedVehicle="V2"), "T-2")
    site.engine.on_device_state("Door", PeripheralState.UNAVAILABLE)
    for index in (1, 2):
        site.fleet.pass_node("V1", index)
    site.fleet.finish("V1")

    site.engine.on_device_state("Door", PeripheralState.IDLE)
    assert site.door.operations == ["open", "close"]
    site.door.answer(D.FINISHED)
    assert site.door.operations == ["open", "close", "open"]
    assert site.base("V2") == "AB"


async def test_an_operation_of_a_destination_waits_for_a_vehicle_in_the_door() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), at={"V1": "B", "V2": "E"})
    site.engine.create(request("D", name="T-1", intendedVehicle="V1"), "T-1")
    site.door.answer(D.FINISHED)
    close = {"location": "Door", "operation": "close"}
    destination = {"locationName": "E", "peripheralOperations": [close]}
    site.engine.create(request(name="T-2", destinations=[destination], intendedVehicle="V2"), "T-2")

    assert site.door.operations == ["open"]
    assert site.reason("T-2") == "it waits for V1, which passes 'Door' first"
    site.fleet.finish("V1")

    assert site.door.operations == ["open", "close"]
    assert site.engine.peripherals.device_status("Door").used_by == ("V2",)


async def test_a_dispensable_operation_of_a_destination_waits_for_a_vehicle_in_the_door() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), at={"V1": "B", "V2": "E"})
    site.engine.create(request("D", name="T-1", intendedVehicle="V1"), "T-1")
    site.door.answer(D.FINISHED)
    close = {"location": "Door", "operation": "close", "completionRequired": False}
    destination = {"locationName": "E", "peripheralOperations": [close]}
    site.engine.create(request(name="T-2", destinations=[destination], intendedVehicle="V2"), "T-2")
    assert site.door.operations == ["open"]

    site.fleet.finish("V1")

    assert site.door.operations == ["open", "close"]


@pytest.mark.parametrize("trigger", [T.IMMEDIATE, T.BEFORE_ALLOCATION])
async def test_a_vehicle_in_a_door_is_named_by_those_that_wait_for_it(trigger: ExecutionTrigger) -> None:
    site = await started(hall(operation("open", trigger)), at={"V1": "B", "V2": "A"})
    site.engine.create(request("D", name="T-1", intendedVehicle="V1"), "T-1")
    site.door.answer(D.FINISHED)
    site.engine.create(request("C", name="T-2", intendedVehicle="V2"), "T-2")

    site.fleet.pass_node("V1", 1)  # it may still reach into the door
    waiting = site.engine.registry.named("V2")
    assert waiting
    wait = site.engine.reporter.vehicle_status(waiting).wait
    assert wait
    assert (wait.vehicles, wait.cause) == (("V1",), WaitCause.PASSES)
    assert site.door.operations == ["open"]


async def test_a_robot_that_stopped_in_a_door_uses_it_until_it_is_out() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), at={"V1": "B"})
    order = site.engine.create(request("D", name="T-1"), "T-1")
    site.door.answer(D.FINISHED)
    pose = MobileRobotPosition(x=3.0, y=0.0, theta=0.0, map_id="map", localized=True)
    site.fleet.fields["V1"] = {"mobile_robot_position": pose}
    site.engine.withdraw(order.number, "no longer wanted")
    site.fleet.confirm_cancel("V1")
    site.engine.run_checks()

    site.engine.create_peripheral_job(
        PeripheralJobRequest(location="Door", operation="close", reservation_token="host"), "J-1"
    )

    assert site.door.operations == ["open"]
    assert site.engine.peripherals.device_status("Door").used_by == ("V1",)


LAST_CLOSES = hall(closing=(operation("close", T.AFTER_MOVEMENT),))


async def test_a_required_operation_of_the_last_movement_that_fails_fails_the_order() -> None:
    site = await started(LAST_CLOSES)
    site.engine.create(request("D", name="T-1"), "T-1")
    site.fleet.pass_node("V1", 3)
    site.door.answer(D.FAILED, "blocked")
    assert status_of(site.engine, "T-1").state is TransportOrderState.BEING_PROCESSED

    site.fleet.finish("V1")

    order = status_of(site.engine, "T-1")
    assert order.state is TransportOrderState.FAILED
    assert order.reason == "peripheral 'Door' has not executed 'close': blocked"


@pytest.mark.parametrize("restarts", [False, True])
@pytest.mark.parametrize("answer", [D.FINISHED, D.FAILED])
async def test_an_order_ends_after_the_required_operation_of_its_last_movement(
    answer: DeviceJobState, *, restarts: bool
) -> None:
    retry = (FailureStep(do=FailureMeasure.RETRY, times=3),)
    site = await started(LAST_CLOSES, on_failure=retry)
    site.engine.create(request("D", name="T-1"), "T-1")
    site.fleet.finish("V1")
    order = status_of(site.engine, "T-1")
    assert order.state is TransportOrderState.BEING_PROCESSED
    assert order.reason == (
        "robot V1 completed destination 1 of 1, but it waits for peripheral 'Door' to acknowledge 'close'"
    )

    location, asked = site.door.asked[-1]
    if restarts:
        site = await started(LAST_CLOSES, store=site.store, at={"V1": "D"}, on_failure=retry)
        assert status_of(site.engine, "T-1").state is TransportOrderState.BEING_PROCESSED
    site.engine.on_device_answer(location, DeviceAnswer(job_id=asked.job_id, state=answer))

    assert status_of(site.engine, "T-1").state is TransportOrderState(answer)
    assert (asked.operation, len(site.fleet.sent)) == ("close", 0 if restarts else 1)


async def test_a_failure_while_an_order_is_held_is_told_to_those_who_resume_it() -> None:
    site = await started(LAST_CLOSES)
    order = site.engine.create(request("E", name="T-1"), "T-1")
    site.fleet.pass_node("V1", 3)
    site.engine.hold(order.number, "Ada", "lunch", immediate=False)
    site.door.answer(D.FAILED, "blocked")

    assert "since then: peripheral 'Door' has not executed 'close': blocked" in site.reason()


@pytest.mark.parametrize("stands", [False, True])
async def test_a_held_order_with_nothing_left_to_drive_fails_with_its_last_operation(*, stands: bool) -> None:
    site = await started(LAST_CLOSES)
    order = site.engine.create(request("D", name="T-1"), "T-1")
    site.fleet.pass_node("V1", 3)
    site.engine.hold(order.number, "Ada", "lunch", immediate=False)
    if stands:
        site.fleet.finish("V1")
    site.door.answer(D.FAILED, "blocked")
    assert stands or site.fleet.finish("V1")

    ended = status_of(site.engine, "T-1")
    assert ended.state is TransportOrderState.FAILED
    assert ended.reason == "peripheral 'Door' has not executed 'close': blocked"


async def test_the_failure_policy_decides_after_a_restart() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)))
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.FAILED, "blocked")

    again = await started(site.engine.plant, store=site.store, at={"V1": "A"})
    assert again.fleet.finish("V1")

    assert status_of(again.engine, "T-1").state is TransportOrderState.FAILED
    assert again.door.asked == []


async def test_the_job_of_a_device_that_becomes_unavailable_is_sent_again_when_it_is_back() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)), execution_timeout=60.0, sends=1)
    site.engine.create(request("E", name="T-1"), "T-1")
    site.engine.on_device_state("Door", PeripheralState.UNAVAILABLE)
    assert site.reason() == "it waits for peripheral 'Door' to acknowledge 'open'; it reports unavailable"
    site.clock.advance(59.0)
    site.engine.run_checks()
    assert site.states() == [PeripheralJobState.BEING_PROCESSED]

    site.engine.on_device_state("Door", PeripheralState.IDLE)

    assert site.door.operations == ["open", "open"]
    assert site.door.asked[0][1].job_id == site.door.asked[1][1].job_id
    site.engine.on_device_state("Door", PeripheralState.UNAVAILABLE)
    site.clock.advance(60.0)
    site.engine.run_checks()
    assert status_of(site.engine, "T-1").reason.startswith("robot V1 travels")
    assert site.fleet.finish("V1")
    assert status_of(site.engine, "T-1").reason.endswith("within 60 s; it reports unavailable")


async def test_jobs_for_which_no_vehicle_waits_are_limited() -> None:
    site = await started(hall())
    site.engine.on_device_state("Door", PeripheralState.UNAVAILABLE)
    for number in range(MOST_WAITING + 2):
        site.engine.create_peripheral_job(
            PeripheralJobRequest(location="Door", operation="open", reservation_token="host"), f"J-{number}"
        )

    jobs = {each.name: each.status for each in site.engine.state.peripheral_jobs.all_visible()}
    assert [name for name, status in jobs.items() if status.state.final] == ["J-1", "J-0"]
    assert jobs["J-0"].reason == f"more than {MOST_WAITING} jobs wait for the device"


async def test_the_status_of_a_device_has_its_first_jobs_and_the_last_ended_ones() -> None:
    site = await started(hall(), sends=1)

    def create(number: int) -> None:
        asked = PeripheralJobRequest(location="Door", operation="open", reservation_token="host")
        site.engine.create_peripheral_job(asked, f"J-{number}")

    for number in range(ENDED_SHOWN + 1):
        create(number)
        site.clock.advance(1.0)
        site.door.answer(D.FAILED, f"blocked {number}")
    for number in range(10, 10 + UNFINISHED_SHOWN + 1):
        create(number)

    status = site.engine.peripherals.device_status("Door")
    assert status.job
    assert (status.job.name, len(status.waiting)) == ("J-10", UNFINISHED_SHOWN)
    open_ones, ended = status.jobs[:UNFINISHED_SHOWN], status.jobs[UNFINISHED_SHOWN:]
    assert [each.name for each in open_ones] == [f"J-{number}" for number in range(10, 10 + UNFINISHED_SHOWN)]
    assert open_ones[1].reason == "waits for the device to execute 'open' after 'open'"
    assert [each.reason for each in ended] == [f"blocked {number}" for number in range(ENDED_SHOWN, 0, -1)]


async def test_a_device_keeps_its_failed_job_over_a_restart() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)))
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.FAILED, "blocked")

    again = await started(site.engine.plant, store=site.store, at={"V1": "A"})

    (job,) = again.engine.peripherals.device_status("Door").jobs
    assert (job.state, job.reason) == (PeripheralJobState.FAILED, "blocked")
    assert (job.related_vehicle, job.related_transport_order) == ("V1", "T-1")


async def test_answers_and_states_without_news_commit_nothing() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)))
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.FINISHED)
    site.engine.on_device_state("Door", PeripheralState.IDLE)
    site.store.commits = 0

    site.door.answer(D.FINISHED)
    site.engine.on_device_state("Door", PeripheralState.IDLE)
    site.engine.on_device_state("Nowhere", PeripheralState.IDLE)

    assert site.store.commits == 0
    assert site.engine.peripherals.answers["ignored"] == 1


async def test_a_device_is_used_by_the_vehicle_that_holds_it() -> None:
    site = await started(hall(operation("open", T.AFTER_ALLOCATION)))
    changed = Changed()
    site.engine.unit_of_work.peripheral_listeners.append(changed)
    site.engine.create(request("E", name="T-1"), "T-1")
    site.door.answer(D.FINISHED)
    assert site.engine.peripherals.device_status("Door").used_by == ("V1",)

    changed.locations.clear()
    for index in (1, 2, 3):
        site.fleet.pass_node("V1", index)

    assert site.engine.peripherals.device_status("Door").used_by == ()
    assert changed.locations == ["Door"]
