"""What is done about orders at which vehicles have failed, in the engine."""

from __future__ import annotations

from datetime import timedelta
from functools import partial

import pytest

from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.failures import FailureKind
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant import Link, Location, LocationType, PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, engine_with, make_engine, sent, status_of

S = TransportOrderState

PLANT = PlantModel(
    name="two ways",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDEFGH")),
    paths=tuple(
        path(ends, 2000, max_reverse_velocity_mm_s=1000)
        for ends in ("A B", "B C", "A D", "D E", "E C", "C F", "F G", "G H")
    ),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
    location_types=(LocationType(name="T", allowed_operations=("Load", "Unload", "Wash")),),
    locations=(
        Location(name="L", type="T", links=(Link(point="C"),)),
        Location(name="M", type="T", links=(Link(point="F"),)),
    ),
)

make = partial(engine_with, PLANT)
make_two = partial(engine_with, PLANT, V1="A", V2="H")


def codes(engine: Engine) -> list[str]:
    return [entry.event_code.removeprefix("nena:") for entry in status_of(engine).history]


def way(vda_order: VdaOrder) -> list[str]:
    return [node.node_id for node in vda_order.nodes]


async def test_a_failed_drive_is_retried_then_replanned() -> None:
    engine, fleet = await make_two()
    policy = [{"do": "RETRY"}, {"do": "REPLAN"}, {"do": "REPLAN"}]
    engine.create(request("C", onFailure=policy, intendedVehicle="V1"), "T")
    fleet.fail("V1")
    fleet.fail("V1")

    assert sent(fleet) == [("V1", "T-0"), ("V1", "T-0~1"), ("V1", "T-0~2")]
    assert [way(vda_order) for _, vda_order in fleet.sent] == [
        ["A", "B", "C"],
        ["A", "B", "C"],
        ["A", "D", "E", "C"],
    ]
    assert codes(engine)[2:] == ["retried", "replanned"]
    assert status_of(engine).history[-1].supplements == ("wheel lost: FATAL wheel; avoids A --- B, B",)

    fleet.fail("V1")
    assert status_of(engine).state is S.FAILED
    assert status_of(engine).reason == "wheel lost: FATAL wheel (no replan: there is no other route)"


async def test_a_retry_delay_is_reported_and_survives_a_restart() -> None:
    store = MemoryStore()
    engine, fleet = await make_two(store)
    engine.create(request("C", onFailure=[{"do": "RETRY", "after": 60}]), "T")
    fleet.fail("V1")
    assert "but it retries at" in status_of(engine).reason
    now = engine.clock.now()

    again, fleet = await make_two(store)
    again.clock.advance(59)  # type: ignore[attr-defined] # the clock of make_engine
    again.run_checks()
    assert fleet.sent == []
    assert status_of(again).next_try == now + timedelta(seconds=60)

    again.clock.advance(1)  # type: ignore[attr-defined] # the clock of make_engine
    again.run_checks()
    assert sent(fleet) == [("V1", "T-0~1")]
    assert fleet.finish("V1")
    assert status_of(again).state is S.FINISHED


async def test_another_vehicle_continues_and_the_first_never_gets_the_order_again() -> None:
    engine, fleet = await make_two()
    engine.create(request("B", "C", onFailure=[{"do": "OTHER_VEHICLE", "times": 2}]), "T")
    fleet.finish("V1")
    fleet.out_of_order.add("V2")
    fleet.fail("V1")
    assert (status_of(engine).state, status_of(engine).processing_vehicle) == (S.DISPATCHABLE, None)
    engine.run_checks()
    assert status_of(engine).state is S.DISPATCHABLE

    fleet.out_of_order.clear()
    fleet.appear("V2", "H")
    assert sent(fleet)[-1] == ("V2", "T-1")
    assert status_of(engine).current_drive_order_index == 1
    fleet.fail("V2")
    assert status_of(engine).state is S.FAILED
    assert "no other suitable robot" in status_of(engine).reason


async def test_a_loaded_vehicle_keeps_its_order() -> None:
    engine, fleet = await make_two()
    policy = [{"do": "OTHER_VEHICLE"}, {"do": "HOLD"}]
    engine.create(request("L:Load", "M:Unload", onFailure=policy), "T")
    loader = fleet.sent[0][0]
    fleet.finish(loader)
    fleet.fail(loader)

    assert status_of(engine).processing_vehicle == loader
    assert status_of(engine).held
    assert "no other one can continue" in status_of(engine).reason


async def test_a_pick_begun_by_an_earlier_attempt_keeps_the_order_on_its_vehicle() -> None:
    engine, fleet = await make_two()
    policy = [{"do": "RETRY"}, {"do": "OTHER_VEHICLE"}, {"do": "HOLD"}]
    engine.create(
        request(
            "L:Load",
            onFailure=policy,
        ),
        "T",
    )
    loader = fleet.sent[0][0]
    fleet.fail_operation(loader)
    fleet.fail(loader)

    assert status_of(engine).processing_vehicle == loader
    assert "no other one can continue" in status_of(engine).reason


async def test_an_operation_is_skipped_if_the_destination_allows_it() -> None:
    engine, fleet = await make_two()
    stops = [
        {"locationName": "L", "operation": "Wash", "onFailure": [{"do": "SKIP"}]},
        {"locationName": "M", "operation": "Wash"},
    ]
    engine.create(request("A").model_validate({"destinations": stops, "intendedVehicle": "V1"}), "T")
    fleet.fail_operation("V1")
    assert sent(fleet) == [("V1", "T-0"), ("V1", "T-1")]
    assert codes(engine)[-1] == "skipped"

    fleet.fail_operation("V1")
    assert status_of(engine).state is S.FAILED
    assert [each.state for each in status_of(engine).drive_orders] == ["FAILED", "FAILED"]


async def test_skipping_the_last_operation_finishes_the_order() -> None:
    engine, fleet = await make_two()
    engine.create(request("L:Wash", onFailure=[{"do": "SKIP"}]), "T")
    fleet.fail_operation("V1")
    assert (status_of(engine).state, fleet.missions) == (S.FINISHED, {})


async def test_after_a_failure_an_operator_resumes_it() -> None:
    store = MemoryStore()
    engine, fleet = await make_two(store)
    order = engine.create(request("C", onFailure=[{"do": "HOLD"}]), "T")
    fleet.fail("V1", at="B")
    assert status_of(engine).state is S.BEING_PROCESSED
    assert status_of(engine).reason.startswith("held by failure policy since")
    vehicle = engine.registry.named("V1")
    assert vehicle
    assert engine.reporter.vehicle_status(vehicle).reason == status_of(engine).reason

    again, fleet = await make(store, V1="B", V2="H")
    again.run_checks()
    assert fleet.sent == []
    again.resume(order.number, "Ann", "wheel is back")
    assert sent(fleet) == [("V1", "T-0~1")]
    assert codes(again)[-2:] == ["adoptedAfterRestart", "resumed"]
    fleet.fail("V1")
    assert status_of(again).held


async def test_the_setting_is_the_default_for_orders() -> None:
    fleet = ScriptedFleet({"V1": "A"})
    policy = request("A", onFailure=[{"do": "HOLD"}]).on_failure
    assert policy
    engine = await make_engine(PLANT, MemoryStore(), fleet, on_failure=policy)
    engine.create(request("C"), "T")
    fleet.fail("V1")
    assert status_of(engine).held

    engine.withdraw(engine.state.orders.get(1).number, "not wanted")
    engine.create(request("C", onFailure=[]), "T2")
    fleet.fail("V1")
    assert status_of(engine, "T2").state is S.FAILED


@pytest.mark.parametrize("kind", list(FailureKind))
async def test_an_order_ends_whatever_fails_and_however_often(kind: FailureKind) -> None:
    engine, fleet = await make_two()
    steps = [{"do": "RETRY", "times": 3}, {"do": "REPLAN", "times": 3}, {"do": "OTHER_VEHICLE", "times": 9}]
    engine.create(request("L:Load", onFailure=[*steps, {"do": "SKIP"}]), "T")
    for _ in range(40):
        for robot in tuple(fleet.missions):
            fleet.fail(robot.serial_number, "no", kind)

    assert status_of(engine).state.final
    ids = [(robot, vda_order.order_id) for robot, vda_order in fleet.sent]
    assert len(ids) == len(set(ids))


async def test_a_route_locked_meanwhile_is_waited_for() -> None:
    engine, fleet = await make(MemoryStore(), V1="F")
    engine.create(request("G", "H", onFailure=[{"do": "RETRY", "times": 2, "after": 10}]), "T")
    engine.context.finder.set_locks({"G --- H": True})
    engine.plant_changed()
    fleet.finish("V1")
    assert "waits until path" in status_of(engine).reason

    engine.context.finder.set_locks({"G --- H": False})
    engine.plant_changed()
    assert sent(fleet)[-1] == ("V1", "T-1")
