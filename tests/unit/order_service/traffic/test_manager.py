"""Who holds what, as the traffic manager accounts for it."""

from __future__ import annotations

import pytest

from nena_order_service.routing.graph import travel_time
from nena_order_service.routing.router import Router
from nena_order_service.traffic.manager import RouteRejection, TrafficManager
from nena_order_service.traffic.resources import Found
from nena_order_service.traffic.route_search import RouteRequest
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
    """A traffic manager of one plant, and vehicles on points of it."""

    def __init__(self, *, exclusive: bool = True, box: BoundingBox = BOX, **places: str) -> None:
        self.router = Router(ROW)
        self.manager = TrafficManager(ROW, routes_over(self.router), exclusive=exclusive)
        for vehicle, at in places.items():
            self.manager.update_position(vehicle, Found(at, on_point=True), box)

    def go(self, vehicle: str, goal: str, ahead: int = 0) -> str:
        """Start a vehicle, and allocate; return its wait reason as text."""
        self.manager.request_route(RouteRequest(vehicle, goal))
        list(self.manager.decide(lambda name: name == vehicle))
        if self.manager.route_of(vehicle):
            self.manager.allocate(vehicle, ahead)
        return str(self.manager.refusal_of(vehicle) or "")

    def held(self, vehicle: str) -> set[str]:
        return {name for each in self.manager.held_by(vehicle) for name in each.uses}


def test_requested_sets_are_allocated_ahead_and_freed_behind() -> None:
    bench = Bench(v="A")
    assert bench.go("v", "D", ahead=2) == ""
    assert bench.held("v") == {"A", "A --- B", "B", "B --- C", "C"}

    bench.manager.note_arrival("v", 1)
    assert bench.held("v") == {"A --- B", "B", "B --- C", "C"}
    assert bench.manager.allocate("v", 2)
    assert not bench.manager.allocate("v", 2)

    bench.manager.finish_route("v")
    assert bench.held("v") == {"C --- D", "D"}
    assert bench.manager.route_of("v") is None


def test_a_long_vehicle_keeps_resources_under_its_tail() -> None:
    bench = Bench(v="A", box=BoundingBox(length_mm=2500))
    bench.go("v", "D")

    bench.manager.note_arrival("v", 2)
    assert {"A --- B", "B"} <= bench.held("v")
    bench.manager.note_arrival("v", 3)
    assert "A --- B" not in bench.held("v")


def test_a_vehicle_that_drove_too_far_holds_its_position() -> None:
    bench = Bench(v="A", w="C")
    bench.go("w", "X")
    bench.go("v", "D", ahead=1)

    bench.manager.note_arrival("v", 2)

    assert "C" in bench.held("v")
    assert "C" in str(bench.manager.shared_with("w"))


def test_after_a_route_is_broken_off_everything_is_held_until_the_vehicle_stands() -> None:
    bench = Bench(v="A")
    bench.go("v", "D")
    bench.manager.note_arrival("v", 1)

    bench.manager.break_off("v")
    assert bench.held("v") >= {"B", "C", "D"}
    assert bench.manager.broke_off("v")
    bench.manager.update_position("v", Found("C", on_point=False, place_mm=(3000.0, 0.0)), BOX, moving=True)
    assert bench.held("v") >= {"B", "C", "D"}

    bench.manager.update_position("v", Found("C", on_point=False, place_mm=(3000.0, 0.0)), BOX)
    assert bench.held("v") == {"A --- B", "B", "B --- C", "C"}
    assert not bench.manager.broke_off("v")


def test_a_vehicle_beside_a_point_keeps_its_possible_positions() -> None:
    """Far off the straight line, as on a path that is not straight: its pose alone would free it."""
    bench, beside = Bench(v="A"), Found("C", on_point=False, place_mm=(3000.0, 6000.0))
    bench.go("v", "D")
    bench.manager.note_arrival("v", 1)
    bench.manager.break_off("v")

    for _ in range(3):
        bench.manager.update_position("v", beside, BOX)
        assert bench.held("v") >= {"B", "B --- C", "C"}

    assert bench.go("v", "D") == ""
    bench.manager.finish_route("v")
    bench.manager.update_position("v", Found("D", on_point=True), BOX)
    assert bench.held("v") == {"C --- D", "D"}


def test_breaking_off_on_a_point_keeps_the_point_and_the_tail() -> None:
    bench = Bench(v="A", box=BoundingBox(length_mm=2500))
    bench.go("v", "D")
    bench.manager.note_arrival("v", 2)

    bench.manager.break_off("v")
    bench.manager.update_position("v", Found("C", on_point=True), BoundingBox(length_mm=2500))

    assert bench.held("v") == {"A --- B", "B", "B --- C", "C"}


def test_a_vehicle_moved_elsewhere_holds_only_its_new_position() -> None:
    bench = Bench(v="A")

    assert bench.manager.update_position("v", Found("D", on_point=True), BOX)
    assert not bench.manager.update_position("v", Found("D", on_point=True), BOX)

    assert bench.held("v") == {"D"}


def test_a_vehicle_beside_its_point_claims_it_first() -> None:
    bench = Bench(w="B")
    bench.manager.update_position("v", Found("B", on_point=False, place_mm=(2000.0, 900.0)), BOX)

    assert bench.go("v", "C") == "waits for w, which stands on 'B'"
    assert bench.held("v") == set()


def test_two_vehicles_on_one_point_both_hold_it_and_are_named() -> None:
    bench = Bench(v="B", w="B")

    assert str(bench.manager.shared_with("v")) == "stands on 'B' together with w"
    assert bench.go("w", "C") == ""
    bench.manager.finish_route("w")
    assert bench.manager.shared_with("v") is None


def test_a_route_is_revoked_before_any_allocation() -> None:
    bench = Bench(v="A", w="C")
    bench.go("w", "A")  # claimed, and nothing of it can be had

    bench.manager.request_route(RouteRequest("v", "B"))
    bench.manager.drop_request("w")

    assert bench.manager.route_of("w") is None
    assert list(bench.manager.decide(lambda name: name == "v"))
    bench.manager.revoke_route("v")
    assert bench.held("v") == {"A"}
    assert bench.manager.waiting_vehicles == frozenset()


def test_a_shortened_route_ends_at_the_last_allocated_set() -> None:
    bench = Bench(v="A")
    bench.go("v", "E", ahead=2)

    bench.manager.shorten_route("v")
    bench.manager.finish_route("v")

    assert bench.held("v") == {"B --- C", "C"}
    assert Bench(v="A").go("v", "E") == ""


def test_a_vehicle_stopping_on_a_route_is_sent_away_or_makes_others_stuck() -> None:
    bench = Bench(v="A", w="C")
    bench.go("w", "D")
    bench.go("v", "C", ahead=1)  # behind w
    bench.manager.break_off("w")
    bench.manager.update_position("w", Found("C", on_point=True), BOX)

    assert not bench.manager.allocate("v")
    assert bench.manager.is_blocked("v")
    assert list(bench.manager.stuck_vehicles(lambda _: False, lambda _: False)) == []
    assert list(bench.manager.stuck_vehicles(lambda _: False, lambda name: name == "w")) == ["v"]

    (evasion,) = bench.manager.decide(lambda name: name == "w")
    assert evasion.vehicle == "w"
    assert bench.manager.route_of("v")
    assert bench.manager.route_of("w")


def test_after_a_restart_all_grants_are_held() -> None:
    before = Bench(v="A")
    before.go("v", "D", ahead=2)
    journey = before.manager.route_of("v")
    assert journey

    after = Bench()
    after.manager.restore_position("v", [after.manager.resources.at_point("A")], 1)
    after.manager.resume_route("v", journey.way, journey.allocated)

    assert after.held("v") == before.held("v")
    after.manager.note_arrival("v", 2)
    assert after.manager.allocate("v")


def test_removing_a_vehicle_frees_everything() -> None:
    bench = Bench(v="A", w="D")
    bench.go("v", "C")
    bench.manager.request_route(RouteRequest("w", "E"))

    bench.manager.remove_vehicle("v")
    bench.manager.remove_vehicle("w")

    assert "v" not in bench.manager
    assert bench.held("v") == set()
    assert bench.manager.waiting_vehicles == frozenset()


def test_without_traffic_control_no_vehicle_waits() -> None:
    bench = Bench(v="A", w="B", exclusive=False)

    assert bench.go("v", "D") == ""
    journey = bench.manager.route_of("v")
    assert journey
    assert journey.all_allocated
    assert bench.manager.shared_with("w") is None


def test_a_request_without_a_route_is_rejected_and_dropped() -> None:
    bench = Bench(v="A")
    bench.manager.request_route(RouteRequest("v", "D", avoid=frozenset("C")))

    (told,) = bench.manager.decide(lambda _: True)

    assert isinstance(told, RouteRejection)
    assert bench.manager.waiting_vehicles == frozenset()


@pytest.mark.parametrize(("on_point", "stands"), [(True, True), (False, False)])
def test_known_position_of_a_vehicle(on_point: bool, stands: bool) -> None:  # noqa: FBT001 - an example
    assert Bench(v="A").manager.stands_at("v", "A", on_point=on_point) is stands


def test_replanning_keeps_allocated_sets_and_a_refusal_changes_nothing() -> None:
    bench = Bench(v="A", w="D")
    bench.manager.request_route(RouteRequest("v", "X"))
    (_,) = bench.manager.decide(lambda _: True)
    bench.manager.allocate("v", 1)
    held, before = bench.manager.held_by("v"), bench.manager.route_of("v")
    assert before
    way = before.way

    refusal = bench.manager.replace_route("v", bench.router.route("B", "E").steps)
    assert refusal
    assert refusal.vehicles == ("w",)
    assert (bench.manager.held_by("v"), before.way) == (held, way)

    assert bench.manager.replace_route("v", bench.router.route("B", "C").steps) is None
    assert bench.manager.held_by("v") == held
    assert [each.point for each in before.way] == ["B", "C"]
    bench.manager.allocate("v")
    assert before.all_allocated


def test_routes_are_compared_by_cost_not_length() -> None:
    slow_short = path("B C"), path("C D", max_velocity_mm_s=100)
    fast_long = (path(ends, 4500, max_velocity_mm_s=3000) for ends in ("B X", "X D"))
    model = plant(path("A B"), *slow_short, *fast_long)
    router = Router(model, (travel_time,))
    routes = routes_over(router)
    manager = TrafficManager(model, routes)
    manager.update_position("v", Found("A", on_point=True), BOX)
    manager.request_route(RouteRequest("v", "D", avoid=frozenset({"X"})))
    list(manager.decide(lambda _: True))
    manager.allocate("v", 1)

    around = manager.route_around("v")
    assert around
    assert around.points == ("B", "X", "D")
    assert manager.route_around("v", avoid={"X"}) is None, "its present route is the best one"

    router.set_locks({"C --- D": True, "X --- D": True})
    routes.forget_routes()
    assert manager.route_around("v") is None
    router.set_locks({"C --- D": True})
    routes.forget_routes()
    assert manager.route_around("v") == router.route("B", "D"), "the present one is closed"
