from __future__ import annotations

import asyncio

import pytest

from nena_order_service.errors import UnknownError
from nena_order_service.service import OrderService
from nena_order_service.store.database import Changes
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine, reason_of

ROW = PlantModel(
    name="row with a siding",
    points=(*(point(name, 2000 * index) for index, name in enumerate("ABCD")), point("X", 4000, 2000)),
    paths=tuple(map(path, ("A B", "B C", "C B", "C D", "C X", "X C"))),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)


async def test_lock_of_a_removed_path_is_ignored(service: OrderService) -> None:
    changes = Changes()
    known = service.engine.plant.paths[0].name
    changes.path_locks.update({"gone": True, known: True})
    service.store.commit(changes, lambda: None)
    assert await service.store.drain(30)
    await service.hosts.locks.load()
    assert [path.name for path in service.hosts.locks.all() if path.locked] == [known]
    with pytest.raises(UnknownError, match="gone"):
        service.hosts.locks.get("gone")


async def test_lock_takes_effect_only_after_the_commit(service: OrderService) -> None:
    name = service.engine.plant.paths[0].name
    locked = await service.hosts.locks.set(name, locked=True)
    assert locked.locked
    assert await service.store.read_path_locks() == {name: True}


async def test_traffic_respects_locks_also_after_a_restart(service: OrderService) -> None:
    name = service.engine.plant.paths[0].name
    crossings = service.engine.traffic.resources._crossings
    await service.hosts.locks.set(name, locked=True)
    assert crossings._locks == {name: True}

    crossings.set_locks({})
    await service.hosts.locks.load()
    assert crossings._locks == {name: True}


async def test_pending_lock_is_answered_when_the_engine_closes(service: OrderService) -> None:
    name = service.engine.plant.paths[0].name

    async def close() -> None:
        service.engine.close("the plant model is being changed")

    locked, _ = await asyncio.gather(service.hosts.locks.set(name, locked=True), close())
    assert locked.locked
    assert await service.store.read_path_locks() == {name: True}


async def test_who_waits_for_a_locked_path_makes_room_for_orders_that_have_a_way() -> None:
    fleet = ScriptedFleet({})
    engine = await make_engine(ROW, MemoryStore(), fleet, release_ahead=1)
    fleet.appear("V1", "A")
    fleet.appear("V2", "B")
    engine.create(request("D", intendedVehicle="V2"), "far")
    engine.context.finder.set_locks({"C --- D": True})
    engine.plant_changed()
    assert fleet.finish("V2")
    assert fleet.at["V2"] == "C"
    assert "'C --- D' is unlocked" in reason_of(engine, "V2")

    engine.create(request("C", intendedVehicle="V1"), "near")

    name, makes_room = fleet.sent[-1]
    assert (name, [node.node_id for node in makes_room.nodes]) == ("V2", ["C", "X"])
    while not fleet.finish("V2"):
        engine.run_checks()
    assert "'C --- D' is unlocked" in reason_of(engine, "V2")
    assert fleet.sent[-1][0] == "V1"
    while not fleet.finish("V1"):
        engine.run_checks()
    near = engine.state.orders.named("near")
    assert near
    assert near.state is TransportOrderState.FINISHED
    engine.create(request("B", intendedVehicle="V1"), "back")
    engine.context.finder.set_locks({})
    engine.plant_changed()
    while not fleet.finish("V1"):
        engine.run_checks()
    name, goes_on = fleet.sent[-1]
    assert (name, [node.node_id for node in goes_on.nodes]) == ("V2", ["X", "C", "D"])
