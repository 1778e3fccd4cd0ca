"""What robots tell of missions, for orders that are withdrawn."""

from __future__ import annotations

from nena_order_service.kernel import Kernel
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_kernel

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABC")),
    paths=(path("A B"), path("B C")),
    vehicles=(Vehicle(name="V1"),),
)


async def make() -> tuple[Kernel, ScriptedFleet, int]:
    fleet = ScriptedFleet({"V1": "A"})
    kernel = await make_kernel(PLANT, MemoryStore(), fleet)
    return kernel, fleet, kernel.create(request("C", onFailure=[{"do": "RETRY", "times": 9}]), "T").number


def reason(kernel: Kernel, number: int) -> str:
    order = kernel.book.visible(number)
    assert order
    return f"{order.state}: {order.status.reason}"


async def test_an_immediate_withdrawal_counts_after_a_gentle_one() -> None:
    kernel, fleet, number = await make()
    kernel.withdraw(number, "not wanted", immediate=False)
    assert fleet.cancelled == []
    kernel.withdraw(number, "at once")
    kernel.withdraw(number, "at once")
    assert fleet.cancelled == ["V1"]
    fleet.confirm_cancel("V1")

    assert reason(kernel, number) == "FAILED: withdrawn: not wanted; the vehicle has let it go"


async def test_a_failure_of_a_withdrawn_order_is_tried_no_more() -> None:
    kernel, fleet, number = await make()
    kernel.withdraw(number, "not wanted")
    fleet.fail("V1")

    assert reason(kernel, number) == "FAILED: withdrawn: not wanted; wheel lost: FATAL wheel"
    assert len(fleet.sent) == 1


async def test_a_mission_that_was_done_all_the_same_ends_a_withdrawn_order() -> None:
    kernel, fleet, number = await make()
    kernel.withdraw(number, "not wanted")
    fleet.finish("V1")

    assert reason(kernel, number).endswith("not wanted; the vehicle had done what it had been sent")
