"""The plan of the next minute: where vehicles will be, for whom they wait, where and why."""

from __future__ import annotations

import json

import pytest

from nena_order_service.engine.engine import Engine
from nena_order_service.routing.graph import RoutingProfile
from nena_shared.fleet_api.traffic import VehiclePlan, WaitCause
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import engine_at, reason_of, status_of

TRACK = PlantModel(
    name="single track",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDP")),
    paths=tuple(path(ends, 2000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "C D", "B P")),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)


async def plan_of(engine: Engine, vehicle: str) -> VehiclePlan:
    return next(each for each in engine.traffic_plans.current_plan().vehicles if each.vehicle == vehicle)


def ahead(plan: VehiclePlan) -> list[tuple[str, bool, float | None]]:
    return [(each.point, each.held, each.seconds) for each in plan.ahead]


async def test_the_plan_has_held_resources_and_arrival_times() -> None:
    engine, fleet = await engine_at(TRACK, {"V1": "A"}, release_ahead=1)
    assert await plan_of(engine, "V1") == VehiclePlan(vehicle="V1", at="A", holds=("A",))

    engine.create(request("D"), "T")
    fleet.pass_node("V1", 0)
    plan = await plan_of(engine, "V1")

    assert (plan.transport_order, plan.at, plan.goal, plan.wait) == ("T", "A", "D", None)
    assert plan.holds == ("A", "A --- B", "B")
    assert ahead(plan) == [("B", True, 2.0), ("C", False, 4.0), ("D", False, 6.0)]
    assert [each.path for each in plan.ahead] == ["A --- B", "B --- C", "C --- D"]


async def test_vehicle_rules_are_read_once_per_route(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine, _ = await engine_at(TRACK, {"V1": "A"}, release_ahead=1)
    engine.create(request("D"), "T")
    asked: list[Vehicle | None] = []

    def of(vehicle: Vehicle | None, _: frozenset[str]) -> RoutingProfile:
        asked.append(vehicle)
        return RoutingProfile()

    monkeypatch.setattr(RoutingProfile, "of", of)

    assert len((await plan_of(engine, "V1")).ahead) == len("BCD")
    assert len(asked) == 1


async def test_traffic_plan_names_blocking_vehicles_place_and_time() -> None:
    engine, _ = await engine_at(TRACK, {"V1": "A", "V2": "C"})
    engine.create(request("D", intendedVehicle="V2"), "T-2")
    engine.create(request("C", intendedVehicle="V1"), "T-1")

    plan = await plan_of(engine, "V1")

    assert ahead(plan) == [("B", True, 2.0), ("C", False, 4.0)]
    assert ahead(await plan_of(engine, "V2")) == [("D", True, 2.0)]
    assert plan.wait
    assert (plan.wait.vehicles, plan.wait.at, plan.wait.cause) == (("V2",), "C", WaitCause.PASSES)
    assert plan.wait.reason == "it waits for V2, which passes 'C' first"
    assert status_of(engine, "T-1").reason.endswith(f"but {plan.wait.reason}")
    assert reason_of(engine, "V1").endswith(plan.wait.reason)


PASSING = PlantModel(
    name="two side tracks",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDXY")),
    paths=tuple(
        path(ends, 2000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "C D", "B X", "C Y")
    ),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)


async def test_the_first_vehicle_passes_before_the_other_enters() -> None:
    engine, _ = await engine_at(PASSING, {"V1": "A", "V2": "D"}, release_ahead=1)
    engine.create(request("Y", intendedVehicle="V1"), "T-1")
    engine.create(request("X", intendedVehicle="V2"), "T-2")

    plan = await plan_of(engine, "V2")

    assert ahead(await plan_of(engine, "V1")) == [("B", True, 2.0), ("C", False, 4.0), ("Y", False, 6.0)]
    assert ahead(plan) == [("C", False, 8.0), ("B", False, 10.0), ("X", False, 12.0)]
    assert plan.wait
    assert plan.wait.cause is WaitCause.GOES_FIRST
    assert (
        plan.wait.reason == "it waits for V1, which goes first at 'C' (they would block each other otherwise)"
    )


async def test_a_waiting_vehicle_names_the_vehicle_on_its_route() -> None:
    engine, fleet = await engine_at(TRACK, {"V1": "A", "V2": "C"})
    fleet.hinder("V2", "has an error")
    engine.create(request("D", intendedVehicle="V1"), "T-1")

    plan = await plan_of(engine, "V1")

    assert (plan.ahead, plan.goal) == ((), None)
    assert plan.wait
    assert plan.wait.cause is WaitCause.STANDS
    assert plan.wait.reason == "it waits for V2, which stands on 'C'"


async def test_the_traffic_plan_is_json() -> None:
    engine, _ = await engine_at(TRACK, {"V1": "A"})

    body = json.loads(engine.traffic_plans.current_plan().model_dump_json(by_alias=True))

    assert body["horizon"] == 60
    assert body["vehicles"][0]["holds"] == ["A"]
