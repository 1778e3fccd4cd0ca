from __future__ import annotations

import asyncio
from collections.abc import Collection
from dataclasses import dataclass, field
from itertools import count
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.engine import engine as engine_module
from nena_order_service.engine.driving import RELOCATION_PAUSE
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.vda_order import VdaOrder
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.transport_order import (
    OrderSequenceStatus,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import IntegrationLevel, VehicleStatus
from nena_shared.plant import Link, Location, LocationType, PlantModel, Vehicle
from support.clocks import ManualClock
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, key, make_engine, sent

S = TransportOrderState

PLANT = PlantModel(
    name="ring",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCD")),
    paths=(path("A B"), path("B C"), path("C D"), path("D A"), path("B A")),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
    location_types=(LocationType(name="T", allowed_operations=("Load",)),),
    locations=(Location(name="L", type="T", links=(Link(point="C"),)),),
)


ROOMY = PLANT.model_copy(
    update={
        "points": (*PLANT.points, point("P"), point("Q")),
        "paths": tuple(
            path(ends, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "C D", "D A", "B P", "D Q")
        ),
    }
)
"""The same with passing places."""


@dataclass
class Ear:
    orders: list[TransportOrderStatus] = field(default_factory=list)
    sequences: list[OrderSequenceStatus] = field(default_factory=list)
    vehicles: list[VehicleStatus] = field(default_factory=list)

    def order_changed(self, status: TransportOrderStatus) -> None:
        self.orders.append(status)

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        self.sequences.append(status)

    def vehicle_changed(self, status: VehicleStatus) -> None:
        self.vehicles.append(status)


@pytest.fixture
def fleet() -> ScriptedFleet:
    return ScriptedFleet({"V1": "A"})


@pytest.fixture
async def engine(store: MemoryStore, fleet: ScriptedFleet) -> Engine:
    return await make_engine(PLANT, store, fleet)


def now(engine: Engine, order: TransportOrder) -> TransportOrderStatus:
    found = engine.state.orders.visible(order.number)
    assert found is not None
    return found.status


async def test_nothing_is_sent_or_published_before_the_commit(
    engine: Engine, store: MemoryStore, fleet: ScriptedFleet
) -> None:
    ear = Ear()
    engine.unit_of_work.listeners.append(ear)
    engine.unit_of_work.vehicle_listeners.append(ear)
    store.held = True
    order = engine.create(request("C"), "T")
    assert (fleet.sent, ear.orders, engine.state.orders.visible(order.number)) == ([], [], None)
    store.release()
    assert sent(fleet) == [("V1", "T-0")]
    assert [status.state for status in ear.orders] == [S.DISPATCHABLE, S.BEING_PROCESSED]
    assert ear.vehicles[-1].transport_order == "T"


async def test_each_drive_order_starts_at_the_robots_position(engine: Engine, fleet: ScriptedFleet) -> None:
    order = engine.create(request("L:Load", "A"), "T")
    fleet.finish("V1")
    fleet.finish("V1")
    assert now(engine, order).state is S.FINISHED
    nodes = [[node.node_id for node in vda_order.nodes] for _, vda_order in fleet.sent]
    assert nodes == [["A", "B", "C"], ["C", "D", "A"]]
    assert [len(vda_order.actions) for _, vda_order in fleet.sent] == [1, 0]


async def test_failed_vda_order_fails_the_order_and_frees_the_vehicle(
    engine: Engine, fleet: ScriptedFleet
) -> None:
    first, second = engine.create(request("B"), "T1"), engine.create(request("B"), "T2")
    assert now(engine, second).state is S.DISPATCHABLE
    fleet.fail("V1")
    assert now(engine, first).state is S.FAILED
    assert now(engine, first).reason == "wheel lost: FATAL wheel"
    assert now(engine, second).processing_vehicle == "V1"


async def test_order_with_a_lost_robot_reports_it_until_it_returns(
    engine: Engine, fleet: ScriptedFleet
) -> None:
    order = engine.create(request("C"), "T")
    ear = Ear()
    engine.unit_of_work.listeners.append(ear)
    engine.unit_of_work.vehicle_listeners.append(ear)
    fleet.hinder("V1", "the robot has lost its connection to the broker")
    lost = "robot V1 travels to destination 1 of 1, but the robot has lost its connection to the broker"
    assert now(engine, order).reason == lost
    assert [status.reason for status in ear.orders] == [lost]
    assert ear.vehicles[-1].reason == lost
    fleet.hinder("V1", "the robot has lost its connection to the broker")
    assert len(ear.orders) == 1
    fleet.hinder("V1", "")
    assert now(engine, order).reason == "robot V1 travels to destination 1 of 1"


async def test_robot_that_does_not_accept_the_vda_order_fails_the_order(
    engine: Engine, store: MemoryStore, fleet: ScriptedFleet
) -> None:
    store.held = True
    order = engine.create(request("B", "C"), "T")
    fleet.missions[key("V1")] = VdaOrder(order_id="other", nodes=(), edges=())
    store.release()
    assert now(engine, order).state is S.FAILED
    assert "'other'" in now(engine, order).reason


async def test_withdrawal_waits_for_the_robot(engine: Engine, fleet: ScriptedFleet) -> None:
    order = engine.create(request("B", "C"), "T")
    engine.withdraw(order.number, "not needed")
    engine.withdraw(order.number, "again")
    assert (now(engine, order).state, fleet.cancelled) == (S.WITHDRAWN, ["V1"])
    fleet.confirm_cancel("V1")
    assert now(engine, order).state is S.FAILED


async def test_robot_that_finishes_before_the_cancel_gets_no_further_drive_order(
    engine: Engine, fleet: ScriptedFleet
) -> None:
    order = engine.create(request("B", "C"), "T")
    engine.withdraw(order.number, "not needed")
    fleet.finish("V1")
    assert now(engine, order).state is S.FAILED
    assert sent(fleet) == [("V1", "T-0")]


async def test_order_whose_vehicle_is_not_located_waits_until_it_is(
    engine: Engine, fleet: ScriptedFleet
) -> None:
    order = engine.create(request("B", "C"), "T")
    fleet.finish("V1", at="nowhere")
    assert now(engine, order).state is S.BEING_PROCESSED
    assert "but it reports neither a trusted pose" in now(engine, order).reason
    fleet.appear("V1", "B")
    assert sent(fleet) == [("V1", "T-0"), ("V1", "T-1")]


async def test_vehicle_with_a_changed_reason_is_published_once(engine: Engine, fleet: ScriptedFleet) -> None:
    ear = Ear()
    engine.unit_of_work.listeners.append(ear)
    engine.unit_of_work.vehicle_listeners.append(ear)
    engine.run_checks()
    assert [status.name for status in ear.vehicles] == ["V1", "V2"]
    engine.create(request("B", intendedVehicle="V2"), "T")
    engine.run_checks()
    engine.run_checks()
    assert [status.name for status in ear.vehicles[2:]] == ["V1"]
    assert ear.vehicles[-1].reason == "idle: no waiting order suits it"
    fleet.at["V2"] = "D"
    engine.run_checks()
    assert engine.reporter.vehicle_status(engine.registry.discover(key("V2"))).transport_order == "T"


async def test_robot_that_appears_gets_its_waiting_order(engine: Engine, fleet: ScriptedFleet) -> None:
    order = engine.create(request("B", intendedVehicle="V2"), "T")
    assert now(engine, order).reason == "waits for robot 'V2', which is offline"
    fleet.appear("V2", "D")
    assert now(engine, order).processing_vehicle == "V2"


async def test_restart_resumes_orders_under_way(
    engine: Engine, store: MemoryStore, fleet: ScriptedFleet
) -> None:
    running = engine.create(request("B", "C"), "running")
    waiting = engine.create(request("B"), "waiting")
    fleet.accept("V1")

    after = ScriptedFleet({"V1": "A"})
    again = await make_engine(PLANT, store, after)
    assert after.adopted == [("V1", "running-0", True)]
    assert after.sent == []
    after.finish("V1")
    after.finish("V1")
    after.finish("V1")
    assert now(again, running).state is S.FINISHED
    assert now(again, waiting).state is S.FINISHED
    assert again.state.orders.next_number() == 3


async def test_restart_cancels_what_was_withdrawn(
    engine: Engine, store: MemoryStore, fleet: ScriptedFleet
) -> None:
    order = engine.create(request("B"), "T")
    engine.withdraw(order.number, "not needed")
    after = ScriptedFleet({"V1": "A"})
    again = await make_engine(PLANT, store, after)
    assert (after.adopted, after.cancelled) == ([("V1", "T-0", False)], ["V1"])
    after.confirm_cancel("V1")
    assert now(again, order).state is S.FAILED
    assert fleet.cancelled == ["V1"]


async def test_restart_with_another_plant_fails_impossible_waiting_orders(
    engine: Engine, store: MemoryStore
) -> None:
    engine.create(request("B"), "T1")
    order = engine.create(request("L:Load"), "T2")
    smaller = PlantModel(name="small", points=(point("A"), point("B")), paths=(path("A B"),))
    again = await make_engine(smaller, store, ScriptedFleet({}))
    assert now(again, order).state is S.FAILED
    assert "no longer possible in this plant" in now(again, order).reason


async def test_restart_with_another_plant_fails_impossible_running_orders(
    engine: Engine, store: MemoryStore
) -> None:
    order = engine.create(request("B", "L:NOP"), "T")
    smaller = PlantModel(
        name="small", points=(point("A"), point("B")), paths=(path("A B"),), vehicles=PLANT.vehicles
    )
    fleet = ScriptedFleet({"V1": "A"})
    again = await make_engine(smaller, store, fleet)
    fleet.finish("V1")
    assert now(again, order).state is S.FAILED
    assert "'L'" in now(again, order).reason


async def test_restart_before_the_vda_order_was_sent_sends_it(engine: Engine, store: MemoryStore) -> None:
    order = engine.create(request("B"), "T")
    store.found.drives.clear()
    fleet = ScriptedFleet({"V1": "A"}, mute={"V1"})
    again = await make_engine(PLANT, store, fleet)
    assert (fleet.sent, now(again, order).state) == ([], S.BEING_PROCESSED)

    fleet.mute.clear()
    fleet.appear("V1", "A")

    assert sent(fleet) == [("V1", "T-0")]
    assert fleet.finish("V1")
    assert now(again, order).state is S.FINISHED


async def test_restart_with_a_vda_order_that_cannot_be_read_fails_the_order(
    engine: Engine, store: MemoryStore
) -> None:
    order = engine.create(request("B"), "T")
    store.found.drives[order.number] = "{}"
    again = await make_engine(PLANT, store, ScriptedFleet({"V1": "A"}))
    assert now(again, order).state is S.FAILED
    assert "unreadable" in now(again, order).reason


async def test_restart_ends_what_was_withdrawn_before_it_was_sent(engine: Engine, store: MemoryStore) -> None:
    order = engine.create(request("B"), "T")
    engine.withdraw(order.number, "not needed")
    store.found.drives.clear()
    again = await make_engine(PLANT, store, ScriptedFleet({"V1": "A"}))
    assert now(again, order).state is S.FAILED


STEPS = st.lists(
    st.sampled_from(["create", "both", "V1", "V2", "withdraw", "finish", "fail", "cancel", "restart"]),
    max_size=25,
)


@given(STEPS, st.randoms(use_true_random=False))
def test_every_order_ends_once_whatever_happens(steps: list[str], chance: Random) -> None:
    asyncio.run(_play(steps, chance))


def _robot_acts(step: str, fleet: ScriptedFleet, chance: Random) -> None:
    robot = chance.choice(list(fleet.missions)).serial_number
    if step == "finish":
        fleet.finish(robot)
    elif step == "fail":
        fleet.fail(robot)
    elif robot in fleet.cancelled:
        fleet.confirm_cancel(robot)
    else:
        fleet.accept(robot)


def _let_all_end(engine: Engine, fleet: ScriptedFleet, rounds: int) -> None:
    for _ in range(rounds):
        for robot in tuple(fleet.missions):
            if not fleet.finish(robot.serial_number) and robot.serial_number in fleet.cancelled:
                fleet.confirm_cancel(robot.serial_number)
        engine.clock.advance(RELOCATION_PAUSE)  # type: ignore[attr-defined] # the clock of make_engine
        engine.run_checks()


async def _play(steps: list[str], chance: Random) -> None:
    store, fleet, ear = MemoryStore(), ScriptedFleet({"V1": "A", "V2": "C"}), Ear()
    engine = await make_engine(ROOMY, store, fleet)
    engine.unit_of_work.listeners.append(ear)
    engine.unit_of_work.vehicle_listeners.append(ear)
    started: list[str] = []
    count = 0
    for step in steps:
        if step in ("create", "both", "V1", "V2"):
            count += 1
            stops = chance.choice([("B",), ("C", "A"), ("L:Load",)])
            vehicle = {"intendedVehicle": step} if step in ("V1", "V2") else {}
            engine.create(request(*stops, **vehicle), f"T{count}")
        elif step == "withdraw" and (alive := list(engine.state.orders.unfinished())):
            engine.withdraw(chance.choice(alive).number, "x")
        elif step == "restart":
            started += [vda_order.order_id for _, vda_order in fleet.sent]
            missions, at = fleet.missions, fleet.at
            fleet = ScriptedFleet(at)
            engine = await make_engine(ROOMY, store, fleet)
            engine.unit_of_work.listeners.append(ear)
            engine.unit_of_work.vehicle_listeners.append(ear)
            assert fleet.missions == missions
            for name, point in tuple(at.items()):
                fleet.appear(name, point)
        elif fleet.missions:
            _robot_acts(step, fleet, chance)
    for each in engine.registry:  # a person brings back those that have failed several orders
        engine.set_integration_level(each, IntegrationLevel.TO_BE_UTILIZED)
    _let_all_end(engine, fleet, 20 * count + 20)

    started += [vda_order.order_id for _, vda_order in fleet.sent]
    assert len(started) == len(set(started))
    assert list(engine.state.orders.unfinished()) == []
    ends = [status.name for status in ear.orders if status.state.final]
    assert sorted(ends) == sorted(f"T{number}" for number in range(1, count + 1))
    versions: dict[str, int] = {}
    for status in ear.orders:
        assert status.version > versions.get(status.name, 0)
        versions[status.name] = status.version


@pytest.mark.parametrize(("seconds", "looked_at"), [(0.0, [2, 2, 2]), (1.0, [2, 0, 0])])
async def test_looking_at_all_vehicles_takes_a_limited_share_of_the_time(
    monkeypatch: pytest.MonkeyPatch, seconds: float, looked_at: list[int]
) -> None:
    """Each check takes so many seconds; what depends on the time alone is checked each time."""
    engine = await make_engine(PLANT, MemoryStore(), ScriptedFleet({"V1": "A", "V2": "C"}))
    now, looks, look = count(), list[int](), engine.run_checks

    def looked(vehicles: Collection[FleetVehicle]) -> None:
        looks.append(len(vehicles))
        look(vehicles)

    async def passes(_due: asyncio.Event, _pause: float) -> bool:
        if len(looks) >= len(looked_at):
            raise asyncio.CancelledError
        return False

    monkeypatch.setattr(engine_module, "set_within", passes)
    monkeypatch.setattr(engine.clock, "cpu", lambda: next(now) * seconds)
    monkeypatch.setattr(engine, "run_checks", looked)
    with pytest.raises(asyncio.CancelledError):
        await engine.run()
    assert looks == looked_at


@pytest.mark.parametrize(("passed", "worked", "sent"), [(0.1, 0.002, ["V1", "V2"]), (0.1, 0.1, ["V1"])])
async def test_only_a_decision_with_much_work_delays_the_next(
    monkeypatch: pytest.MonkeyPatch, passed: float, worked: float, sent: list[str]
) -> None:
    clock, fleet = ManualClock(), ScriptedFleet({"V1": "A", "V2": "C"})
    engine = await make_engine(PLANT, MemoryStore(), fleet, clock=clock)
    decide = engine.life_cycle.dispatch_orders

    def held_up() -> None:
        decide()
        clock.seconds += passed
        clock.worked += worked

    monkeypatch.setattr(engine.life_cycle, "dispatch_orders", held_up)
    for vehicle in ("V1", "V2"):
        engine.create(request("B", intendedVehicle=vehicle), f"T-{vehicle}")

    assigned = [order.vehicle for order in engine.state.orders.unfinished() if order.vehicle]
    assert assigned == sent
