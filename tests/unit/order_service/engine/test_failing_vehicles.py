"""A vehicle at which one order after the other fails gets no more; an order's own fault takes none out."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from nena_order_service.dispatching.settings import DispatchSettings
from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.failures import FailureKind
from nena_order_service.settings import OrderSettings
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.fleet_api.vehicle import ANY_ORDER_TYPE, AcceptableOrderType, IntegrationLevel, VehicleStatus
from nena_shared.plant import Link, Location, LocationType, PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine, status_of

S = TransportOrderState

NAMES = "ABCDEFGH"
PLANT = PlantModel(
    name="line",
    points=tuple(point(name, 2000 * index) for index, name in enumerate(NAMES)),
    paths=tuple(
        path(f"{one} {other}", 2000, max_reverse_velocity_mm_s=1000) for one, other in pairwise(NAMES)
    ),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2"), Vehicle(name="V3")),
    location_types=(LocationType(name="T", allowed_operations=("Load", "Unload")),),
    locations=(Location(name="L", type="T", links=(Link(point="C"),)),),
)


async def site(
    store: MemoryStore | None = None, *, failed_orders: int = 3, traffic: bool = False, **places: str
) -> tuple[Engine, ScriptedFleet]:
    """Start an engine with the order service's default failure policy."""
    fleet = ScriptedFleet(places)
    settings = EngineSettings(
        release_seconds=0.0,
        release_ahead=1000,
        default_map_id="map",
        traffic=traffic,
        dispatch=DispatchSettings(failed_orders=failed_orders),
    )
    policy = OrderSettings().on_failure
    engine = await make_engine(PLANT, store or MemoryStore(), fleet, settings=settings, on_failure=policy)
    for name, at in places.items():
        fleet.appear(name, at)
    return engine, fleet


def vehicle(engine: Engine, name: str = "V1") -> VehicleStatus:
    found = engine.registry.named(name)
    assert found
    return engine.reporter.vehicle_status(found)


def fail_orders(engine: Engine, fleet: ScriptedFleet, *places: str, **more: Any) -> None:
    """Let orders fail at the only vehicle, one after the other."""
    for number, place in enumerate(places, start=len(fleet.sent)):
        engine.create(request(place), f"T-{number}")
        fleet.fail("V1", **more)


@pytest.mark.parametrize("kind", [FailureKind.DRIVE, FailureKind.REFUSED, FailureKind.NOT_TAKEN])
@pytest.mark.parametrize("places", ["BCD", "BBB"])
async def test_a_vehicle_that_fails_every_order_leaves_the_others_in_the_queue(
    kind: FailureKind, places: str
) -> None:
    engine, fleet = await site(V1="A")
    fail_orders(engine, fleet, *places, kind=kind)
    engine.create(request("E"), "next")

    assert status_of(engine, "next").state is S.DISPATCHABLE
    assert "3 orders in a row have failed at it" in status_of(engine, "next").reason
    told = vehicle(engine)
    assert told.taken_out
    assert told.integration_level is IntegrationLevel.TO_BE_RESPECTED
    assert told.reason.startswith("was taken out of dispatching, because 3 orders in a row have failed at it")
    assert "wheel lost" in told.reason
    assert told.coded_reason
    assert told.coded_reason.code == "taken_out"


async def test_a_person_brings_it_back_and_its_failures_count_from_the_first() -> None:
    engine, fleet = await site(V1="A")
    fail_orders(engine, fleet, *"BCD")
    engine.create(request("E"), "next")
    found = engine.registry.named("V1")
    assert found
    engine.set_integration_level(found, IntegrationLevel.TO_BE_UTILIZED)

    assert status_of(engine, "next").state is S.BEING_PROCESSED
    assert not vehicle(engine).taken_out
    fleet.fail("V1")
    assert vehicle(engine).integration_level is IntegrationLevel.TO_BE_UTILIZED


async def test_a_finished_drive_brings_it_back() -> None:
    engine, fleet = await site(traffic=True, V1="C", V2="A")
    for number, place in enumerate("DEF"):
        engine.create(request(place, intendedVehicle="V1"), f"T-{number}")
        fleet.fail("V1")
    assert vehicle(engine).taken_out

    engine.create(request("D", intendedVehicle="V2"), "through")
    engine.run_checks()
    assert "V1" in [name for name, _ in fleet.sent[3:]], "it makes room"
    fleet.finish("V1")

    assert not vehicle(engine).taken_out
    assert vehicle(engine).integration_level is IntegrationLevel.TO_BE_UTILIZED


async def test_a_finished_drive_ends_the_row() -> None:
    engine, fleet = await site(V1="A")
    fail_orders(engine, fleet, *"BC")
    engine.create(request("B"), "well")
    fleet.finish("V1")
    fail_orders(engine, fleet, *"CD")

    assert not vehicle(engine).taken_out


async def test_an_order_that_needs_no_drive_does_not_end_the_row() -> None:
    engine, fleet = await site(V1="A")
    fail_orders(engine, fleet, *"BC")
    engine.create(request("A"), "stands there")
    fleet.finish("V1")
    assert status_of(engine, "stands there").state is S.FINISHED
    fail_orders(engine, fleet, "D")

    assert vehicle(engine).taken_out


async def test_it_stays_out_after_a_restart() -> None:
    store = MemoryStore()
    engine, fleet = await site(store, V1="A")
    fail_orders(engine, fleet, *"BCD")
    again, fleet = await site(store, V1="A")
    again.create(request("E"), "next")

    assert fleet.sent == []
    assert vehicle(again).taken_out
    assert vehicle(again).coded_reason == vehicle(engine).coded_reason
    assert "wheel lost" in vehicle(again).reason


async def test_the_row_survives_a_restart() -> None:
    store = MemoryStore()
    engine, fleet = await site(store, V1="A")
    fail_orders(engine, fleet, *"BC")
    again, fleet = await site(store, V1="A")
    again.create(request("D"), "third")
    fleet.fail("V1")

    assert vehicle(again).taken_out


@pytest.mark.parametrize(
    ("limit", "failures", "out"), [(1, 1, True), (5, 4, False), (5, 5, True), (0, 9, False)]
)
async def test_the_limit_is_a_setting(limit: int, failures: int, out: bool) -> None:  # noqa: FBT001
    engine, fleet = await site(failed_orders=limit, V1="A")
    fail_orders(engine, fleet, *["C"] * failures)

    assert vehicle(engine).taken_out is out


async def test_an_order_that_failed_before_it_was_loaded_goes_to_another_vehicle() -> None:
    engine, fleet = await site(V1="A", V2="H")
    engine.create(request("L:Load", "F"), "T")
    fleet.fail("V1")

    assert status_of(engine).processing_vehicle == "V2"
    fleet.finish("V2")
    fleet.finish("V2")
    assert status_of(engine).state is S.FINISHED


async def test_a_failing_vehicle_costs_no_order_where_others_work() -> None:
    engine, fleet = await site(V1="A", V2="H")
    for number in range(6):
        engine.create(request("BCD"[number % 3]), f"T-{number}")
        if fleet.sent[-1][0] == "V1":
            fleet.fail("V1")
        fleet.finish("V2", at="H")

    assert [status_of(engine, f"T-{number}").state for number in range(6)] == [S.FINISHED] * 6
    assert [name for name, _ in fleet.sent].count("V1") == 3
    assert (vehicle(engine).taken_out, vehicle(engine, "V2").taken_out) == (True, False)


@pytest.mark.parametrize("more", [{"intendedVehicle": "V1"}, {"onFailure": []}])
async def test_an_order_stays_with_the_vehicle_that_the_host_wants(more: dict[str, Any]) -> None:
    engine, fleet = await site(V1="A", V2="H")
    engine.create(request("C", **more), "T")
    fleet.fail("V1")

    assert status_of(engine).state is S.FAILED


async def test_a_loaded_order_stays_with_its_vehicle() -> None:
    engine, fleet = await site(V1="A", V2="H")
    engine.create(request("L:Load", "F"), "T")
    fleet.finish("V1")
    fleet.fail("V1")

    assert status_of(engine).state is S.FAILED
    assert "carries a load" in status_of(engine).reason


async def test_an_order_does_not_wait_for_vehicles_that_are_away() -> None:
    engine, fleet = await site(V1="A")
    engine.create(request("C"), "T")
    fleet.fail("V1")

    assert status_of(engine).state is S.FAILED
    assert "wheel lost" in status_of(engine).reason


@pytest.mark.parametrize("kind", [FailureKind.DRIVE, FailureKind.REFUSED, FailureKind.ACTION])
async def test_an_impossible_order_visits_some_vehicles_and_takes_none_out(kind: FailureKind) -> None:
    engine, fleet = await site(V1="A", V2="G", V3="H")
    for number in range(5):
        engine.create(request("D"), f"T-{number}")
        while status_of(engine, f"T-{number}").state is S.BEING_PROCESSED:
            fleet.fail(status_of(engine, f"T-{number}").processing_vehicle or "", kind=kind)
        assert status_of(engine, f"T-{number}").state is S.FAILED
        assert len(fleet.sent) == 3 * (number + 1)

    assert not any(vehicle(engine, name).taken_out for name in ("V1", "V2", "V3"))


async def test_an_impossible_destination_among_others_takes_none_out() -> None:
    engine, fleet = await site(V1="A", V2="H")
    for number in range(6):
        engine.create(request("D", intendedVehicle=f"V{number % 2 + 1}"), f"bad-{number}")
        fleet.fail(f"V{number % 2 + 1}")
        engine.create(request("G", intendedVehicle="V2"), f"good-{number}")
        fleet.finish("V2", at="H")

    assert not vehicle(engine).taken_out
    assert not vehicle(engine, "V2").taken_out


async def test_a_fleet_in_which_every_order_fails_keeps_its_orders() -> None:
    engine, fleet = await site(V1="A", V2="H")
    for number in range(12):
        engine.create(request("BCDEFG"[number % 6]), f"T-{number}")
        while (told := status_of(engine, f"T-{number}")).state is S.BEING_PROCESSED:
            fleet.fail(told.processing_vehicle or "")

    assert vehicle(engine).taken_out
    assert vehicle(engine, "V2").taken_out
    assert status_of(engine, "T-11").state is S.DISPATCHABLE


def withdraw(engine: Engine, fleet: ScriptedFleet, name: str) -> None:
    order = engine.state.orders.named(name)
    assert order
    engine.withdraw(order.number, "not needed")
    fleet.fail("V1")


def fail_in_manual(_: Engine, fleet: ScriptedFleet, name: str) -> None:
    del name
    fleet.fields["V1"] = {"operating_mode": "MANUAL"}
    fleet.fail("V1")
    fleet.fields.clear()
    fleet.appear("V1", "A")


def fail_in_emergency_stop(_: Engine, fleet: ScriptedFleet, name: str) -> None:
    del name
    fleet.fields["V1"] = {"safety_state": {"active_emergency_stop": "MANUAL", "field_violation": False}}
    fleet.fail("V1")
    fleet.fields.clear()
    fleet.appear("V1", "A")


def unfit(_: Engine, fleet: ScriptedFleet, name: str) -> None:
    del name
    fleet.fail("V1", kind=FailureKind.UNFIT)


@pytest.mark.parametrize("end", [withdraw, fail_in_manual, fail_in_emergency_stop, unfit])
async def test_what_the_robot_cannot_help_does_not_count(
    end: Callable[[Engine, ScriptedFleet, str], None],
) -> None:
    engine, fleet = await site(V1="A")
    for number, place in enumerate("BCDE"):
        engine.create(request(place), f"T-{number}")
        end(engine, fleet, f"T-{number}")
        assert status_of(engine, f"T-{number}").state is S.FAILED

    assert not vehicle(engine).taken_out


async def test_an_order_that_no_other_vehicle_can_take_over_fails_instead_of_waiting_for_one() -> None:
    engine, fleet = await site(V1="A", V2="H")
    found = engine.registry.named("V2")
    assert found
    engine.accept_order_types(found, (AcceptableOrderType(name="Park", priority=0),))
    engine.create(request("B"), "of another type")
    fleet.fail("V1")
    assert status_of(engine, "of another type").state is S.FAILED

    engine.accept_order_types(found, ANY_ORDER_TYPE)
    fleet.fields["V2"] = {
        "mobile_robot_position": {"x": 0.0, "y": 0.0, "theta": 0.0, "map_id": "attic", "localized": True}
    }
    fleet.appear("V2", "H")
    engine.create(request("B"), "of another floor")
    fleet.fail("V1")
    assert status_of(engine, "of another floor").state is S.FAILED

    fleet.fields.clear()
    fleet.appear("V2", "H")
    engine.create(request("B"), "of both")
    fleet.fail("V1")
    assert status_of(engine, "of both").processing_vehicle == "V2"
