"""What holds for every plant: checked against a slow search that tries everything."""

from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise, product
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.routing.graph import CostEvaluator, NoRouteError, RoutingProfile, distance
from nena_order_service.routing.router import Router
from nena_shared.plant import BACKWARD_SUFFIX, DirectedEdge, PlantModel, Vehicle
from nena_shared.plant.track import VehicleTypeAtPoint, VehicleTypeOnPath
from support.plants import path, point

NAMES = "ABCDEF"


@st.composite
def plants(draw: st.DrawFn) -> PlantModel:
    """Draw up to 6 points and up to 14 paths, also parallel ones, loops, locked and reversible ones."""
    count = draw(st.integers(0, 14))
    types = st.lists(st.sampled_from("tu"), unique=True)
    paths = [
        path(
            f"{draw(st.sampled_from(NAMES))} {draw(st.sampled_from(NAMES))}",
            draw(st.integers(1, 50)),
            name=f"path {number}",
            max_velocity_mm_s=draw(st.sampled_from([0, 1000])),
            max_reverse_velocity_mm_s=draw(st.sampled_from([0, 300])),
            locked=draw(st.booleans()),
            vehicle_types=tuple(
                VehicleTypeOnPath(vehicle_type_id=each, rotation_allowed=True) for each in draw(types)
            ),
        )
        for number in range(count)
    ]
    points = [
        point(name, vehicle_types=tuple(VehicleTypeAtPoint(vehicle_type_id=each) for each in draw(types)))
        for name in NAMES
    ]
    return PlantModel(name="drawn", points=tuple(points), paths=tuple(paths))


def all_costs(
    plant: PlantModel,
    avoid: frozenset[str] = frozenset(),
    vehicle: Vehicle | None = None,
    cost: Callable[[float, DirectedEdge], float] = lambda length, _: length,
) -> Mapping[tuple[str, str], int | float]:
    """Return the least cost between all points by relaxing every pair over every point."""
    costs: dict[tuple[str, str], float] = {(a, b): 0 if a == b else inf for a, b in product(NAMES, NAMES)}
    for edge in plant.edges():
        goal = plant.point(edge.destination)
        kept_out = vehicle is not None and not (
            _is_open(edge.path.vehicle_types) and _is_open(goal.vehicle_types)
        )
        if not kept_out and not edge.path.locked and avoid.isdisjoint((edge.path.name, edge.destination)):
            ends = (edge.source, edge.destination)
            costs[ends] = min(costs[ends], cost(edge.path.length_mm, edge))
    for via, a, b in product(NAMES, NAMES, NAMES):
        costs[a, b] = min(costs[a, b], costs[a, via] + costs[via, b])
    return costs


def _is_open(uses: Iterable[VehicleTypeOnPath | VehicleTypeAtPoint]) -> bool:
    """Whether something is open to vehicles of type t, or to all."""
    types = {use.vehicle_type_id for use in uses}
    return not types or "t" in types


def cost(
    router: Router,
    source: str,
    destination: str,
    avoid: frozenset[str] = frozenset(),
    vehicle: Vehicle | None = None,
) -> float:
    try:
        return router.route(source, destination, avoid=avoid, vehicle=vehicle).cost
    except NoRouteError:
        return inf


AVOID = st.frozensets(st.sampled_from([*NAMES, "path 0", "path 1", "path 2"]), max_size=3)


OF_TYPE_T = Vehicle(name="V", properties={"nena:vehicleType": "t"})


@given(plants(), AVOID, st.sampled_from([None, OF_TYPE_T]))
def test_costs_equal_those_of_the_reference_search(
    plant: PlantModel, avoid: frozenset[str], vehicle: Vehicle | None
) -> None:
    avoid &= {*NAMES, *plant.paths_by_name}
    router, expected = Router(plant), all_costs(plant, avoid, vehicle)
    assert {pair: cost(router, *pair, avoid, vehicle) for pair in expected} == expected


@given(plants())
def test_a_way_over_a_third_point_is_never_cheaper(plant: PlantModel) -> None:
    router = Router(plant)
    for a, b, c in product(NAMES, NAMES, NAMES):
        assert cost(router, a, c) <= cost(router, a, b) + cost(router, b, c)


@given(plants(), st.sampled_from(NAMES), st.sampled_from(NAMES))
def test_steps_join_and_may_be_driven(plant: PlantModel, source: str, destination: str) -> None:
    try:
        route = Router(plant).route(source, destination)
    except NoRouteError:
        return
    assert route.points[0] == source
    assert route.points[-1] == destination
    assert all(a.destination == b.source for a, b in pairwise(route.steps))
    assert route.cost == sum(step.path.length_mm for step in route.steps)
    edges = list(plant.edges())
    assert all(step.edge in edges for step in route.steps)
    assert not any(step.path.locked for step in route.steps)


CHOICES = st.lists(st.lists(st.sampled_from(NAMES), min_size=1, max_size=3), min_size=1, max_size=3)


@given(plants(), st.sampled_from(NAMES), CHOICES)
def test_no_other_choice_of_access_points_is_cheaper(
    plant: PlantModel, source: str, choices: list[list[str]]
) -> None:
    costs = all_costs(plant)
    cheapest = min(sum(costs[leg] for leg in pairwise((source, *chosen))) for chosen in product(*choices))
    try:
        routes = Router(plant).route_through(source, choices)
    except NoRouteError:
        assert cheapest == inf
        return
    assert sum(route.cost for route in routes) == cheapest
    assert [route.source for route in routes] == [source, *(route.destination for route in routes[:-1])]
    assert all(route.destination in choice for route, choice in zip(routes, choices, strict=True))


def partly_free(edge: DirectedEdge, _profile: RoutingProfile) -> float:
    """Return a cost that is 0 for every third length."""
    return float(edge.path.length_mm % 3)


@given(
    plants(),
    st.lists(st.dictionaries(st.sampled_from([f"path {n}" for n in range(14)]), st.booleans())),
    st.sampled_from([distance, partly_free]),
)
def test_changed_locks_give_the_routes_of_a_new_router(
    plant: PlantModel, changes: list[dict[str, bool]], cost: CostEvaluator
) -> None:
    router = Router(plant, (cost,))
    for locks in changes:
        router.costs_from("A")
        router.set_locks(locks)
        fresh = Router(plant, (cost,))
        fresh.set_locks(locks)
        for name in NAMES:
            assert router.costs_from(name) == fresh.costs_from(name)
            assert router.costs_to(name).costs == fresh.costs_to(name).costs


def test_costs_that_a_lock_does_not_change_are_kept() -> None:
    ends = ("A B", "B A", "B C", "C B", "C A", "A C")
    router = Router(
        PlantModel(name="", points=tuple(map(point, "ABC")), paths=tuple(path(each, 10) for each in ends))
    )
    before = {name: router.costs_to(name) for name in "ABC"}
    router.set_locks({"A --- B": True})
    assert {name for name in "ABC" if router.costs_to(name) is before[name]} == {"A", "C"}
    assert router.costs_to("B").cost_from("A") == 20


BURDEN = st.dictionaries(
    st.sampled_from([*NAMES, *(f"path {number}" for number in range(6)), f"path 0{BACKWARD_SUFFIX}"]),
    st.sampled_from([0.1, 0.3, 6.0]),
    min_size=1,
)


@given(plants(), AVOID, BURDEN)
def test_routes_in_traffic_cost_no_more_than_the_reference_search(
    plant: PlantModel, avoid: frozenset[str], burden: dict[str, float]
) -> None:
    avoid &= {*NAMES, *plant.paths_by_name}

    def now(length: float, edge: DirectedEdge) -> float:
        return length * (1 + burden.get(edge.id, 0) + burden.get(edge.destination, 0))

    router, expected = Router(plant), all_costs(plant, avoid, cost=now)
    for (source, destination), least in expected.items():
        try:
            steps = router.route(source, destination, avoid=avoid, burden=burden).steps
        except NoRouteError:
            assert least == inf
        else:
            assert sum(now(each.cost, each.edge) for each in steps) == pytest.approx(least)
