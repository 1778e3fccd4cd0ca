"""The cheapest assignment, held against all that there are."""

from __future__ import annotations

from itertools import combinations, permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.dispatching.dispatcher import assign_vehicles

COSTS = st.dictionaries(st.sampled_from(["a", "b", "c", "d"]), st.integers(0, 9), max_size=4)
LEVELS = st.lists(st.lists(COSTS, max_size=3), max_size=3)

Level = dict[int, dict[str, int]]


def numbered(levels: list[list[dict[str, int]]]) -> list[Level]:
    """Number the orders through all levels."""
    numbers = iter(range(1, 100))
    return [{next(numbers): costs for costs in level} for level in levels]


def best(orders: Level) -> tuple[int, int]:
    """Return how many orders can be served at the most, and what that costs at the least: by trying all."""
    for size in range(min(len(orders), 4), 0, -1):
        costs = [
            sum(orders[number][vehicle] for number, vehicle in zip(served, vehicles, strict=True))
            for served in combinations(orders, size)
            for vehicles in permutations("abcd", size)
            if all(vehicle in orders[number] for number, vehicle in zip(served, vehicles, strict=True))
        ]
        if costs:
            return size, min(costs)
    return 0, 0


def greedy(levels: list[Level]) -> dict[int, str]:
    """Assign to each order in turn the cheapest remaining vehicle."""
    taken: dict[int, str] = {}
    for number, costs in (pair for level in levels for pair in level.items()):
        left = {vehicle: cost for vehicle, cost in costs.items() if vehicle not in taken.values()}
        if left:
            taken[number] = min(left, key=left.__getitem__)
    return taken


@given(LEVELS)
def test_each_level_is_served_as_far_as_possible_at_minimum_cost(
    told: list[list[dict[str, int]]],
) -> None:
    levels = numbered(told)
    found = assign_vehicles(levels)
    every = {number: costs for level in levels for number, costs in level.items()}
    assert len(set(found.values())) == len(found)
    assert all(vehicle in every[number] for number, vehicle in found.items())
    if levels:
        assert len(found.keys() & levels[0].keys()) == best(levels[0])[0]
    served = {number: every[number] for number in found}
    assert best(served) == (len(found), sum(every[number][vehicle] for number, vehicle in found.items()))


@given(st.lists(COSTS, max_size=5))
def test_orders_of_one_level_never_cost_more_than_when_each_chooses_in_turn(
    told: list[dict[str, int]],
) -> None:
    levels = numbered([told])
    found, chosen = assign_vehicles(levels), greedy(levels)
    assert len(found) >= len(chosen)
    if len(found) == len(chosen):
        cost = {
            name: sum(levels[0][n][v] for n, v in pairs.items())
            for name, pairs in (("found", found), ("chosen", chosen))
        }
        assert cost["found"] <= cost["chosen"]


@given(LEVELS)
def test_no_order_waits_for_a_vehicle_that_one_of_a_later_level_has(
    told: list[list[dict[str, int]]],
) -> None:
    levels = numbered(told)
    found = assign_vehicles(levels)
    for place, level in enumerate(levels):
        later = {number for behind in levels[place + 1 :] for number in behind}
        for number in level.keys() - found.keys():
            assert not {found[each] for each in later & found.keys()} & level[number].keys()


@pytest.mark.parametrize(
    ("levels", "expected"),
    [
        ([], {}),
        ([{1: {}}], {}),
        ([{1: {"a": 1, "b": 2}, 2: {"a": 1, "b": 9}}], {1: "b", 2: "a"}),
        ([{1: {"a": 1, "b": 2}, 2: {"a": 1, "b": 2}}], {1: "a", 2: "b"}),
        ([{1: {"a": 9}, 2: {"a": 1}}], {2: "a"}),
        ([{1: {"a": 9}}, {2: {"a": 1}}], {1: "a"}),
    ],
    ids=["nothing", "no way", "least in all", "the first one keeps the nearer", "the nearer", "the urgent"],
)
def test_assignment(levels: list[Level], expected: dict[int, str]) -> None:
    assert assign_vehicles(levels) == expected
