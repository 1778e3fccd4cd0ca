"""An exception at any step of an order: nothing of that step happens, and a restart completes the order."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import pytest

from nena_order_service.engine.engine import Engine
from nena_order_service.engine.state import Drives, FleetState, VehicleRecords
from nena_order_service.fleet.outputs import NodePassed, RobotChanged, VdaOrderFinished
from nena_order_service.store.database import Changes
from nena_shared.fleet_api.transport_order import (
    OrderSequenceStatus,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.plant import Link, Location, LocationType, PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, key, make_engine, sent

PLANT = PlantModel(
    name="ring",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCD")),
    paths=(path("A B"), path("B C"), path("C D"), path("D A")),
    vehicles=(Vehicle(name="V1"),),
    location_types=(LocationType(name="T", allowed_operations=("Load",)),),
    locations=(Location(name="L", type="T", links=(Link(point="C"),)),),
)


class ProvokedError(Exception):
    """What the test makes fail."""


@dataclass
class Fault:
    """Fails once: at a change that a unit of work records, or when its VDA order is sent."""

    at: int
    """Number of the change, from 1."""
    count: int = 0
    armed: bool = False

    def install(self, monkeypatch: pytest.MonkeyPatch) -> None:
        for owner, name in (
            (Changes, "put_order"),
            (Drives, "put"),
            (Drives, "end"),
            (VehicleRecords, "change"),
            (FleetState, "after_commit"),
            (FleetState, "vehicle_changed"),
            (ScriptedFleet, "start_vda_order"),
        ):
            monkeypatch.setattr(owner, name, self._counted(getattr(owner, name)))

    def _counted(self, change: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*values: Any, **more: Any) -> Any:
            self.count += self.armed
            if self.armed and self.count == self.at:
                raise ProvokedError
            return change(*values, **more)

        return counted


@dataclass
class Told:
    """What hosts are told."""

    statuses: list[object] = field(default_factory=list)

    def order_changed(self, status: TransportOrderStatus) -> None:
        self.statuses.append(status)

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        self.statuses.append(status)

    def vehicle_changed(self, status: VehicleStatus) -> None:
        self.statuses.append(status)


def reach(fleet: ScriptedFleet) -> None:
    """Report that the robot has reached the second node."""
    assert fleet.engine is not None
    vda_order = fleet.missions[key("V1")]
    node = vda_order.nodes[1]
    fleet.at["V1"] = node.node_id
    passed = NodePassed(key("V1"), vda_order.order_id, node.node_id, node.sequence_id)
    fleet.engine.on_events(passed, RobotChanged(key("V1")))


def finish(fleet: ScriptedFleet) -> None:
    """Report the end of the robot's VDA order, and that it stands there."""
    assert fleet.engine is not None
    vda_order = fleet.missions.pop(key("V1"))
    fleet.at["V1"] = vda_order.nodes[-1].node_id
    fleet.engine.on_events(VdaOrderFinished(key("V1"), vda_order.order_id), RobotChanged(key("V1")))


STEPS: tuple[tuple[str, Callable[[Engine, ScriptedFleet], object]], ...] = (
    ("created, dispatched, routed and sent", lambda engine, _: engine.create(request("L:Load", "A"), "T")),
    ("accepted", lambda _, fleet: fleet.accept("V1")),
    ("reached", lambda _, fleet: reach(fleet)),
    ("first drive ended", lambda _, fleet: finish(fleet)),
    ("second drive accepted", lambda _, fleet: fleet.accept("V1")),
    ("ended", lambda _, fleet: finish(fleet)),
)


async def go_through(store: MemoryStore, fault: Fault) -> tuple[list[str], ScriptedFleet]:
    """Perform all steps; return those that failed. After each of these, the engine is built again."""
    fleet, told = ScriptedFleet({"V1": "A"}), Told()
    engine = await make_engine(PLANT, store, fleet)
    engine.unit_of_work.listeners.append(told)
    engine.unit_of_work.vehicle_listeners.append(told)
    failed = []
    for name, step in STEPS:
        at, commits, robot_has = dict(fleet.at), store.commits, dict(fleet.missions)
        outside = store.found, list(fleet.sent), list(told.statuses)
        fault.armed = True
        with suppress(ProvokedError):
            step(engine, fleet)
        fault.armed = False
        if not engine.unit_of_work.failed.is_set():
            continue
        failed.append(name)
        is_committed = store.commits > commits
        if not is_committed:
            assert (store.found, fleet.sent, told.statuses) == outside
            fleet.at, fleet.missions = at, robot_has
        engine = await make_engine(PLANT, store, fleet)
        engine.unit_of_work.listeners.append(told)
        engine.unit_of_work.vehicle_listeners.append(told)
        if not is_committed:
            step(engine, fleet)  # the robot reports again, and the host requests again
    return failed, fleet


@pytest.mark.provokes_failures
async def test_an_exception_at_any_change_of_an_order_leaves_no_half_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    failed_at: set[str] = set()
    number, done = 0, False
    while not done:
        number += 1
        store, fault = MemoryStore(), Fault(at=number)
        with monkeypatch.context() as patched:
            fault.install(patched)
            failed, fleet = await go_through(store, fault)
        done = fault.count < number
        failed_at.update(failed)
        assert len(failed) == (not done), number
        assert not store.found.orders, f"the order has not ended after a failure at change {number}"
        assert not store.found.drives
        assert not fleet.missions
        has_been_sent = {order_id for _, order_id in sent(fleet)} | {each[1] for each in fleet.adopted}
        assert has_been_sent == {"T-0", "T-1"}, number
        assert len(sent(fleet)) == len(set(sent(fleet))), "no VDA order is sent twice"
    assert failed_at == {name for name, _ in STEPS}
