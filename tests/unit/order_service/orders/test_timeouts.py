"""Orders that are not done in time."""

from __future__ import annotations

from nena_order_service.kernel import Kernel
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_kernel, status_of

S = TransportOrderState

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("AB")),
    paths=(path("A B"),),
    vehicles=(Vehicle(name="V1"),),
)


async def make(store: MemoryStore) -> tuple[Kernel, ScriptedFleet]:
    fleet = ScriptedFleet({"V1": "A"})
    return await make_kernel(PLANT, store, fleet), fleet


def later(kernel: Kernel, seconds: float) -> None:
    kernel.clock.advance(seconds)  # type: ignore[attr-defined] # the clock of make_kernel
    kernel.look()


async def test_an_order_that_takes_too_long_is_cancelled_at_the_robot() -> None:
    kernel, fleet = await make(MemoryStore())
    kernel.create(request("B", timeout=60), "T")
    later(kernel, 59)
    assert (status_of(kernel).state, fleet.cancelled) == (S.BEING_PROCESSED, [])
    later(kernel, 1)
    assert (status_of(kernel).state, fleet.cancelled) == (S.WITHDRAWN, ["V1"])
    later(kernel, 5)
    assert fleet.cancelled == ["V1"]
    fleet.confirm_cancel("V1")
    assert status_of(kernel).state is S.FAILED
    assert status_of(kernel).reason == (
        "withdrawn: time-out: it was not done within 60 s of its creation; the vehicle has let it go"
    )


async def test_an_order_that_nobody_begins_fails_at_once() -> None:
    kernel, fleet = await make(MemoryStore())
    fleet.out_of_order.add("V1")
    kernel.create(request("B", timeout=60), "T")
    later(kernel, 61)
    assert status_of(kernel).reason == "time-out: it was not done within 60 s of its creation"


async def test_the_time_of_processing_begins_with_the_first_vehicle_and_outlives_a_restart() -> None:
    store = MemoryStore()
    kernel, fleet = await make(store)
    fleet.out_of_order.add("V1")
    kernel.create(request("B", processingTimeout=60), "T")
    later(kernel, 100)
    fleet.out_of_order.clear()
    later(kernel, 0)
    assert status_of(kernel).state is S.BEING_PROCESSED

    again, fleet = await make(store)
    later(again, 100)
    later(again, 60)
    assert fleet.cancelled == ["V1"]
    fleet.confirm_cancel("V1")
    assert "within 60 s of when a vehicle got it" in status_of(again).reason


async def test_what_is_done_in_time_is_left_alone() -> None:
    kernel, fleet = await make(MemoryStore())
    kernel.create(request("B", timeout=60), "T")
    fleet.finish("V1")
    later(kernel, 100)
    assert status_of(kernel).state is S.FINISHED


async def test_a_gentle_withdrawal_becomes_an_immediate_one_in_time() -> None:
    kernel, fleet = await make(MemoryStore())
    order = kernel.create(request("B", timeout=60), "T")
    kernel.withdraw(order.number, "not wanted", immediate=False)
    assert fleet.cancelled == []
    later(kernel, 60)
    assert fleet.cancelled == ["V1"]
