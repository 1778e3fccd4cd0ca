"""The desk's account of who holds what."""

from __future__ import annotations

import pytest

from nena_order_service.routing.graph import travel_time
from nena_order_service.routing.router import Router
from nena_order_service.traffic.manager import TrafficManager
from nena_order_service.traffic.resources import Found
from nena_order_service.traffic.traffic_control import RouteRejection, RouteRequest
from nena_shared.plant import PlantModel
from nena_shared.plant.track import BoundingBox
from support.plants import path, plant, point
from support.traffic.scenes import routes_over

BOX = BoundingBox(length_mm=1)
BOTH_WAYS = 1000

ROW = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDEX")),
    paths=tuple(
        path(ends, 2000, max_reverse_velocity_mm_s=BOTH_WAYS) for ends in ("A B", "B C", "C D", "D E", "C X")
    ),
)


class Bench:
    """A desk over one plant, and vehicles on points of it."""

    def __init__(self, *, exclusive: bool = True, box: BoundingBox = BOX, **places: str) -> None:
        self.router = Router(ROW)
        self.desk = TrafficManager(ROW, routes_over(self.router), exclusive=exclusive)
        for vehicle, at in places.items():
            self.desk.seen(vehicle, Found(at, on_point=True), box)

    def go(self, vehicle: str, goal: str, ahead: int = 0) -> str:
        """Start a vehicle, and allocate; return its wait reason as text."""
        self.desk.request_route(RouteRequest(vehicle, goal))
        list(self.desk.decide(lambda name: name == vehicle))
        if self.desk.journey(vehicle):
            self.desk.allocate(vehicle, ahead)
        return self.desk.why_waiting(vehicle)

    def held(self, vehicle: str) -> set[str]:
        return {name for each in self.desk.held(vehicle) for name in each.uses}


def test_requested_sets_are_allocated_ahead_and_freed_behind() -> None:
    bench = Bench(v="A")
    assert bench.go("v", "D", ahead=2) == ""
    assert bench.held("v") == {"A", "A --- B", "B", "B --- C", "C"}

    bench.desk.arrived("v", 1)
    assert bench.held("v") == {"A --- B", "B", "B --- C", "C"}
    assert bench.desk.allocate("v", 2)
    assert not bench.desk.allocate("v", 2)

    bench.desk.finished("v")
    assert bench.held("v") == {"C --- D", "D"}
    assert bench.desk.journey("v") is None


def test_a_long_vehicle_keeps_resources_under_its_tail() -> None:
    bench = Bench(v="A", box=BoundingBox(length_mm=2500))
    bench.go("v", "D")

    bench.desk.arrived("v", 2)
    assert {"A --- B", "B"} <= bench.held("v")
    bench.desk.arrived("v", 3)
    assert "A --- B" not in bench.held("v")


def test_a_vehicle_that_drove_too_far_holds_its_position() -> None:
    bench = Bench(v="A", w="C")
    bench.go("w", "X")
    bench.go("v", "D", ahead=1)

    bench.desk.arrived("v", 2)

    assert "C" in bench.held("v")
    assert "C" in bench.desk.sharing("w")


def test_after_a_route_is_broken_off_everything_is_held_until_the_vehicle_stands() -> None:
    bench = Bench(v="A")
    bench.go("v", "D")
    bench.desk.arrived("v", 1)

    bench.desk.break_off("v")
    assert bench.held("v") >= {"B", "C", "D"}
    assert bench.desk.broke_off("v")
    bench.desk.seen("v", Found("C", on_point=False, place_mm=(3000.0, 0.0)), BOX, moving=True)
    assert bench.held("v") >= {"B", "C", "D"}

    bench.desk.seen("v", Found("C", on_point=False, place_mm=(3000.0, 0.0)), BOX)
    assert bench.held("v") == {"A --- B", "B", "B --- C", "C"}
    assert not bench.desk.broke_off("v")


def test_a_vehicle_beside_a_point_keeps_its_possible_positions() -> None:
    """Far off the straight line, as on a path that is not straight: its pose alone would free it."""
    bench, beside = Bench(v="A"), Found("C", on_point=False, place_mm=(3000.0, 6000.0))
    bench.go("v", "D")
    bench.desk.arrived("v", 1)
    bench.desk.break_off("v")

    for _ in range(3):
        bench.desk.seen("v", beside, BOX)
        assert bench.held("v") >= {"B", "B --- C", "C"}

    assert bench.go("v", "D") == ""
    bench.desk.finished("v")
    bench.desk.seen("v", Found("D", on_point=True), BOX)
    assert bench.held("v") == {"C --- D", "D"}


def test_breaking_off_on_a_point_keeps_the_point_and_the_tail() -> None:
    bench = Bench(v="A", box=BoundingBox(length_mm=2500))
    bench.go("v", "D")
    bench.desk.arrived("v", 2)

    bench.desk.break_off("v")
    bench.desk.seen("v", Found("C", on_point=True), BoundingBox(length_mm=2500))

    assert bench.held("v") == {"A --- B", "B", "B --- C", "C"}


def test_a_vehicle_moved_elsewhere_holds_only_its_new_position() -> None:
    bench = Bench(v="A")

    assert bench.desk.seen("v", Found("D", on_point=True), BOX)
    assert not bench.desk.seen("v", Found("D", on_point=True), BOX)

    assert bench.held("v") == {"D"}


def test_a_vehicle_beside_its_point_claims_it_first() -> None:
    bench = Bench(w="B")
    bench.desk.seen("v", Found("B", on_point=False, place_mm=(2000.0, 900.0)), BOX)

    assert bench.go("v", "C") == "waits for w, which stands on 'B'"
    assert bench.held("v") == set()


def test_two_vehicles_on_one_point_both_hold_it_and_are_named() -> None:
    bench = Bench(v="B", w="B")

    assert bench.desk.sharing("v") == "stands on 'B' together with w"
    assert bench.go("w", "C") == ""
    bench.desk.finished("w")
    assert bench.desk.sharing("v") == ""


def test_a_route_is_revoked_before_any_allocation() -> None:
    bench = Bench(v="A", w="C")
    bench.go("w", "A")  # claimed, and nothing of it can be had

    bench.desk.request_route(RouteRequest("v", "B"))
    bench.desk.drop("w")

    assert bench.desk.journey("w") is None
    assert list(bench.desk.decide(lambda name: name == "v"))
    bench.desk.revoke("v")
    assert bench.held("v") == {"A"}
    assert bench.desk.waiting == frozenset()


def test_a_shortened_route_ends_at_the_last_allocated_set() -> None:
    bench = Bench(v="A")
    bench.go("v", "E", ahead=2)

    bench.desk.shorten("v")
    bench.desk.finished("v")

    assert bench.held("v") == {"B --- C", "C"}
    assert Bench(v="A").go("v", "E") == ""


def test_a_vehicle_stopping_on_a_route_is_sent_away_or_makes_others_stuck() -> None:
    bench = Bench(v="A", w="C")
    bench.go("w", "D")
    bench.go("v", "C", ahead=1)  # behind w
    bench.desk.break_off("w")
    bench.desk.seen("w", Found("C", on_point=True), BOX)

    assert not bench.desk.allocate("v")
    assert bench.desk.is_blocked("v")
    assert list(bench.desk.stuck(lambda _: False, lambda _: False)) == []
    assert list(bench.desk.stuck(lambda _: False, lambda name: name == "w")) == ["v"]

    (evasion,) = bench.desk.decide(lambda name: name == "w")
    assert evasion.vehicle == "w"
    assert bench.desk.journey("v")
    assert bench.desk.journey("w")


def test_after_a_restart_all_grants_are_held() -> None:
    before = Bench(v="A")
    before.go("v", "D", ahead=2)
    journey = before.desk.journey("v")
    assert journey

    after = Bench()
    after.desk.restore("v", [after.desk.resources.at("A")], 1)
    after.desk.resume("v", journey.way, journey.allocated)

    assert after.held("v") == before.held("v")
    after.desk.arrived("v", 2)
    assert after.desk.allocate("v")


def test_removing_a_vehicle_frees_everything() -> None:
    bench = Bench(v="A", w="D")
    bench.go("v", "C")
    bench.desk.request_route(RouteRequest("w", "E"))

    bench.desk.remove("v")
    bench.desk.remove("w")

    assert "v" not in bench.desk
    assert bench.held("v") == set()
    assert bench.desk.waiting == frozenset()


def test_without_traffic_control_no_vehicle_waits() -> None:
    bench = Bench(v="A", w="B", exclusive=False)

    assert bench.go("v", "D") == ""
    journey = bench.desk.journey("v")
    assert journey
    assert journey.all_allocated
    assert bench.desk.sharing("w") == ""


def test_a_request_without_a_route_is_rejected_and_dropped() -> None:
    bench = Bench(v="A")
    bench.desk.request_route(RouteRequest("v", "D", avoid=frozenset("C")))

    (told,) = bench.desk.decide(lambda _: True)

    assert isinstance(told, RouteRejection)
    assert bench.desk.waiting == frozenset()


@pytest.mark.parametrize(("on_point", "stands"), [(True, True), (False, False)])
def test_known_position_of_a_vehicle(on_point: bool, stands: bool) -> None:  # noqa: FBT001 - an example
    assert Bench(v="A").desk.stands("v", "A", on_point=on_point) is stands


def test_replanning_keeps_allocated_sets_and_a_refusal_changes_nothing() -> None:
    bench = Bench(v="A", w="D")
    bench.desk.request_route(RouteRequest("v", "X"))
    (_,) = bench.desk.decide(lambda _: True)
    bench.desk.allocate("v", 1)
    held, before = bench.desk.held("v"), bench.desk.journey("v")
    assert before
    way = before.way

    refusal = bench.desk.replan("v", bench.router.route("B", "E").steps)
    assert refusal
    assert refusal.vehicles == ("w",)
    assert (bench.desk.held("v"), before.way) == (held, way)

    assert bench.desk.replan("v", bench.router.route("B", "C").steps) is None
    assert bench.desk.held("v") == held
    assert [each.point for each in before.way] == ["B", "C"]
    bench.desk.allocate("v")
    assert before.all_allocated


def test_routes_are_compared_by_cost_not_length() -> None:
    slow_short = path("B C"), path("C D", max_velocity_mm_s=100)
    fast_long = (path(ends, 4500, max_velocity_mm_s=3000) for ends in ("B X", "X D"))
    model = plant(path("A B"), *slow_short, *fast_long)
    router = Router(model, (travel_time,))
    routes = routes_over(router)
    desk = TrafficManager(model, routes)
    desk.seen("v", Found("A", on_point=True), BOX)
    desk.request_route(RouteRequest("v", "D", avoid=frozenset({"X"})))
    list(desk.decide(lambda _: True))
    desk.allocate("v", 1)

    around = desk.route_around("v")
    assert around
    assert around.points == ("B", "X", "D")
    assert desk.route_around("v", avoid={"X"}) is None, "its present route is the best one"

    router.set_locks({"C --- D": True, "X --- D": True})
    routes.forget()
    assert desk.route_around("v") is None
    router.set_locks({"C --- D": True})
    routes.forget()
    assert desk.route_around("v") == router.route("B", "D"), "the present one is closed"
