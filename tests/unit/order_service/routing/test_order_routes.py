"""Ways as each vehicle may drive."""

from __future__ import annotations

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.routing import graph
from nena_order_service.routing.graph import CostKey, NoRouteError, cost_evaluators
from nena_order_service.routing.router import NO_ROUTE, RouteCosts, RouteFinder, Router, VehicleRoutes
from nena_order_service.vehicles.registry import VehicleRegistry
from nena_shared.fleet_api.transport_order import Coordinate, Destination
from nena_shared.plant import Link, Location, LocationType, Path, PlantModel, Vehicle
from support.plants import grid_plant, path, plant, point

ONE_WAY = plant(
    path("A B"),
    path("B C"),
    path("C D", 5000),
    points="Z",
    location_types=(LocationType(name="T", allowed_operations=("Load",)),),
    locations=(Location(name="L", type="T", links=(Link(point="D"), Link(point="B"))),),
)
FINDER = RouteFinder(ONE_WAY, Router(ONE_WAY))


def at(name: str, operation: str = "MOVE") -> Destination:
    return Destination(location_name=name, operation=operation)


def test_location_is_served_from_its_cheapest_access_point() -> None:
    way = FINDER.find("A", [at("L", "Load")])
    assert [leg.points for leg in way.legs] == [("A", "B")]
    assert way.cost == 1000


def test_one_leg_for_each_destination() -> None:
    assert [leg.points for leg in FINDER.find("A", [at("B"), at("C")]).legs] == [("A", "B"), ("B", "C")]


def test_finding_a_missing_route_raises_an_error() -> None:
    with pytest.raises(NoRouteError):
        FINDER.find("C", [at("A")])


def test_coordinate_is_reached_straight_and_left_via_the_nearest_point() -> None:
    points = (point("A"), point("B", 1000), point("C", 9000))
    model = PlantModel(name="line", points=points, paths=(path("A B"),))
    finder = RouteFinder(model, Router(model))
    way = finder.find("C", [Destination(coordinate=Coordinate(x=0.3, y=0.4)), at("B")])
    assert [leg.points for leg in way.legs] == [(), ("A", "B")]
    assert way.legs[0].cost == pytest.approx(8709, abs=1)


def test_routability_tries_every_access_point_of_the_first_destination_as_a_start() -> None:
    # From D, the nearer access point by name, there is no way to C; from B there is.
    assert FINDER.why_unroutable([at("L", "Load"), at("C")], frozenset()) is None


def test_unroutable_has_a_reason() -> None:
    assert "No route from 'C' to 'A'" in str(FINDER.why_unroutable([at("C"), at("A")], frozenset()))


def test_resources_to_avoid_make_an_order_unroutable() -> None:
    assert FINDER.why_unroutable([at("A"), at("C")], frozenset({"B"})) is not None


def test_coordinates_are_routable_from_the_nearest_point() -> None:
    model = PlantModel(
        name="line", points=(point("A"), point("B", 5000), point("Z", 90_000)), paths=(path("B A"),)
    )
    finder = RouteFinder(model, Router(model))
    near, far = Destination(coordinate=Coordinate(x=4, y=0)), Destination(coordinate=Coordinate(x=80, y=0))
    assert finder.why_unroutable([near, at("A")], frozenset()) is None
    assert "from 'Z' to 'A'" in str(finder.why_unroutable([far, at("A")], frozenset()))


def test_host_locks_are_distinguished_from_missing_routes() -> None:
    model = plant(path("A B"), path("B C", locked=True), path("B D"))
    finder = RouteFinder(model, Router(model), without_host_locks=Router(model))
    finder.set_locks({"A --- B": True})
    assert finder.is_locked("A --- B")
    assert finder.is_locked("B --- C")
    assert not finder.is_locked("B --- D")
    assert not finder.is_locked("no path")
    assert finder.locks_on_way("A", [at("D")], None, ()) == ("A --- B",)
    assert not finder.locks_on_way("A", [at("C")], None, ())


NAMES = "ABCDEF"


def made(paths: tuple[Path, ...], links: tuple[str, ...] = ()) -> tuple[RouteFinder, RouteCosts]:
    plant = PlantModel(
        name="made",
        points=tuple(point(name, 1000 * index) for index, name in enumerate(NAMES)),
        paths=paths,
        location_types=(LocationType(name="Station", allowed_operations=("Load",)),),
        locations=(
            Location(name="Station", type="Station", links=tuple(Link(point=each) for each in links)),
        ),
    )
    finder = RouteFinder(plant, Router(plant))
    return finder, RouteCosts(plant, finder)


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
def test_costs_equal_those_of_the_found_routes(
    edges: dict[tuple[str, str], int], links: list[str], goals: list[str], avoid: set[str]
) -> None:
    finder, costs = made(tuple(path(f"{a} {b}", cost) for (a, b), cost in edges.items()), tuple(links))
    for start in NAMES:
        found = costs.cost_of_route(start, stops(*goals), vehicle=None, avoid=avoid)
        try:
            way = finder.find(start, stops(*goals), avoid=avoid)
        except NoRouteError:
            assert found.complete == inf
        else:
            assert found.complete == pytest.approx(way.cost)
            assert found.initial <= found.complete


def test_routes_to_coordinates_respect_locks_at_once() -> None:
    finder, costs = made((path("A B", 1000), path("B C", 1000)))
    coordinate = [*stops("B"), Destination(coordinate=Coordinate(x=1.0, y=2.0))]
    assert costs.cost_of_route("A", coordinate, vehicle=None) == (3000, 1000)
    assert costs.cost_of_route("A", stops("C"), vehicle=None).complete == 2000
    finder.set_locks({"B --- C": True})
    assert costs.cost_of_route("A", stops("C"), vehicle=None) == NO_ROUTE
    assert costs.cost_of_route("C", coordinate, vehicle=None) == NO_ROUTE


PLANT = PlantModel(
    name="two ways",
    points=(point("A"), point("B"), point("C")),
    paths=(
        path("A B", properties={"tcs:routingCostForwardheavy": "Infinity", "tcs:routingCostForward": "1"}),
        path("A C", properties={"tcs:routingCostForwardheavy": "1", "tcs:routingCostForward": "9"}),
        path("C B", properties={"tcs:routingCostForwardheavy": "1", "tcs:routingCostForward": "9"}),
    ),
    vehicles=(Vehicle(name="light"), Vehicle(name="heavy", properties={"tcs:routingGroup": "heavy"})),
)


def make() -> tuple[RouteFinder, VehicleRoutes]:
    finder = RouteFinder(PLANT, Router(PLANT, cost_evaluators([CostKey.EXPLICIT_PROPERTIES], PLANT)))
    return finder, VehicleRoutes(
        finder.router, VehicleRegistry(PLANT, default_map_id="", adopt_unknown=True).model
    )


def test_each_vehicle_uses_the_costs_of_its_routing_group() -> None:
    _, ways = make()

    assert ways.route("light", "A", "B").points == ("A", "B")
    assert ways.route("heavy", "A", "B").points == ("A", "C", "B")
    assert ways.route("adopted", "A", "B").points == ("A", "B")
    assert (ways.nearest_points("heavy", "A"), ways.nearest_points("light", "A")) == (
        ("A", "C", "B"),
        ("A", "B", "C"),
    )
    assert ways.route("light", "A", "B", avoid={"A --- B"}).points == ("A", "C", "B")


def test_routes_are_cached_until_the_plant_changes() -> None:
    finder, ways = make()
    before = ways.route("heavy", "A", "B")
    finder.set_locks({"C --- B": True})

    assert ways.route("heavy", "A", "B") is before
    ways.forget_routes()
    with pytest.raises(NoRouteError):
        ways.route("heavy", "A", "B")


def test_prepared_routing_builds_no_graph_later(monkeypatch: pytest.MonkeyPatch) -> None:
    model = grid_plant(3, 3)
    slow = Vehicle(name="Slow", max_velocity_mm_s=100, max_reverse_velocity_mm_s=0)
    finder = RouteFinder(model, Router(model), without_host_locks=Router(model))
    finder.prepare([slow])

    def not_now(*_: object) -> None:
        pytest.fail("it takes long in a large plant, and holds everybody else")

    monkeypatch.setattr(graph.RoutingGraph, "__init__", not_now)
    one, other = model.points[0].name, model.points[-1].name
    goal = [at(other)]
    assert finder.why_unroutable(goal, ()) is None
    for vehicle in (None, slow):
        assert finder.find(one, goal, vehicle=vehicle).cost > 0
        assert finder.router.costs_to(other, vehicle=vehicle).cost_from(one) > 0
