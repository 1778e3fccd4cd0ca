"""Which resources each step needs, with its blocks."""

from __future__ import annotations

from collections import Counter, deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.routing.router import Router
from nena_order_service.traffic.resources import (
    DeviceUse,
    Found,
    OccupancyFinder,
    Occupant,
    Resources,
    ResourceSet,
    UseIndex,
    covered_from,
)
from nena_shared.plant import PlantModel
from nena_shared.plant.model import Block, BlockType
from nena_shared.plant.track import BoundingBox, PeripheralOperation
from nena_shared.plant_terms import ExecutionTrigger
from support.plants import path, plant, point


def sets(model: PlantModel, start: str, end: str, location: str | None = None) -> list[ResourceSet]:
    resources = Resources(model)
    route = Router(model).route(start, end)
    return list(
        resources.along_steps(
            route.steps, start=resources.at_point(start), at_goal=(location,) if location else ()
        )
    )


def test_a_vehicle_needs_a_door_from_the_path_that_opens_it_to_the_one_that_closes_it() -> None:
    def operation(name: str, trigger: ExecutionTrigger, *, required: bool) -> PeripheralOperation:
        return PeripheralOperation(
            name=name, location="Door", execution_trigger=trigger, completion_required=required
        )

    opening = operation("open", ExecutionTrigger.AFTER_ALLOCATION, required=True)
    closing = operation("close", ExecutionTrigger.AFTER_MOVEMENT, required=False)
    paths = (
        path("A B", peripheral_operations=(opening,)),
        path("B C"),
        path("C D", peripheral_operations=(closing,)),
        path("D E"),
    )
    use = DeviceUse(plant(*paths))

    assert use.needed_along([each.name for each in paths]) == {0: ["Door"], 1: ["Door"], 2: ["Door"]}
    assert use.needed_along([each.name for each in paths[1:]]) == {1: ["Door"]}
    assert use.needed_along([each.name for each in paths[1:]], held=("Door", "B")) == {
        0: ["Door"],
        1: ["Door"],
    }
    assert DeviceUse(None).needed_along([each.name for each in paths]) == {}
    unheeded = path("A B", peripheral_operations=(closing,))
    assert DeviceUse(plant(unheeded)).names == frozenset()


def test_a_step_needs_its_path_and_the_point_at_its_end() -> None:
    model = plant(path("A B", 700), path("B C", 900))

    assert sets(model, "A", "C") == [
        ResourceSet("B", 700, {"A --- B": None, "B": None}),
        ResourceSet("C", 900, {"B --- C": None, "C": None}),
    ]


def test_the_location_belongs_to_the_last_step() -> None:
    first, last = sets(plant(path("A B"), path("B C")), "A", "C", location="Shelf")

    assert "Shelf" not in first.uses
    assert last.uses["Shelf"] is None


def test_a_block_is_needed_by_each_step_into_it_and_by_a_vehicle_inside() -> None:
    block = Block(name="Crossing", members=("B",))
    model = plant(path("A B"), path("B C"), blocks=(block,))

    first, last = sets(model, "A", "C")

    assert first.uses["Crossing"] is None
    assert "Crossing" not in last.uses
    assert Resources(model).at_point("B").uses == {"B": None, "Crossing": None}


def test_a_vehicle_keeps_its_entry_direction_in_a_same_direction_block() -> None:
    block = Block(name="Aisle", type=BlockType.SAME_DIRECTION_ONLY, members=("A --- B", "B --- C", "D"))
    model = plant(
        path("A B", properties={"tcs:blockEntryDirection": "north"}),
        path("B C"),
        path("C D"),
        blocks=(block,),
    )

    first, second, third = sets(model, "A", "D")

    assert first.uses["Aisle"] == "north"
    assert second.uses["Aisle"] == "north"
    assert third.uses["Aisle"] == "north"


def test_without_the_property_the_edge_defines_the_direction() -> None:
    block = Block(name="Aisle", type=BlockType.SAME_DIRECTION_ONLY, members=("A --- B",))
    model = plant(path("A B", max_reverse_velocity_mm_s=1000), blocks=(block,))

    assert sets(model, "A", "B")[0].uses["Aisle"] == "A --- B"
    assert sets(model, "B", "A")[0].uses["Aisle"] == "A --- B:backward"


def test_others_are_vehicles_that_cannot_share() -> None:
    index = UseIndex()
    index.add("a", {"x": None, "aisle": "north"})
    index.add("b", {"aisle": "north"})

    assert set(index.other_users("c", {"x": None})) == {("a", "x")}
    assert set(index.other_users("c", {"aisle": "north"})) == set()
    assert set(index.other_users("c", {"aisle": "south"})) == {("a", "aisle"), ("b", "aisle")}
    assert set(index.other_users("c", {"aisle": None})) == {("a", "aisle"), ("b", "aisle")}
    assert set(index.other_users("a", {"x": None})) == set()
    assert index.users_of("aisle") == {"a", "b"}


USES = st.dictionaries(st.sampled_from("xyz"), st.sampled_from([None, "n", "s"]), min_size=1)


@given(st.lists(st.tuples(st.sampled_from("ab"), USES), max_size=12))
def test_a_resource_is_used_until_every_use_is_removed(
    uses: list[tuple[str, dict[str, str | None]]],
) -> None:
    index, left = UseIndex(), Counter[tuple[str, str]]()
    for vehicle, each in uses:
        index.add(vehicle, each)
        left.update((vehicle, resource) for resource in each)
    for vehicle, each in reversed(uses):
        index.remove(vehicle, each)
        left.subtract((vehicle, resource) for resource in each)
        for resource in "xyz":
            assert index.users_of(resource) == {who for who in "ab" if left[who, resource]}


WAY = [
    ResourceSet(name, length, {name: None})
    for name, length in [("A", 0), ("B", 1000), ("C", 400), ("D", 700)]
]


@pytest.mark.parametrize(
    ("length_mm", "first"),
    [(0, 3), (700, 3), (701, 2), (1100, 2), (1101, 1), (2100, 1), (2101, 0), (9999, 0)],
)
def test_sets_that_a_vehicle_at_the_last_point_covers(length_mm: int, first: int) -> None:
    assert covered_from(WAY, 3, length_mm) == first


def state(occupant: Occupant) -> tuple[str, int, bool]:
    return occupant.point, occupant.ahead, occupant.resting


def test_resources_behind_the_tail_are_freed_and_those_ahead_kept() -> None:
    occupant = Occupant("v", 500, deque(WAY))

    assert occupant.arrive(1) == [WAY[0]]
    assert state(occupant) == ("B", 2, False)
    assert occupant.arrive(1) == []
    assert state(occupant) == ("C", 1, False)
    assert occupant.arrive(2) == WAY[1:3]
    assert state(occupant) == ("D", 0, True)


def test_a_vehicle_with_a_claim_does_not_rest() -> None:
    occupant = Occupant("v", 0, deque(WAY[:1]))
    occupant.claimed.extend(WAY[1:])

    assert state(occupant) == ("A", 0, False)
    assert occupant.at_end(occupant.claimed) == WAY[3:]


PLANT = PlantModel(
    name="corner",
    points=(
        point("A"),
        point("B", 4000),
        point("C", 4000, 3000),
        point("far", 0, 50_000),
        point("above", 0, 0, properties={"vda5050:mapId": "upstairs"}),
    ),
    paths=(path("A B", 4000), path("B C", 3000)),
    blocks=(Block(name="corner", members=("B",)),),
)


def under(found: Found, length_mm: int = 1000) -> set[str]:
    footings = OccupancyFinder(PLANT, Resources(PLANT))
    return set(footings.find_occupied(found, BoundingBox(length_mm=length_mm)).under.uses)


@pytest.mark.parametrize(
    ("found", "length_mm", "expected"),
    [
        (Found("A", on_point=True), 1000, {"A"}),
        (Found("B", on_point=True, place_mm=(3900.0, 0.0), map_id="hall"), 1000, {"B", "corner"}),
        (Found("A", on_point=True, place_mm=(0.0, 0.0), map_id="hall"), 8200, {"A", "B", "corner"}),
        (Found("A", on_point=False, place_mm=(1500.0, 300.0), map_id="hall"), 1000, {"A --- B"}),
        (
            Found("B", on_point=False, place_mm=(3700.0, 200.0), map_id="hall"),
            1000,
            {"A --- B", "B --- C", "B", "corner"},
        ),
        (Found("far", on_point=False, place_mm=(9000.0, 40_000.0), map_id="hall"), 1000, set()),
    ],
    ids=["as it says", "on a point", "long", "on a path", "near a corner", "off the plant"],
)
def test_resources_under_a_vehicle(found: Found, length_mm: int, expected: set[str]) -> None:
    assert under(found, length_mm) == expected


def test_a_vehicle_beside_its_point_needs_the_point_as_entry() -> None:
    footings = OccupancyFinder(PLANT, Resources(PLANT))

    beside = footings.find_occupied(Found("B", on_point=False, place_mm=(4000.0, 700.0)), BoundingBox())
    on_it = footings.find_occupied(Found("B", on_point=True, place_mm=(4000.0, 100.0)), BoundingBox())

    assert on_it.entry is None
    assert beside.entry is not None
    assert (beside.entry.point, beside.entry.length_mm) == ("B", 700)
    assert set(beside.entry.uses) == {"B", "corner"}


def test_the_reference_point_may_be_far_from_the_middle() -> None:
    footings = OccupancyFinder(PLANT, Resources(PLANT))
    box = BoundingBox(length_mm=1000, reference_offset_x_mm=3600)

    found = footings.find_occupied(Found("A", on_point=True, place_mm=(0.0, 0.0), map_id="hall"), box)

    assert set(found.under.uses) == {"A", "B", "corner"}
