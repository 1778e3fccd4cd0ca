import pytest

from nena_order_service.routing.graph import NoRouteError, hops, travel_time
from nena_order_service.routing.router import Router
from nena_shared.plant import (
    Link,
    Location,
    LocationType,
    Orientation,
    Path,
    UnknownObjectError,
    Vehicle,
)
from support.plants import path, plant

SLOW = Vehicle(name="Slow", max_velocity_mm_s=100, max_reverse_velocity_mm_s=0)


def test_the_shorter_of_two_ways() -> None:
    route = Router(plant(path("A B", 10), path("B D", 10), path("A C", 5), path("C D", 14))).route("A", "D")
    assert route.points == ("A", "C", "D")
    assert [step.edge_id for step in route.steps] == ["A --- C", "C --- D"]
    assert [step.cost for step in route.steps] == [5.0, 14.0]
    assert (route.cost, route.length_m) == (19.0, 0.019)


def test_the_cheapest_of_several_paths_between_two_points() -> None:
    model = plant(path("A B", 30, name="long"), path("A B", 10, name="short"), path("A B", 20, name="middle"))
    assert [step.path.name for step in Router(model).route("A", "B").steps] == ["short"]


def test_a_vehicle_already_there_needs_no_step() -> None:
    route = Router(plant(path("A B"))).route("A", "A")
    assert (route.steps, route.cost, route.points) == ((), 0.0, ("A",))


def test_backward_with_a_reverse_speed_only() -> None:
    model = plant(path("A B", max_reverse_velocity_mm_s=200), path("B C"))
    (step,) = Router(model).route("B", "A").steps
    assert (step.orientation, step.edge_id) == (Orientation.BACKWARD, "A --- B:backward")
    assert (step.source, step.destination) == ("B", "A")
    with pytest.raises(NoRouteError):
        Router(model).route("C", "B")


def test_a_vehicle_without_reverse_speed_does_not_drive_backward() -> None:
    model = plant(path("A B", max_reverse_velocity_mm_s=200))
    router = Router(model)
    assert router.route("B", "A").steps
    with pytest.raises(NoRouteError, match="for robot 'Slow'"):
        router.route("B", "A", vehicle=SLOW)


def test_a_locked_path_is_not_used() -> None:
    model = plant(path("A B", 1, locked=True), path("A C", 10), path("C B", 10))
    assert Router(model).route("A", "B").points == ("A", "C", "B")


@pytest.mark.parametrize(
    ("avoid", "points"),
    [
        (set(), ("A", "B", "D")),
        ({"B"}, ("A", "C", "D")),
        ({"A --- B"}, ("A", "C", "D")),
        ({"Dock"}, ("A", "C", "D")),
        ({"A"}, ("A", "B", "D")),
    ],
)
def test_what_is_to_be_avoided(avoid: set[str], points: tuple[str, ...]) -> None:
    dock = Location(name="Dock", type="T", links=(Link(point="B"),))
    model = plant(
        path("A B", 1),
        path("B D", 1),
        path("A C", 5),
        path("C D", 5),
        location_types=(LocationType(name="T"),),
        locations=(dock,),
    )
    assert Router(model).route("A", "D", avoid=avoid).points == points


def test_the_path_to_be_avoided_is_not_used() -> None:
    model = plant(path("A B", 10, name="short"), path("A B", 20, name="long"))
    assert Router(model).route("A", "B", avoid={"short"}).steps[0].path.name == "long"


def test_no_route_error_has_all_details() -> None:
    with pytest.raises(NoRouteError) as caught:
        Router(plant(path("A B"))).route("A", "B", vehicle=SLOW, avoid={"B", "A --- B"})
    error = caught.value
    assert (error.source, error.destinations, error.vehicle) == ("A", ("B",), "Slow")
    assert error.avoid == ("A --- B", "B")
    assert "No route from 'A' to 'B' for robot 'Slow' without 'A --- B', 'B'" in str(error)


@pytest.mark.parametrize(
    ("paths", "avoid", "reason"),
    [
        ([path("C A")], (), "no path leads there"),
        ([path("A B", locked=True)], (), "path 'A --- B' is locked"),
        ([path("B A")], (), "path 'B --- A' may not be driven from 'A' to 'B'"),
        ([path("A C"), path("C B")], ("C",), "it would need path 'A --- C'"),
        ([path("A B", max_velocity_mm_s=1)], (), "the robot's highest speed on path 'A --- B' is 0"),
        ([path("B A"), path("A C", 9999), path("C B", locked=True)], (), "path 'C --- B' is locked"),
        ([path("A C", locked=True), path("C B", locked=True), path("B A")], (), "path 'A --- C' is locked"),
    ],
)
def test_what_closes_the_way_is_named(paths: list[Path], avoid: tuple[str, ...], reason: str) -> None:
    """An operator can unlock a path, but cannot look for it in a list of what may be the cause."""
    standing = Vehicle(name="V", max_velocity_mm_s=0 if "speed" in reason else 1000)
    with pytest.raises(NoRouteError) as caught:
        Router(plant(*paths, points="A B")).route("A", "B", vehicle=standing, avoid=avoid)
    assert str(caught.value).partition(": ")[2] == f"{reason}."


@pytest.mark.parametrize(
    ("source", "destination", "avoid"), [("X", "A", ()), ("A", "X", ()), ("X", "X", ()), ("A", "B", ("X",))]
)
def test_unknown_names_are_named(source: str, destination: str, avoid: tuple[str, ...]) -> None:
    with pytest.raises(UnknownObjectError, match="'X'"):
        Router(plant(path("A B"))).route(source, destination, avoid=avoid)


def test_costs_are_added_up() -> None:
    model = plant(path("A B", 3000, max_velocity_mm_s=1000))
    assert Router(model, (travel_time, hops)).route("A", "B").cost == 4.0
    assert Router(model, (travel_time, hops)).route("A", "B", vehicle=SLOW).cost == 31.0


def test_a_cost_below_0_is_refused() -> None:
    with pytest.raises(ValueError, match="edge 'A --- B' has cost -1"):
        Router(plant(path("A B")), (lambda *_: -1.0,)).route("A", "B")


@pytest.mark.parametrize("cost", [float("inf"), float("nan")])
def test_an_infinite_cost_excludes(cost: float) -> None:
    with pytest.raises(NoRouteError):
        Router(plant(path("A B")), (lambda *_: cost,)).route("A", "B")


def test_the_whole_route_through_several_destinations_counts() -> None:
    # L1 is nearer to S, but the way from there to the goal is long.
    model = plant(path("S L1", 1), path("L1 G", 100), path("S L2", 10), path("L2 G", 10))
    first, second = Router(model).route_through("S", [["L1", "L2"], ["G"]])
    assert (first.points, second.points) == (("S", "L2"), ("L2", "G"))
    assert Router(model).route_through("S", [["L1", "L2"]])[0].points == ("S", "L1")


def test_through_a_destination_where_the_vehicle_is_already() -> None:
    routes = Router(plant(path("A B"), path("B A"))).route_through("A", [["A", "B"], ["B"], ["B"]])
    assert [route.cost for route in routes] == [0.0, 1000.0, 0.0]


def test_no_destinations_need_no_route() -> None:
    assert Router(plant(path("A B"))).route_through("A", []) == ()


def test_a_destination_that_cannot_be_reached_is_named() -> None:
    router = Router(plant(path("A B"), points="C D"))
    with pytest.raises(NoRouteError) as caught:
        router.route_through("A", [["B", "C"], ["C", "D"]])
    assert (caught.value.source, caught.value.destinations) == ("B", ("C", "D"))
    with pytest.raises(NoRouteError) as caught:
        router.route_through("A", [["B"], ["C"], ["D"]])
    assert (caught.value.source, caught.value.destinations) == ("B", ("C",))
    with pytest.raises(NoRouteError, match="none of the destination's points"):
        router.route_through("A", [[]])
    with pytest.raises(UnknownObjectError, match="'X'"):
        router.route_through("A", [["B"], ["X"]])


def test_through_avoids_and_locks_as_a_single_route_does() -> None:
    model = plant(path("A B", 1), path("A C", 5), path("C B", 5))
    (route,) = Router(model).route_through("A", [["B"]], avoid={"A --- B"})
    assert route.points == ("A", "C", "B")
