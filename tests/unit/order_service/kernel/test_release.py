"""How much of its way a robot is given at a time."""

from __future__ import annotations

import pytest

from nena_order_service.fleet import Mission
from nena_order_service.kernel import Kernel
from nena_order_service.kernel.mission_record import MissionRecord
from nena_order_service.kernel.release import ReleasePolicy, as_released
from nena_shared.plant import PlantModel, Vehicle
from support.fleet import make_mission
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, key, make_kernel

pytestmark = pytest.mark.clause("6.1.2/fleet", "6.6.3/fleet")

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDE")),
    paths=(path("A B"), path("B C"), path("C D"), path("D E")),
    vehicles=(Vehicle(name="V1"),),
)


def base(mission: Mission) -> list[str]:
    return [node.node_id for node in mission.nodes if node.released]


async def under_way(store: MemoryStore, fleet: ScriptedFleet, ahead: int) -> Kernel:
    kernel = await make_kernel(PLANT, store, fleet, release_ahead=ahead)
    fleet.appear("V1", "A")
    kernel.create(request("E", name="T-1"), "T-1")
    return kernel


async def test_without_a_policy_the_whole_way_is_the_base() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    await under_way(store, fleet, 0)
    fleet.pass_node("V1", 0)
    fleet.want_base("V1")

    assert [base(mission) for _, mission in fleet.sent] == [["A", "B", "C", "D", "E"]]
    assert fleet.extended == []


async def test_so_many_nodes_are_released_ahead_of_the_robot() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    await under_way(store, fleet, 2)
    assert [base(mission) for _, mission in fleet.sent] == [["A", "B", "C"]]
    assert len(fleet.sent[0][1].nodes) == 5

    for index in range(4):
        fleet.pass_node("V1", index)

    assert [base(mission) for _, mission in fleet.extended] == [
        ["A", "B", "C", "D"],
        ["A", "B", "C", "D", "E"],
    ]


async def test_a_robot_that_wants_more_before_gets_more() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    await under_way(store, fleet, 1)

    fleet.want_base("V1")

    assert [base(mission) for _, mission in fleet.extended] == [["A", "B", "C"]]


async def test_a_withdrawn_order_is_given_no_more() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    kernel = await under_way(store, fleet, 1)
    (number,) = [order.number for order in store.found.orders]
    kernel.withdraw(number, "no longer wanted")

    fleet.pass_node("V1", 1)
    fleet.want_base("V1")

    assert fleet.extended == []


async def test_after_a_restart_the_robot_goes_on_with_what_it_was_given() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    await under_way(store, fleet, 1)
    fleet.pass_node("V1", 1)
    fleet.pass_node("V1", 2)
    again = ScriptedFleet({"V1": "C"})

    await make_kernel(PLANT, store, again, release_ahead=1)
    assert base(again.missions[key("V1")]) == ["A", "B", "C", "D"]
    assert again.updates == {"V1": 2}
    again.pass_node("V1", 3)

    assert [base(mission) for _, mission in again.extended] == [["A", "B", "C", "D", "E"]]


def test_nothing_is_committed_that_is_not_sent_and_the_other_way_round() -> None:
    record = MissionRecord.of(key("V1"), make_mission("m", *"ABCDE"), 0)
    policy = ReleasePolicy(1)
    first = policy.first(record)

    assert policy.after_node(first, 0) is None
    more = policy.after_node(first, 2)
    assert more is not None
    assert (more.released_to, more.update_id) == (4, 1)
    assert base(as_released(more)) == ["A", "B", "C"]
    assert policy.when_wanted(more.model_copy(update={"released_to": 8})) is None
    assert MissionRecord.model_validate_json(more.document()) == more
