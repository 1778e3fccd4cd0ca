"""Orders that a person holds and resumes."""

from __future__ import annotations

from functools import partial

from nena_shared.fleet_api.transport_order import DriveOrderState, TransportOrderState
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, engine_with, key, make_engine, status_of

S = TransportOrderState

ROW = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDP")),
    paths=tuple(path(ends, 2000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "C D", "B P")),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)

make = partial(engine_with, ROW)


async def test_a_waiting_order_is_not_assigned_while_held() -> None:
    store = MemoryStore()
    engine, fleet = await make(store)
    order = engine.create(request("C"), "T")
    engine.hold(order.number, "Ann", "tea")
    fleet.appear("V1", "A")
    assert (status_of(engine).state, fleet.sent) == (S.DISPATCHABLE, [])
    assert status_of(engine).reason.startswith("held by Ann")

    again, fleet = await make(store, V1="A")
    again.run_checks()
    assert fleet.sent == []
    again.resume(order.number, "Ann", "go")
    assert status_of(again).processing_vehicle == "V1"


async def test_a_robot_under_way_is_cancelled_and_continues_when_the_order_is_resumed() -> None:
    store = MemoryStore()
    engine, fleet = await make(store, V1="A")
    order = engine.create(request("D"), "T")
    engine.hold(order.number, "Ann", "tea")
    engine.hold(order.number, "Bob", "me too")
    assert fleet.cancelled == ["V1"]
    fleet.at["V1"] = "B"
    fleet.confirm_cancel("V1")
    assert status_of(engine).state is S.BEING_PROCESSED
    assert status_of(engine).reason.startswith("held by Ann since 1970") or "Ann" in status_of(engine).reason
    vehicle = engine.registry.named("V1")
    assert vehicle
    wait = engine.reporter.vehicle_status(vehicle).wait
    assert wait, "it is not busy"
    assert wait.reason.startswith("held by Ann")

    again, fleet = await make(store, V1="B")
    again.resume(order.number, "Bob", "go")
    ((_, vda_order),) = fleet.sent
    assert (vda_order.order_id, vda_order.nodes[0].node_id) == ("T-0~1", "B")
    assert fleet.finish("V1")
    assert status_of(again).state is S.FINISHED


async def test_a_restart_between_the_hold_and_the_cancel_cancels_again() -> None:
    store = MemoryStore()
    engine, _ = await make(store, V1="A")
    order = engine.create(request("D"), "T")
    engine.hold(order.number, "Ann", "tea")

    again, fleet = await make(store, V1="A")
    assert fleet.cancelled == ["V1"]
    again.resume(order.number, "Ann", "go")
    fleet.confirm_cancel("V1")

    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["T-0~1"]


async def test_an_interrupted_operation_is_reported_and_not_repeated_automatically() -> None:
    engine, fleet = await make(MemoryStore(), V1="A")
    order = engine.create(request("D", onFailure=[{"do": "RETRY"}]), "T")
    engine.hold(order.number, "Ann", "tea")
    fleet.operate("V1")
    engine.resume(order.number, "Ann", "go")
    fleet.confirm_cancel("V1")
    assert len(fleet.sent) == 1
    assert status_of(engine).state is S.FAILED
    assert "check what it has done" in status_of(engine).reason


async def test_resuming_reports_an_interrupted_operation() -> None:
    engine, fleet = await make(MemoryStore(), V1="A")
    order = engine.create(request("D"), "T")
    engine.hold(order.number, "Ann", "tea")
    fleet.operate("V1")
    fleet.confirm_cancel("V1")
    held = status_of(engine).held
    assert held
    assert "since then: the robot was stopped during its operation" in held.reason


async def test_a_gentle_hold_ends_where_the_base_does() -> None:
    engine, fleet = await make(MemoryStore(), release_ahead=1, V1="A")
    order = engine.create(request("D"), "T")
    engine.hold(order.number, "Ann", "tea", immediate=False)
    assert fleet.finish("V1")
    assert fleet.at["V1"] == "B"
    assert (status_of(engine).held is not None, fleet.cancelled) == (True, [])

    engine.resume(order.number, "Ann", "go")
    assert fleet.sent[-1][1].order_id == "T-0~1"


async def test_a_gentle_hold_becomes_an_immediate_one() -> None:
    engine, fleet = await make(MemoryStore(), V1="A")
    order = engine.create(request("D"), "T")
    engine.hold(order.number, "Ann", "tea", immediate=False)
    engine.hold(order.number, "Ann", "now")
    assert fleet.cancelled == ["V1"]


async def test_a_begun_operation_is_finished_and_the_next_destination_waits() -> None:
    engine, fleet = await make(MemoryStore(), V1="A")
    order = engine.create(request("B", "C"), "T")
    fleet.operate("V1")
    engine.hold(order.number, "Ann", "tea")
    assert fleet.cancelled == []
    fleet.finish("V1")

    assert (status_of(engine).current_drive_order_index, len(fleet.sent)) == (1, 1)
    engine.resume(order.number, "Ann", "go")
    assert fleet.sent[-1][1].order_id == "T-1"


async def test_a_failure_during_a_hold_is_reported_and_waits() -> None:
    engine, fleet = await make(MemoryStore(), V1="A")
    order = engine.create(request("D"), "T")
    engine.hold(order.number, "Ann", "tea")
    fleet.fail("V1")
    assert status_of(engine).state is S.BEING_PROCESSED
    assert status_of(engine).reason.endswith("tea; since then: wheel lost: FATAL wheel")
    engine.withdraw(order.number, "not wanted")
    assert status_of(engine).reason == "withdrawn before the robot had started: not wanted"


async def test_a_held_robot_keeps_its_position_and_others_report_why_they_wait() -> None:
    engine, fleet = await make(MemoryStore(), V1="B", V2="A")
    order = engine.create(request("D", intendedVehicle="V1"), "T")
    engine.hold(order.number, "Ann", "tea")
    fleet.confirm_cancel("V1")
    engine.create(request("C", intendedVehicle="V2"), "T2")
    engine.run_checks()

    assert [robot for robot, _ in fleet.sent] == ["V1"]
    assert status_of(engine, "T2").reason.endswith("but it waits for V1, which stands on 'B'")
    assert not engine.traffic.route_of("V1")

    engine.resume(order.number, "Ann", "go")
    assert fleet.finish("V1")
    engine.run_checks()
    assert key("V2") in fleet.missions


async def test_unsent_orders_are_not_sent_while_held() -> None:
    engine, fleet = await make(MemoryStore(), V1="A", V2="C")
    fleet.out_of_order.add("V2")
    order = engine.create(request("D", intendedVehicle="V1"), "T")
    assert fleet.sent == []
    engine.hold(order.number, "Ann", "tea")
    fleet.out_of_order.clear()
    fleet.appear("V2", "P")
    engine.run_checks()
    assert fleet.sent == []

    engine.resume(order.number, "Ann", "go")
    assert [vda_order.order_id for _, vda_order in fleet.sent] == ["T-0"]


async def test_resuming_an_order_that_is_not_held_does_nothing() -> None:
    engine, fleet = await make(MemoryStore(), V1="A")
    order = engine.create(request("D"), "T")
    version = status_of(engine).version
    engine.resume(order.number, "Ann", "go")
    assert (status_of(engine).version, len(fleet.sent)) == (version, 1)


async def test_an_action_that_the_layout_requires_where_a_held_order_ends_is_not_its_operation() -> None:
    fleet = ScriptedFleet({"V1": "A"})
    engine = await make_engine(ROW, MemoryStore(), fleet, release_ahead=1)
    order = engine.create(request("D"), "T")
    engine.hold(order.number, "Ann", "tea", immediate=False)
    fleet.operate("V1")
    assert [each.state for each in status_of(engine).drive_orders] == [DriveOrderState.TRAVELLING]
