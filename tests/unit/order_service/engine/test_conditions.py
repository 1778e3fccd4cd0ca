"""Orders that wait for others: as dependencies, and as those before them in a sequence."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_order_service.engine.driving import RELOCATION_PAUSE
from nena_order_service.engine.engine import Engine
from nena_shared.fleet_api.transport_order import (
    OrderOutcome,
    OrderSequenceRequest,
    OrderSequenceStatus,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import ProcessingState, VehicleStatus
from nena_shared.plant import PlantModel, Vehicle
from support.clocks import ManualClock
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine

S = TransportOrderState

PLANT = PlantModel(
    name="star",
    points=tuple(point(name, 4000 * index) for index, name in enumerate("ABCDPQ")),
    paths=tuple(
        path(ends, 4000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "C D", "B P", "C Q")
    ),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)


@dataclass
class Site:
    engine: Engine
    fleet: ScriptedFleet
    clock: ManualClock
    ends: dict[str, TransportOrderStatus] = field(default_factory=dict)
    begun: list[tuple[str, str]] = field(default_factory=list)
    """Orders and their vehicles, as they were begun."""
    sequences: dict[str, OrderSequenceStatus] = field(default_factory=dict)

    def order(self, name: str) -> TransportOrderStatus:
        found = self.engine.state.orders.visible_named(name)
        assert found
        return found.status

    def state(self, *names: str) -> list[TransportOrderState]:
        return [self.order(name).state for name in names]

    def create(self, name: str, stop: str = "B", **fields: Any) -> None:
        self.engine.create(
            request(stop, **fields),
            name,
            {each.name: each.outcome for each in self.ends.values() if each.outcome},
        )

    def sequence(self, name: str = "S", **fields: Any) -> None:
        asked = OrderSequenceRequest.model_validate({"name": name, **fields})
        with self.engine.change():
            self.engine.sequences.create(asked, name)

    def complete(self, name: str = "S") -> None:
        found = self.engine.state.sequences.named(name)
        if found:
            with self.engine.change():
                self.engine.sequences.complete(found)

    def sequence_status(self, name: str = "S") -> OrderSequenceStatus:
        return self.sequences[name]

    def vehicle(self, name: str) -> VehicleStatus:
        vehicle = self.engine.registry.named(name)
        assert vehicle
        return self.engine.reporter.vehicle_status(vehicle)

    def withdraw(self, name: str) -> None:
        found = self.engine.state.orders.named(name)
        assert found
        self.engine.withdraw(found.number, "not needed")

    def order_changed(self, status: TransportOrderStatus) -> None:
        if status.state.final:
            self.ends[status.name] = status
        elif status.state is S.BEING_PROCESSED and status.processing_vehicle:
            entry = (status.name, status.processing_vehicle)
            if entry not in self.begun:
                self.begun.append(entry)

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        before = self.sequences.get(status.name)
        assert before is None or before.version < status.version
        assert before is None or before.finished_index <= status.finished_index
        assert before is None or before.processing_vehicle in (None, status.processing_vehicle)
        self.sequences[status.name] = status


async def make(store: MemoryStore | None = None, **places: str) -> Site:
    places = places or {"V1": "A", "V2": "D"}
    fleet, clock = ScriptedFleet(places), ManualClock()
    engine = await make_engine(PLANT, store or MemoryStore(), fleet, clock=clock)
    site = Site(engine, fleet, clock)
    engine.unit_of_work.listeners.append(site)
    for name, at in places.items():
        fleet.appear(name, at)
    return site


async def test_an_order_waits_until_those_that_it_depends_on_are_finished() -> None:
    site = await make(V1="A")
    site.create("T-1")
    site.create("T-2", "A", dependencies=["T-1"], priority=9)
    assert site.order("T-2").state is S.ACTIVE
    assert site.order("T-2").reason == "waits until 'T-1' is finished"
    site.create("T-3", "C")
    site.fleet.finish("V1")
    assert site.state("T-1", "T-2", "T-3") == [S.FINISHED, S.BEING_PROCESSED, S.DISPATCHABLE]


@pytest.mark.parametrize(
    ("policy", "state", "said"),
    [
        ("FAIL", S.FAILED, "order 'T-1', on which it depends, is failed"),
        ("IGNORE", S.BEING_PROCESSED, "travels"),
        ("HOLD", S.DISPATCHABLE, "order 'T-1', on which it depends, is failed"),
    ],
)
async def test_the_policy_defines_the_effect_of_a_failed_dependency(
    policy: str, state: TransportOrderState, said: str
) -> None:
    site = await make(V1="A")
    site.create("T-1")
    site.create("T-2", "C", dependencies=["T-1"], onDependencyFailure=policy)
    site.create("T-3", "C", dependencies=["T-2"])
    site.fleet.fail("V1")
    site.engine.run_checks()
    assert (site.order("T-2").state, said in site.order("T-2").reason) == (state, True)
    assert site.order("T-2").held is None or policy == "HOLD"
    assert site.order("T-3").state is (S.FAILED if policy == "FAIL" else S.ACTIVE)


async def test_a_resumed_order_still_waits_and_reports_why() -> None:
    site = await make(V1="A")
    site.create("T-1")
    site.create("T-2", "C", dependencies=["T-1"])
    number = site.engine.state.orders.last_number
    site.engine.hold(number, "a person", "wait")
    assert site.order("T-2").reason.startswith("held by a person")
    site.engine.resume(number, "a person", "go")
    assert site.order("T-2").reason == "waits until 'T-1' is finished"
    site.engine.hold(number, "a person", "wait")
    site.fleet.finish("V1")
    assert (site.order("T-2").state, site.order("T-2").reason[:4]) == (S.DISPATCHABLE, "held")
    site.engine.resume(number, "a person", "go")
    assert site.order("T-2").state is S.BEING_PROCESSED


async def test_a_dependency_that_ended_long_ago_is_evaluated_at_once() -> None:
    site = await make(V1="A")
    site.engine.create(request("B", dependencies=["Old"]), "T-1", {"Old": OrderOutcome.FINISHED})
    site.engine.create(request("B", dependencies=["Old"]), "T-2", {"Old": OrderOutcome.FAILED})
    assert site.state("T-1", "T-2") == [S.BEING_PROCESSED, S.FAILED]


async def test_what_a_withdrawal_takes_along_is_withdrawn_and_has_not_failed() -> None:
    """Otherwise the orders behind one that a person withdrew are red, alarm, and count as failures."""
    site = await make()
    site.sequence(failureFatal=True)
    for name in ("T-1", "T-2"):
        site.create(name, wrappingSequence="S")
    site.create("T-3", dependencies=["T-2"])
    site.create("T-4", dependencies=["T-3"])
    first = site.engine.state.orders.named("T-1")
    assert first
    site.engine.withdraw(first.number, "a person")
    site.fleet.finish("V1")
    ends = [(site.order(name).state, site.order(name).outcome) for name in ("T-1", "T-2", "T-3", "T-4")]
    assert ends == [(S.FAILED, OrderOutcome.WITHDRAWN)] * 4
    assert site.order("T-3").reason == "order 'T-2', on which it depends, is withdrawn"
    site.engine.create(request("B", dependencies=["Old"]), "T-5", {"Old": OrderOutcome.WITHDRAWN})
    assert site.order("T-5").outcome is OrderOutcome.WITHDRAWN


async def test_orders_of_a_sequence_are_executed_in_order_by_one_vehicle() -> None:
    site = await make()
    site.sequence()
    for number, stop in enumerate("BDB"):
        site.create(f"T-{number}", stop, wrappingSequence="S", priority=number)
    site.create("other", "Q")
    assert site.state("T-0", "T-1", "T-2", "other") == [
        S.BEING_PROCESSED,
        S.ACTIVE,
        S.ACTIVE,
        S.BEING_PROCESSED,
    ]
    assert site.order("T-2").reason == "waits for its turn in order sequence 'S', after 'T-0'"
    assert site.sequence_status().processing_vehicle == "V1"
    site.fleet.finish("V2")

    for number in range(3):
        assert site.order(f"T-{number}").processing_vehicle == "V1"
        while not site.fleet.finish("V1"):
            site.fleet.finish("V2")
        assert site.sequence_status().finished_index == number
    assert site.vehicle("V1").processing_state is ProcessingState.AWAITING_ORDER
    assert site.vehicle("V1").order_sequence == "S"
    assert "waits for the next order of order sequence 'S'" in site.vehicle("V1").reason

    site.create("late", "A", intendedVehicle="V1")
    assert site.order("late").reason.startswith("waits for robot 'V1', which is bound to order sequence 'S'")
    site.complete()
    assert site.sequence_status().finished
    assert site.order("late").state is S.BEING_PROCESSED


@pytest.mark.parametrize(
    ("fatal", "dispensable", "goes_on"), [(True, False, False), (False, False, True), (True, True, True)]
)
async def test_a_failure_ends_a_sequence_where_it_is_fatal(
    *, fatal: bool, dispensable: bool, goes_on: bool
) -> None:
    site = await make(V1="A")
    site.sequence(failureFatal=fatal)
    site.create("T-0", wrappingSequence="S", dispensable=dispensable)
    site.create("T-1", "C", wrappingSequence="S")
    site.create("T-2", "C", dependencies=["T-1"])
    site.fleet.fail("V1")
    told = site.sequence_status()
    if goes_on:
        assert site.state("T-0", "T-1") == [S.FAILED, S.BEING_PROCESSED]
        assert (told.finished_index, told.complete) == (0, False)
    else:
        assert site.state("T-0", "T-1", "T-2") == [S.FAILED, S.FAILED, S.FAILED]
        assert site.order("T-1").reason.startswith("order 'T-0' of its sequence 'S' is failed: wheel lost")
        assert (told.finished_index, told.complete, told.finished) == (1, True, True)
        assert site.vehicle("V1").order_sequence is None


async def test_a_sequence_keeps_its_vehicle_whatever_the_failure_policy_says() -> None:
    site = await make()
    site.sequence()
    site.create("T-0", "B", wrappingSequence="S", onFailure=[{"do": "OTHER_VEHICLE"}])
    site.fleet.fail("V1")
    assert site.order("T-0").state is S.FAILED
    assert "there is no other suitable robot" in site.order("T-0").reason


async def test_a_sequence_is_for_its_intended_vehicle_only() -> None:
    site = await make(V1="A", V2="C")
    site.sequence(intendedVehicle="V2")
    site.create("T-0", "B", wrappingSequence="S")
    assert site.order("T-0").processing_vehicle == "V2"


async def test_sequence_and_dependencies_continue_after_a_restart() -> None:
    store = MemoryStore()
    site = await make(store)
    site.sequence()
    site.create("T-0", "B", wrappingSequence="S")
    site.create("T-1", "A", wrappingSequence="S")
    site.create("T-2", "Q", dependencies=["T-1"])
    site.withdraw("T-1")
    site.create("T-3", "A", wrappingSequence="S")
    site.create("T-4", "P", dependencies=["T-3"])

    again = await make(store)
    assert again.state("T-0", "T-3", "T-4") == [S.BEING_PROCESSED, S.ACTIVE, S.ACTIVE]
    assert again.order("T-4").reason == "waits until 'T-3' is finished"
    assert again.vehicle("V1").order_sequence == "S"
    again.fleet.missions.setdefault(next(iter(site.fleet.missions)), next(iter(site.fleet.missions.values())))
    again.fleet.finish("V1")
    assert again.sequence_status().finished_index == 1
    assert (again.order("T-3").processing_vehicle, again.order("T-3").state) == ("V1", S.BEING_PROCESSED)
    again.fleet.finish("V1")
    assert again.order("T-4").state is S.BEING_PROCESSED
    again.complete()
    assert again.sequence_status().finished
    assert store.found.sequences == ()


KINDS = [
    *("sequence", "order", "order", "member", "member", "member", "complete"),
    *("finish", "finish", "fail", "withdraw", "restart", "look"),
]
STEPS = st.lists(st.sampled_from(KINDS), max_size=25)


@settings(max_examples=60)
@given(STEPS, st.randoms(use_true_random=False))
def test_every_order_is_eventually_served(steps: list[str], chance: Random) -> None:
    asyncio.run(_play(steps, chance))


async def _play(steps: list[str], chance: Random) -> None:
    store = MemoryStore()
    site = await make(store)
    asked: dict[str, dict[str, Any]] = {}
    for step in steps:
        if step == "restart":
            site = await _restarted(site, store)
        else:
            _act(step, site, asked, chance)
        _check(site, asked)
    for name in tuple(site.sequences):
        site.complete(name)
    for _ in range(4 * len(asked) + 4):
        _let_go_on(site)
    _check(site, asked)
    assert {name for name in asked if name not in site.ends} == set()
    assert all(sequence.finished for sequence in site.sequences.values())


async def _restarted(site: Site, store: MemoryStore) -> Site:
    again = await make(store, **site.fleet.at)
    again.fleet.cancelled = site.fleet.cancelled
    again.ends = site.ends | again.ends  # an order may give way as soon as the vehicles are back
    again.begun = [*site.begun, *(each for each in again.begun if each not in site.begun)]
    again.sequences = site.sequences | again.sequences
    return again


def _act(step: str, site: Site, asked: dict[str, dict[str, Any]], chance: Random) -> None:
    robots = [robot.serial_number for robot in site.fleet.missions]
    if step == "sequence":
        site.sequence(f"S-{len(site.sequences)}", failureFatal=chance.random() < 0.5)
    elif step in ("order", "member"):
        _create(step, site, asked, chance)
    elif step == "complete" and site.sequences:
        site.complete(chance.choice(list(site.sequences)))
    elif step == "finish" and robots:
        site.fleet.finish(chance.choice(robots))
    elif step == "fail" and robots:
        site.fleet.fail(chance.choice(robots))
    elif step == "withdraw" and (living := [name for name in asked if name not in site.ends]):
        site.withdraw(chance.choice(living))
    elif step == "look":
        _let_go_on(site)


def _create(step: str, site: Site, asked: dict[str, dict[str, Any]], chance: Random) -> None:
    fields: dict[str, Any] = {"dispensable": chance.random() < 0.2}
    opened = [name for name, sequence in site.sequences.items() if not sequence.complete]
    earlier = list(asked)
    if step == "member" and opened:
        sequence = fields["wrappingSequence"] = chance.choice(opened)
        if len(site.sequences) > 1:  # both vehicles may be bound to sequences that wait for an order outside
            earlier = [order for order in asked if asked[order].get("wrappingSequence") == sequence]
    if earlier and chance.random() < 0.5:
        fields["dependencies"] = chance.sample(earlier, min(len(earlier), 2))
        fields["onDependencyFailure"] = chance.choice(["FAIL", "IGNORE"])
    name = f"T-{len(asked)}"
    asked[name] = fields
    site.create(name, chance.choice("ABCDPQ"), **fields)


def _let_go_on(site: Site) -> None:
    for robot in tuple(site.fleet.missions):
        if not site.fleet.finish(robot.serial_number) and robot.serial_number in site.fleet.cancelled:
            site.fleet.confirm_cancel(robot.serial_number)
    site.clock.advance(RELOCATION_PAUSE)
    site.engine.run_checks()


def _check(site: Site, asked: dict[str, dict[str, Any]]) -> None:
    begun = [name for name, _ in site.begun]
    assert len(begun) == len(set(begun)), "no order is begun by two vehicles"
    for name, _ in site.begun:
        for dependency in asked[name].get("dependencies", ()):
            end = site.ends[dependency]
            assert end.state is S.FINISHED or asked[name]["onDependencyFailure"] == "IGNORE"
    for sequence in site.sequences.values():
        vehicles = {vehicle for name, vehicle in site.begun if name in sequence.orders}
        assert vehicles <= {sequence.processing_vehicle}
        places = [sequence.orders.index(name) for name in begun if name in sequence.orders]
        assert places == sorted(places)
        ended = [name in site.ends for name in sequence.orders]
        assert sequence.finished_index == ([*ended, False].index(False)) - 1
        if sequence.failure_fatal:
            _check_fatal(site, sequence, asked)


def _check_fatal(site: Site, sequence: OrderSequenceStatus, asked: dict[str, dict[str, Any]]) -> None:
    broken = False
    for name in sequence.orders:
        end = site.ends.get(name)
        assert not broken or (end is not None and end.state is not S.FINISHED)
        badly = end is not None and end.state is not S.FINISHED
        broken |= badly and not asked[name]["dispensable"]
    assert sequence.complete or not broken
