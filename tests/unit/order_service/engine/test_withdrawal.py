"""Robots' reports about VDA orders, for orders that are withdrawn."""

from __future__ import annotations

from nena_order_service.engine.engine import Engine
from nena_shared.fleet_api.transport_order import OrderOutcome
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABC")),
    paths=(path("A B"), path("B C")),
    vehicles=(Vehicle(name="V1"),),
)


async def make() -> tuple[Engine, ScriptedFleet, int]:
    fleet = ScriptedFleet({"V1": "A"})
    engine = await make_engine(PLANT, MemoryStore(), fleet)
    return engine, fleet, engine.create(request("C", onFailure=[{"do": "RETRY", "times": 9}]), "T").number


def reason(engine: Engine, number: int) -> str:
    order = engine.state.orders.visible(number)
    assert order
    return f"{order.state}: {order.status.reason}"


def outcome(engine: Engine, number: int) -> OrderOutcome | None:
    order = engine.state.orders.visible(number)
    assert order
    return order.status.outcome


async def test_an_immediate_withdrawal_overrides_a_gentle_one() -> None:
    engine, fleet, number = await make()
    engine.withdraw(number, "not wanted", immediate=False)
    assert fleet.cancelled == []
    engine.withdraw(number, "at once")
    engine.withdraw(number, "at once")
    assert fleet.cancelled == ["V1"]
    fleet.confirm_cancel("V1")

    assert reason(engine, number) == "FAILED: withdrawn: not wanted; the robot has released it"
    assert outcome(engine, number) is OrderOutcome.WITHDRAWN


async def test_a_failed_withdrawn_order_is_not_retried() -> None:
    engine, fleet, number = await make()
    engine.withdraw(number, "not wanted")
    fleet.fail("V1")

    assert reason(engine, number) == "FAILED: withdrawn: not wanted; wheel lost: FATAL wheel"
    assert outcome(engine, number) is OrderOutcome.WITHDRAWN, "the robot's failure is told by the robot"
    assert len(fleet.sent) == 1


async def test_a_vda_order_that_finished_anyway_ends_a_withdrawn_order() -> None:
    engine, fleet, number = await make()
    engine.withdraw(number, "not wanted")
    fleet.finish("V1")

    assert reason(engine, number).endswith("not wanted; the robot had finished its base")
