from __future__ import annotations

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.dispatching.way import NO_WAY, WayCosts, WayFinder
from nena_order_service.routing import NoRouteError, Router
from nena_shared.fleet_api.transport_order import Coordinate, Destination
from nena_shared.plant import Link, Location, LocationType, Path, PlantModel
from support.plants import path, point

NAMES = "ABCDEF"


def made(paths: tuple[Path, ...], links: tuple[str, ...] = ()) -> tuple[WayFinder, WayCosts]:
    plant = PlantModel(
        name="made",
        points=tuple(point(name, 1000 * index) for index, name in enumerate(NAMES)),
        paths=paths,
        location_types=(LocationType(name="Station", allowed_operations=("Load",)),),
        locations=(
            Location(name="Station", type="Station", links=tuple(Link(point=each) for each in links)),
        ),
    )
    finder = WayFinder(plant, Router(plant))
    return finder, WayCosts(plant, finder)


def stops(*names: str) -> list[Destination]:
    return [
        Destination(location_name=name, operation="Load" if name == "Station" else "MOVE") for name in names
    ]


ends = st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)).filter(lambda two: two[0] != two[1])


@given(
    edges=st.dictionaries(ends, st.integers(1, 50), max_size=14),
    links=st.lists(st.sampled_from(NAMES), min_size=1, max_size=3, unique=True),
    goals=st.lists(st.sampled_from([*NAMES, "Station"]), min_size=1, max_size=3),
    avoid=st.sets(st.sampled_from(NAMES), max_size=1),
)
def test_costs_are_those_of_the_ways_that_are_found(
    edges: dict[tuple[str, str], int], links: list[str], goals: list[str], avoid: set[str]
) -> None:
    finder, costs = made(tuple(path(f"{a} {b}", cost) for (a, b), cost in edges.items()), tuple(links))
    for start in NAMES:
        found = costs.cost(start, stops(*goals), vehicle=None, avoid=avoid)
        try:
            way = finder.find(start, stops(*goals), avoid=avoid)
        except NoRouteError:
            assert found.complete == inf
        else:
            assert found.complete == pytest.approx(way.cost)
            assert found.initial <= found.complete


def test_a_coordinate_is_looked_for_and_a_lock_counts_at_once() -> None:
    finder, costs = made((path("A B", 1000), path("B C", 1000)))
    coordinate = [*stops("B"), Destination(coordinate=Coordinate(x=1.0, y=2.0))]
    assert costs.cost("A", coordinate, vehicle=None) == (3000, 1000)
    assert costs.cost("A", stops("C"), vehicle=None).complete == 2000
    finder.set_locks({"B --- C": True})
    assert costs.cost("A", stops("C"), vehicle=None) == NO_WAY
    assert costs.cost("C", coordinate, vehicle=None) == NO_WAY
