"""Vehicles under way are rerouted on a host's request or a path lock; their bases never change."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import cycle
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_order_service.engine.engine import Engine
from nena_order_service.errors import NotReroutableError, VehicleNotReachedError
from nena_order_service.fleet.outputs import OperationStarted
from nena_order_service.fleet.vda_order import VdaOrder
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.fleet_api.traffic import WaitCause
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.fleet_api.vehicle import ReroutingOutcome, ReroutingType
from nena_shared.plant import (
    Link,
    Location,
    LocationType,
    ObjectKind,
    PlantModel,
    UnknownObjectError,
    Vehicle,
)
from support.fleet_examples import factsheet
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, key, make_engine

PLANT = PlantModel(
    name="two ways",
    points=(
        *(point(name, 2000 * index) for index, name in enumerate("ABCDEF")),
        *(point(name, 2000 * index + 3000, 3000) for index, name in enumerate("XY")),
    ),
    paths=tuple(
        path(ends, 2000 if set(ends) < set("ABCDEF ") else 3000)
        for ends in ("A B", "B C", "C D", "D E", "E F", "B X", "X Y", "Y D", "C Y")
    ),
    location_types=(LocationType(name="Station", allowed_operations=("Load",)),),
    locations=(Location(name="Shelf", type="Station", links=(Link(point="E"),)),),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)
REGULAR, FORCED = ReroutingType


def base(vda_order: VdaOrder) -> str:
    return "".join(node.node_id for node in vda_order.nodes if node.released)


def whole(vda_order: VdaOrder) -> str:
    return "".join(node.node_id for node in vda_order.nodes)


async def under_way(
    fleet: ScriptedFleet, *, ahead: int = 1, goal: str = "E", store: MemoryStore | None = None
) -> Engine:
    engine = await make_engine(PLANT, store or MemoryStore(), fleet, release_ahead=ahead)
    fleet.appear("V1", "A")
    engine.create(request(goal, intendedVehicle="V1"), "T-1")
    return engine


async def with_blocked_destination(fleet: ScriptedFleet, goal: str) -> Engine:
    """Order V1 to a point on which V2 stands out of order, so that nothing is sent."""
    engine = await make_engine(PLANT, MemoryStore(), fleet)
    fleet.out_of_order.add("V2")
    fleet.appear("V2", goal)
    fleet.appear("V1", "A")
    engine.create(request(goal, intendedVehicle="V1"), "T-1")
    return engine


def locked(*paths: str) -> dict[str, bool]:
    return {each.replace(" ", " --- "): True for each in paths}


def lock(engine: Engine, *paths: str) -> None:
    engine.context.finder.set_locks(locked(*paths))
    engine.plant_changed()


def order(engine: Engine) -> TransportOrder:
    found = engine.state.orders.visible_named("T-1")
    assert found
    return found


def reroute(engine: Engine, kind: ReroutingType = REGULAR) -> tuple[ReroutingOutcome, str]:
    vehicle = engine.registry.named("V1")
    assert vehicle
    done = engine.reroute(vehicle, kind)
    return done.outcome, "".join(done.route)


def held(engine: Engine, name: str = "V1") -> str:
    return "".join(each.point for each in engine.traffic.held_by(name))


async def test_vehicle_avoids_a_path_locked_ahead_of_it() -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet)
    assert whole(fleet.sent[0][1]) == "ABCDE"

    lock(engine, "C D")

    ((_, update),) = fleet.extended
    assert (base(update), whole(update)) == ("AB", "ABCYDE")
    assert held(engine) == "AB"
    assert order(engine).status.drive_orders[0].route == tuple("ABCYDE")
    assert order(engine).status.history[-1].event_code == "nena:rerouted"
    for index in range(6):
        fleet.pass_node("V1", index)
    assert base(fleet.missions[key("V1")]) == "ABCYDE"
    assert fleet.finish("V1", at="E")
    assert order(engine).state is TransportOrderState.FINISHED


async def test_actions_behind_another_way_have_new_ids() -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet, goal="Shelf:Load")
    lock(engine, "B C")
    old, new = fleet.sent[0][1].actions[0], fleet.extended[0][1].actions[0]
    assert (old.action_type, old.action_parameters) == (new.action_type, new.action_parameters)
    assert old.action_id != new.action_id


async def test_the_robot_drives_its_order() -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet, ahead=0)
    lock(engine, "C D")
    assert (fleet.extended, fleet.cancelled) == ([], [])
    assert reroute(engine) == (ReroutingOutcome.UNCHANGED, "")


async def test_order_waits_before_a_locked_path_and_continues_after_the_unlock() -> None:
    fleet, store = ScriptedFleet({}), MemoryStore()
    engine = await under_way(fleet, goal="F", store=store)

    lock(engine, "D E")
    assert whole(fleet.extended[-1][1]) == "AB"
    assert fleet.finish("V1", at="B")
    assert "waits until path 'D --- E' is unlocked" in order(engine).status.reason
    assert order(engine).state is TransportOrderState.BEING_PROCESSED
    vehicle = engine.registry.named("V1")
    wait = vehicle and engine.reporter.vehicle_status(vehicle).wait
    assert wait
    assert (wait.vehicles, wait.at, wait.cause) == ((), "D --- E", WaitCause.LOCKED)
    engine.run_checks()
    assert len(fleet.sent) == 1
    lock(engine)

    assert whole(fleet.sent[1][1]) == "BCDEF"
    assert fleet.sent[1][1].order_id == "T-1-0~1"


async def test_order_waiting_for_an_unlock_still_waits_after_a_restart() -> None:
    fleet, store = ScriptedFleet({}), MemoryStore()
    engine = await under_way(fleet, goal="F", store=store)
    lock(engine, "D E")
    assert fleet.finish("V1", at="B")

    again = ScriptedFleet({"V1": "B"})
    engine = await make_engine(PLANT, store, again, release_ahead=1, locks=locked("D E"))
    again.appear("V1", "B")
    assert "waits until path" in order(engine).status.reason
    lock(engine)

    assert [vda_order.order_id for _, vda_order in again.sent] == ["T-1-0~1"]


async def test_stored_lock_is_respected_after_a_kill() -> None:
    fleet, store = ScriptedFleet({}), MemoryStore()
    await under_way(fleet, store=store)
    again = ScriptedFleet({"V1": "A"})
    await make_engine(PLANT, store, again, release_ahead=1, locks=locked("C D"))
    assert whole(again.missions[key("V1")]) == "ABCYDE"


async def test_order_whose_next_drive_order_is_locked_waits() -> None:
    fleet = ScriptedFleet({})
    engine = await make_engine(PLANT, MemoryStore(), fleet)
    fleet.appear("V1", "A")
    engine.create(request("D", "F"), "T-1")
    lock(engine, "E F")
    assert fleet.finish("V1")
    assert "waits until path" in order(engine).status.reason
    lock(engine)
    assert fleet.finish("V1")
    assert order(engine).state is TransportOrderState.FINISHED


async def test_a_request_without_a_route_waits_for_the_unlock() -> None:
    fleet = ScriptedFleet({})
    engine = await with_blocked_destination(fleet, "F")
    assert fleet.sent == []
    lock(engine, "E F")
    assert "waits until path" in order(engine).status.reason
    lock(engine)
    assert "V2, which stands on" in order(engine).status.reason


async def test_host_requests_the_currently_best_route() -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet)
    assert reroute(engine) == (ReroutingOutcome.UNCHANGED, "")
    lock(engine, "B C")
    assert whole(fleet.extended[0][1]) == "ABXYDE"
    lock(engine)

    assert reroute(engine) == (ReroutingOutcome.REROUTED, "BCDE")

    assert whole(fleet.extended[1][1]) == "ABCDE"


async def test_host_requests_a_route_around_a_resting_vehicle() -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet)
    fleet.out_of_order.add("V2")
    fleet.appear("V2", "C")
    assert reroute(engine) == (ReroutingOutcome.UNCHANGED, "")
    lock(engine, "B X")  # there is no way around, and the one that there is goes on
    assert reroute(engine) == (ReroutingOutcome.UNCHANGED, "")
    assert fleet.extended == []


async def test_forced_rerouting_continues_from_the_robots_position() -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet, ahead=0)
    fleet.accept("V1")
    fleet.pass_node("V1", 1)

    outcome, _ = reroute(engine, FORCED)

    assert (outcome, fleet.cancelled) == (ReroutingOutcome.STOPPING, ["V1"])
    assert held(engine) == "BCDE"  # nothing is freed under a robot that may still drive
    assert reroute(engine, FORCED)[0] is ReroutingOutcome.STOPPING
    assert fleet.cancelled == ["V1"]
    fleet.at["V1"] = "B"
    fleet.confirm_cancel("V1")
    assert [(m.order_id, whole(m)) for _, m in fleet.sent] == [("T-1-0", "ABCDE"), ("T-1-0~1", "BCDE")]
    assert fleet.finish("V1")
    assert order(engine).state is TransportOrderState.FINISHED


async def test_forced_rerouting_survives_a_restart() -> None:
    fleet, store = ScriptedFleet({}), MemoryStore()
    engine = await under_way(fleet, ahead=0, store=store)
    reroute(engine, FORCED)
    again = ScriptedFleet({"V1": "A"})
    engine = await make_engine(PLANT, store, again)
    assert again.cancelled == ["V1"]
    again.confirm_cancel("V1")
    assert [vda_order.order_id for _, vda_order in again.sent] == ["T-1-0~1"]


async def test_withdrawal_overrides_rerouting() -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet)
    reroute(engine, FORCED)
    engine.withdraw(order(engine).number, "no longer wanted")
    with pytest.raises(NotReroutableError, match="WITHDRAWN"):
        reroute(engine)
    fleet.confirm_cancel("V1")
    assert order(engine).state is TransportOrderState.FAILED


async def test_begun_operation_is_not_repeated() -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet, ahead=0, goal="Shelf:Load")
    reroute(engine, FORCED)
    engine.on_events(OperationStarted(key("V1"), fleet.missions[key("V1")].order_id))
    fleet.confirm_cancel("V1")
    assert order(engine).state is TransportOrderState.FAILED
    assert "check what it has done" in order(engine).status.reason


async def test_vehicle_at_work_is_not_stopped() -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet, ahead=0, goal="Shelf:Load")
    engine.on_events(OperationStarted(key("V1"), fleet.missions[key("V1")].order_id))
    with pytest.raises(NotReroutableError, match="executing its operation"):
        reroute(engine, FORCED)


async def test_vehicles_without_an_order_or_unreachable_are_not_rerouted() -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet)
    idle = engine.registry.named("V2")
    assert idle
    with pytest.raises(NotReroutableError, match="no transport order"):
        engine.reroute(idle, REGULAR)
    del fleet.at["V1"]
    with pytest.raises(VehicleNotReachedError, match="OFFLINE"):
        reroute(engine, FORCED)
    assert fleet.cancelled == []


async def test_rerouting_an_unsent_order_changes_nothing() -> None:
    fleet = ScriptedFleet({})
    engine = await with_blocked_destination(fleet, "E")
    assert reroute(engine, FORCED) == (ReroutingOutcome.UNCHANGED, "")


PATHS = [f"{each.source} {each.destination}" for each in PLANT.paths]


@settings(max_examples=60, deadline=None)
@given(
    ahead=st.integers(1, 3),
    events=st.lists(
        st.one_of(st.just("drive"), st.just("reroute"), st.sets(st.sampled_from(PATHS), max_size=3)),
        max_size=15,
    ),
)
async def test_base_never_changes_and_nothing_is_freed_before_the_robot(
    ahead: int, events: list[str | set[str]]
) -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet, ahead=ahead, goal="F")
    passed, known = 0, base(fleet.missions[key("V1")])
    for event in events:
        if isinstance(event, set):
            lock(engine, *event)
        elif event == "reroute":
            reroute(engine)
        elif passed + 1 < len(known):
            passed += 1
            fleet.pass_node("V1", passed)
        now = base(fleet.missions[key("V1")])
        assert now.startswith(known)
        assert _in_a_row(known[passed:], held(engine))
        known = now


def _in_a_row(wanted: str, there: Iterable[str]) -> bool:
    return wanted in "".join(there)


def limit_nodes(fleet: ScriptedFleet, most: int) -> None:
    """Let V1 accept no orders with more nodes."""
    limited = factsheet(robot=key("V1"))
    limits = limited.protocol_limits.maximum_array_lengths.model_copy(update={"order_nodes": most})
    protocol = limited.protocol_limits.model_copy(update={"maximum_array_lengths": limits})
    fleet.factsheets["V1"] = limited.model_copy(update={"protocol_limits": protocol})


@pytest.mark.parametrize(("most_nodes", "driven"), [(6, "ABXYDE"), (5, "AB")])
async def test_a_vehicle_goes_around_a_lock_only_where_its_robot_can_drive(
    most_nodes: int, driven: str
) -> None:
    fleet = ScriptedFleet({})
    limit_nodes(fleet, most_nodes)
    engine = await under_way(fleet)
    lock(engine, "B C")
    assert whole(fleet.missions[key("V1")]) == driven


async def test_a_host_learns_that_the_robot_cannot_drive_the_other_route() -> None:
    fleet = ScriptedFleet({})
    limit_nodes(fleet, 5)
    engine = await under_way(fleet)
    engine.context.finder.set_locks(locked("B C"))
    vehicle = engine.registry.named("V1")
    assert vehicle
    done = engine.reroute(vehicle, REGULAR)
    assert done.outcome is ReroutingOutcome.UNCHANGED
    assert "6" in str(done.reason)
    assert "5" in str(done.reason)
    assert whole(fleet.missions[key("V1")]) == "ABCDE"


async def test_after_a_lock_all_vehicles_are_rerouted() -> None:
    lanes = range(6)
    at = {(lane, name): f"{name}{lane}" for lane in lanes for name in "ABCXD"}
    plant = PlantModel(
        name="lanes",
        points=tuple(point(name, 1000 * lane, 1000 * "ABCXD".index(key)) for (lane, key), name in at.items()),
        paths=tuple(
            path(f"{one}{lane} {other}{lane}", 1000 * int(length))
            for lane in lanes
            for one, other, length in ("AB1", "BC1", "CD1", "BX2", "XD2")
        ),
        vehicles=tuple(Vehicle(name=f"V{lane}") for lane in lanes),
    )
    fleet = ScriptedFleet({})
    engine = await make_engine(plant, MemoryStore(), fleet, release_ahead=1)
    for lane in lanes:
        fleet.appear(f"V{lane}", f"A{lane}")
        engine.create(request(f"D{lane}", intendedVehicle=f"V{lane}"), f"T-{lane}")

    def led_around() -> int:
        return sum(f"X{lane}" in whole(fleet.missions[key(f"V{lane}")]) for lane in lanes)

    lock(engine, *(f"C{lane} D{lane}" for lane in lanes))
    assert led_around() == len(lanes)
    last = f"V{lanes[-1]}"
    fleet.pass_node(last, 0)
    fleet.pass_node(last, 1)
    assert base(fleet.missions[key(last)]).endswith(f"X{lanes[-1]}")


async def test_a_vehicle_that_cannot_be_rerouted_does_not_block_rerouting_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fleet = ScriptedFleet({})
    engine = await under_way(fleet, goal="D")
    fleet.appear("V2", "B")
    engine.create(request("E", intendedVehicle="V2"), "T-2")
    send, failed = engine._rerouting._send_route, list[str]()

    def failing(under_way: Any, *rest: Any) -> None:
        if under_way.vehicle.name == "V1":
            failed.append("V1")
            message = "no VDA order"
            raise ValueError(message)
        send(under_way, *rest)

    monkeypatch.setattr(engine._rerouting, "_send_route", failing)
    lock(engine, "C D")
    assert failed == ["V1"]
    assert "Y" in whole(fleet.missions[key("V2")])
    assert whole(fleet.missions[key("V1")]) == base(fleet.missions[key("V1")]), "it stops before the lock"


async def behind_a_queue(fleet: ScriptedFleet) -> Engine:
    """Let V1 wait at B for V2 at C, which waits for V3 at D."""
    vehicles = tuple(Vehicle(name=f"V{number}") for number in (1, 2, 3, 4))
    plant = PLANT.model_copy(update={"vehicles": vehicles})
    engine = await make_engine(plant, MemoryStore(), fleet, release_ahead=1)
    for name, at, goal in (("V3", "D", "F"), ("V2", "C", "E"), ("V1", "A", "F")):
        fleet.appear(name, at)
        engine.create(request(goal, intendedVehicle=name), name.replace("V", "T-"))
    fleet.pass_node("V1", 0)
    fleet.pass_node("V1", 1)
    return engine


async def test_a_vehicle_waiting_in_a_queue_is_rerouted() -> None:
    fleet = ScriptedFleet({})
    engine = await behind_a_queue(fleet)
    assert whole(fleet.missions[key("V1")]) == "ABCDEF"

    engine.run_checks()
    assert whole(fleet.missions[key("V1")]) == "ABCDEF", "it may go on soon"
    engine.run_checks()

    assert whole(fleet.missions[key("V1")]) == "ABXYDEF"
    assert base(fleet.missions[key("V1")]) == "ABX"
    assert "less traffic" in order(engine).status.history[-1].supplements[0]


@pytest.mark.parametrize(("other", "driven"), [("idle", "ABCDEF"), ("works", "ABXYDEF"), ("away", "ABCDEF")])
async def test_a_vehicle_is_not_rerouted_towards_one_that_may_stay_for_long(other: str, driven: str) -> None:
    fleet = ScriptedFleet({})
    engine = await behind_a_queue(fleet)
    fleet.appear("V4", "Y")
    if other != "idle":
        engine.create(request("F", intendedVehicle="V4"), "T-4")
    if other == "away":
        del fleet.at["V4"]
    engine.run_checks()
    engine.run_checks()
    assert whole(fleet.missions[key("V1")]) == driven


@pytest.mark.parametrize(("most_nodes", "driven"), [(7, "ABXYDEF"), (6, "ABCDEF")])
async def test_a_vehicle_is_rerouted_only_where_its_robot_can_drive(most_nodes: int, driven: str) -> None:
    fleet = ScriptedFleet({})
    limit_nodes(fleet, most_nodes)
    engine = await behind_a_queue(fleet)
    engine.run_checks()
    engine.run_checks()
    assert whole(fleet.missions[key("V1")]) == driven


async def test_a_vehicle_is_rerouted_once_until_it_makes_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    fleet = ScriptedFleet({})
    engine = await behind_a_queue(fleet)
    router, traffic = engine.context.finder.router, engine.context.traffic
    routes = cycle([router.route("B", "F", avoid={"C"}), router.route("B", "F", avoid={"X"})])
    monkeypatch.setattr(traffic, "route_around", lambda *_: next(routes))
    monkeypatch.setattr(traffic, "waiting_at_end", lambda: {"V1": 1})
    for _ in range(4):
        engine.run_checks()
    assert whole(fleet.missions[key("V1")]) == "ABXYDEF"
    assert len([each for each in order(engine).status.history if "less traffic" in str(each)]) == 1


async def test_a_point_missing_in_the_plant_does_not_end_the_search(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fleet = ScriptedFleet({})
    engine = await behind_a_queue(fleet)

    def lost(*_args: object, **_options: object) -> None:
        raise UnknownObjectError(ObjectKind.RESOURCE, "Z")

    monkeypatch.setattr(engine.context.routes, "route", lost)
    engine.run_checks()
    engine.run_checks()
    assert whole(fleet.missions[key("V1")]) == "ABCDEF"


async def test_a_vehicle_in_a_moving_queue_keeps_its_route() -> None:
    fleet = ScriptedFleet({})
    engine = await behind_a_queue(fleet)
    engine.run_checks()
    fleet.pass_node("V3", 0)
    fleet.pass_node("V3", 1)
    fleet.pass_node("V2", 0)
    fleet.pass_node("V2", 1)
    engine.run_checks()
    engine.run_checks()

    assert whole(fleet.missions[key("V1")]) == "ABCDEF"
