"""Robots do not queue behind a stopped one: they take any other way, or stay where they are."""

from __future__ import annotations

from nena_order_service.routing.router import Router
from nena_order_service.traffic.manager import EarlyEnd, RouteGrant, TrafficManager
from nena_order_service.traffic.relocation import Relocation
from nena_order_service.traffic.resources import Found
from nena_order_service.traffic.route_search import RouteRequest
from nena_shared.plant import PlantModel
from nena_shared.plant.track import BoundingBox
from support.plants import path, plant
from support.traffic.scenes import routes_over

BOX = BoundingBox(length_mm=1)
LOOP = ("A B", "B C", "C D", "D E", "E F")
"""One way, from station A to station F."""
AROUND = ("A K", "K L", "L E")
"""Costs five times as much as from A to E over D."""
SIDE = ("G B", "C H")
"""Station G joins the way, and H leaves it before the stopped robot."""


class Hall:
    """Vehicle s drives from B to F, and is stopped on D."""

    def __init__(self, model: PlantModel, **places: str) -> None:
        self.manager = TrafficManager(model, routes_over(Router(model)))
        for vehicle, at in {"s": "B", **places}.items():
            self.manager.update_position(vehicle, Found(at, on_point=True), BOX)
        self.request("s", "F")
        self.manager.allocate("s", 2)
        self.manager.note_arrival("s", 2)
        assert self.points("s") == ["D"]

    def points(self, vehicle: str) -> list[str]:
        return [each.point for each in self.manager.held_by(vehicle)]

    def request(self, vehicle: str, goal: str) -> tuple[str, ...]:
        """Request a route; return its points if it is granted."""
        self.manager.request_route(RouteRequest(vehicle, goal))
        return self.decide().get(vehicle, ())

    def decide(self) -> dict[str, tuple[str, ...]]:
        """Return the points of the routes that are granted now, by vehicle."""
        decided = list(self.manager.decide(lambda name: not self.manager.route_of(name)))
        grants = (each for each in decided if isinstance(each, RouteGrant) and each.route)
        return {each.vehicle: each.route.points for each in grants if each.route}

    def stop(self, *vehicles: str) -> None:
        assert self.manager.note_stopped(vehicles)


def hall(*around: str, **places: str) -> Hall:
    """Return the hall with the paths ``around`` the stopped vehicle."""
    straight = (path(ends, 1000) for ends in (*LOOP, *SIDE))
    return Hall(plant(*straight, *(path(ends, 5000) for ends in around)), **places)


def test_a_robot_stays_in_its_station_while_the_only_way_out_is_blocked() -> None:
    scene = hall(w="A")
    scene.stop("s")

    assert scene.request("w", "F") == ()
    refusal = scene.manager.refusal_of("w")
    assert refusal
    assert refusal.vehicles == ("s",)
    assert scene.points("w") == ["A"]

    scene.stop()
    assert scene.decide() == {"w": ("A", "B", "C", "D", "E", "F")}


def test_without_a_stop_a_robot_follows_another_one() -> None:
    scene = hall(*AROUND, w="A")
    assert not scene.manager.note_stopped(())

    assert scene.request("w", "F") == ("A", "B", "C", "D", "E", "F")


def test_a_robot_takes_any_other_way_around_a_stopped_one() -> None:
    scene = hall(*AROUND, w="A")
    scene.stop("s")

    assert scene.request("w", "F") == ("A", "K", "L", "E", "F")


def test_who_waits_behind_a_stopped_robot_stops_others_too_but_only_on_their_ways() -> None:
    scene = hall(w="A", x="A", y="G")
    assert scene.request("w", "F")
    scene.manager.allocate("w", 2)
    scene.manager.note_arrival("w", 2)
    scene.manager.allocate("w", 1)  # it stands on C, and s holds D
    scene.stop("s")

    assert scene.request("y", "H") == ()
    refusal = scene.manager.refusal_of("y")
    assert refusal
    assert refusal.vehicles == ("w",)
    assert scene.request("x", "B") == ("A", "B")


def test_a_robot_under_way_waits_where_it_is_and_gets_any_other_route() -> None:
    scene = hall(*AROUND, "B K", w="A")
    assert scene.request("w", "F")
    scene.manager.allocate("w", 1)
    scene.manager.note_arrival("w", 1)
    assert scene.manager.route_around("w") is None, "the other route costs much more"
    scene.stop("s")
    scene.decide()

    around = scene.manager.route_around("w")

    assert around
    assert around.points == ("B", "K", "L", "E", "F")


def test_a_route_through_a_stopped_robot_ends_where_the_vehicle_is_and_others_may_send_it_away() -> None:
    """It has nothing to wait for on its way: there it would only stop those that have one."""
    scene = hall("G Z", w="A", y="G", parked="Z")
    assert scene.request("w", "F")
    scene.manager.allocate("w", 2)
    scene.manager.note_arrival("w", 2)
    scene.manager.allocate("w", 1)  # it stands on C, and s holds D
    scene.stop("s")
    assert EarlyEnd("w") in list(scene.manager.decide(lambda _: False))
    scene.manager.shorten_route("w")
    scene.manager.finish_route("w")
    assert scene.request("w", "F") == ()
    scene.manager.update_position("x", Found("B", on_point=True), BOX)
    scene.manager.request_route(RouteRequest("y", "Z"))  # it waits, too, and has the right of way before x
    scene.manager.request_route(RouteRequest("x", "C"))

    decided = scene.manager.decide(lambda name: name != "parked" and not scene.manager.route_of(name))

    sent = {each.vehicle: each.route.points for each in decided if isinstance(each, Relocation)}
    assert sent == {"w": ("C", "H")}


def test_the_right_of_way_is_not_for_those_who_wait_for_a_stopped_robot() -> None:
    """It would keep all others from stopping on the section, for as long as the stop lasts."""
    scene = hall("E Z", w="A", x="G")
    scene.stop("s")
    assert scene.request("w", "E") == ()

    assert scene.request("x", "C") == ("G", "B", "C")
