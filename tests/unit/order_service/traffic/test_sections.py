"""How much of its route a vehicle claims, which route it takes among others, and which one makes room in a
ring.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest

from nena_order_service.routing.router import Router
from nena_order_service.traffic.manager import SECTION, EarlyEnd, MoreClaimed, RouteGrant, TrafficManager
from nena_order_service.traffic.relocation import Relocation
from nena_order_service.traffic.resources import Crossings, Found
from nena_order_service.traffic.route_search import RouteRequest
from nena_shared.plant import Path, PlantModel
from nena_shared.plant.model import Block
from nena_shared.plant.track import BoundingBox
from support.plants import path, plant
from support.traffic.scenes import Scene, routes_over

BOTH_WAYS = 1000
BOX = BoundingBox(length_mm=1)


def lane(points: str, *, two_way: bool = False) -> list[Path]:
    """Make paths of 1 m from each point to the next one."""
    back = BOTH_WAYS if two_way else 0
    ends = pairwise(points.split())
    return [path(f"{one} {other}", max_reverse_velocity_mm_s=back) for one, other in ends]


class Bench(Scene):
    """A manager over a plant, and vehicles on points of it."""

    def __init__(self, model: PlantModel, **places: str) -> None:
        self.router = Router(model)
        self.manager = TrafficManager(model, routes_over(self.router))
        for vehicle, at in places.items():
            self.manager.update_position(vehicle, Found(at, on_point=True), BOX)

    def want(self, vehicle: str, goal: str) -> None:
        self.manager.request_route(RouteRequest(vehicle, goal))

    def decided(self) -> list[RouteGrant | Relocation | EarlyEnd | MoreClaimed]:
        """Run traffic control's decisions; nothing is rejected."""
        at_rest = self.manager.decide(lambda name: not self.manager.route_of(name))
        decided = [
            each for each in at_rest if isinstance(each, RouteGrant | Relocation | EarlyEnd | MoreClaimed)
        ]
        for vehicle, _ in self.manager.routes_to_extend():
            self.manager.allocate(vehicle)
        return decided

    def arrive(self, vehicle: str, reached: int) -> None:
        self.manager.note_arrival(vehicle, reached)

    def claims(self, vehicle: str) -> str:
        """Name the points that a vehicle holds ahead of it or claims."""
        journey = self.manager.route_of(vehicle)
        assert journey
        claimed = len(self.manager.scheduler.occupant(vehicle).claimed)
        return "".join(each.point for each in journey.way[journey.reached : journey.allocated + claimed])


def test_section_of_a_one_way_lane_is_claimed_and_extended_en_route() -> None:
    bench = Bench(plant(*lane("A B C D E F G H I J")), v="A")
    bench.want("v", "J")
    bench.decided()
    assert bench.claims("v") == "BCDEFGHIJ"[:SECTION]

    assert [type(each) for each in bench.decided()] == [MoreClaimed]

    assert bench.claims("v") == "BCDEFGHIJ"[: 2 * SECTION]


def test_section_extends_to_the_end_of_a_two_way_track() -> None:
    model = plant(*lane("A B C"), *lane("C D E F G H", two_way=True), *lane("H I J"))
    bench = Bench(model, v="A")
    bench.want("v", "J")

    bench.decided()

    assert bench.claims("v") == "BCDEFGH"


def test_section_of_a_two_way_road_ends_at_a_crossing_that_others_can_go_around() -> None:
    ring, spokes = (
        lane("A B C D E A", two_way=True),
        [*lane("A X C", two_way=True), *lane("X E", two_way=True)],
    )
    far = lane("C F G H I J", two_way=True)
    bench = Bench(plant(*ring, *spokes, *far), v="J")
    bench.want("v", "E")

    bench.decided()

    assert bench.claims("v") == "IHGFCX", "only past C nobody can be led"


def test_section_does_not_end_in_a_block() -> None:
    bench = Bench(plant(*lane("A B C D E F G H"), blocks=(Block(name="X", members=("E", "F")),)), v="A")
    bench.want("v", "H")

    bench.decided()

    assert bench.claims("v") == "BCDEFG"


def test_vehicle_drives_up_to_one_operating_on_the_lane() -> None:
    bench = Bench(plant(*lane("A B C D E F")), v="A", w="D")
    bench.want("v", "F")

    granted = list(bench.manager.decide(lambda name: name == "v"))

    assert [each.vehicle for each in granted] == ["v"]
    assert bench.claims("v") == "BC"


def test_no_vehicle_drives_up_to_a_lost_vehicle() -> None:
    bench = Bench(plant(*lane("A B C D E F")), v="A", w="D")
    bench.want("v", "F")

    assert list(bench.manager.decide(lambda name: name == "v", lambda name: name == "w")) == []
    assert str(bench.manager.refusal_of("v")).startswith("waits for w, which stands on")


def test_vehicle_under_way_that_encloses_blockers_is_displaced() -> None:
    model = plant(*lane("A C"), *lane("S C S"), *lane("T C T"), *lane("U C U"), *lane("C D K C"))
    bench = Bench(model, v="A", x="D", z="K")
    bench.want("v", "D")
    assert [type(each) for each in bench.decided()] == [RouteGrant]
    bench.arrive("v", 1)

    assert [(type(each), each.vehicle) for each in bench.decided()] == [(EarlyEnd, "v")]


def test_vehicle_makes_room_around_others_at_rest() -> None:
    bench = Bench(plant(*lane("C D E F"), path("D F", 6000, name="around")), v="C", x="D", y="E")
    bench.want("v", "D")

    (away,) = [each for each in bench.decided() if isinstance(each, Relocation)]

    assert (away.vehicle, away.route.points) == ("x", ("D", "F"))


def test_vehicle_that_let_another_out_does_not_enclose_it_again() -> None:
    bench = Bench(
        plant(*lane("S C S"), *lane("T C T"), *lane("U C U"), *lane("C D K C")), v="C", x="D", z="K"
    )
    bench.want("v", "D")
    assert [(type(each), each.vehicle) for each in bench.decided()] == [(Relocation, "v")]
    bench.manager.finish_route("v")

    assert [(type(each), each.vehicle) for each in bench.decided()] == [(Relocation, "z")]


@pytest.mark.parametrize("ended", ["", "request dropped", "other goal", "lost"])
def test_vehicle_that_let_another_out_claims_sections_once_that_is_over(ended: str) -> None:
    model = plant(*lane("S C S"), *lane("T C T"), *lane("U C U"), *lane("C D K C"))
    bench = Bench(model, v="C", x="D", z="K")
    bench.want("v", "D")
    bench.decided()
    bench.manager.finish_route("v")
    if ended == "request dropped":
        bench.manager.drop_request("v")
    elif ended == "other goal":
        bench.want("v", "K")

    assert bench.manager._has_let_out("v", lambda _: ended == "lost") == (not ended)


def test_vehicle_that_only_pauses_is_not_displaced_for_one_it_encloses() -> None:
    model = plant(*lane("A C E G"), *lane("C S"), *lane("F D C"))
    bench = Bench(model, v="A", w="E", e="F", x="D")
    bench.want("v", "G")
    assert [each.vehicle for each in bench.manager.decide(lambda name: name == "v")] == ["v"]
    bench.manager.allocate("v")
    bench.arrive("v", 1)
    bench.want("e", "D")

    assert list(bench.manager.decide(lambda name: name in {"e", "x"})) == []
    assert str(bench.manager.refusal_of("v")) == "waits for w, which stands on 'E'"
    assert str(bench.manager.refusal_of("e")) == "waits for x, which stands on 'D'"


@pytest.mark.parametrize("closed", ["A --- B", "B --- C"])
def test_crossing_is_closed_while_the_detour_is_locked(closed: str) -> None:
    ring = [*lane("A B C D E A", two_way=True), *lane("A X E", two_way=True), *lane("X C", two_way=True)]
    around = Crossings(plant(*ring))
    assert around.is_open("X")

    around.set_locks({closed: True, "D --- E": True})
    assert not around.is_open("X")

    around.set_locks({})
    assert around.is_open("X")


@pytest.mark.parametrize("field", [{"locked": True}, {"max_velocity_mm_s": 0}])
def test_crossing_is_closed_if_the_plant_locks_the_detour(field: dict[str, Any]) -> None:
    row = [*lane("A B", two_way=True), *lane("A X B", two_way=True), *lane("X C", two_way=True)]

    assert Crossings(plant(*row, path("B C"), path("C B"))).is_open("X")
    assert not Crossings(plant(*row, path("B C"), path("C B", **field))).is_open("X")


@pytest.mark.parametrize(
    ("ring", "passed"), [("A X B Y A", True), ("A X B C Y A", True), ("A X B C D Y A", False)]
)
def test_a_passing_place_needs_a_short_detour(ring: str, passed: bool) -> None:  # noqa: FBT001 - an example
    ends = lane("S A", two_way=True), lane("B T", two_way=True)
    assert Crossings(plant(*lane(ring, two_way=True), *ends[0], *ends[1])).is_open("X") == passed


def test_reason_keeps_its_initial_distance() -> None:
    bench = Bench(plant(*lane("Z A B C D E F G H", two_way=True)), v="A", w="H")
    bench.want("v", "G")
    bench.want("w", "Z")
    bench.decided()
    reason = str(bench.manager.refusal_of("w"))
    assert "it would have to turn back" in str(reason)

    for reached in (1, 2, 3):
        bench.arrive("v", reached)
        bench.decided()
        assert str(bench.manager.refusal_of("w")) == reason


@pytest.mark.parametrize(("others", "way"), [(0, "BC"), (2, "XYC")])
def test_routes_avoid_points_with_much_traffic(others: int, way: str) -> None:
    around = [path("A X", 700), path("X Y", 700), path("Y C", 700)]
    fed = [one for number in range(others) for one in lane(f"P{number} B")]
    model = plant(path("A B", 1000), path("B C", 1000), path("B Q", 1000), *around, *fed)
    bench = Bench(model, v="A", **{f"w{number}": f"P{number}" for number in range(others)})
    for number in range(others):
        bench.want(f"w{number}", "Q")
    bench.decided()
    bench.want("v", "C")

    bench.decided()

    journey = bench.manager.route_of("v")
    assert journey
    assert "".join(each.point for each in journey.way) == way


def test_vehicles_that_wait_for_each_other_in_a_ring_make_room() -> None:
    """Each of four that fill a ring wants to go past the next one; one of them can leave it at a side."""
    ring = [*lane("A B C D A"), path("B X"), path("X C")]
    bench = Bench(plant(*ring), u="A", v="B", w="C", x="D")
    for vehicle, goal in (("u", "C"), ("v", "D"), ("w", "A"), ("x", "B")):
        bench.want(vehicle, goal)

    decided = bench.decided()

    assert [(type(each), each.vehicle) for each in decided] == [(Relocation, "v")]


def test_vehicle_beyond_its_section_holds_where_it_is() -> None:
    bench = Bench(plant(*lane("A B C D E F G H I J")), v="A")
    bench.want("v", "J")
    bench.decided()

    bench.arrive("v", len("BCDEFGH"))

    assert [each.point for each in bench.manager.held_by("v")] == ["H"]
    bench.decided()
    assert bench.claims("v") == "IJ"


def test_vehicle_beyond_its_section_can_finish() -> None:
    bench = Bench(plant(*lane("A B C D E F G H I J")), v="A")
    bench.want("v", "J")
    bench.decided()

    bench.manager.finish_route("v")

    assert [each.point for each in bench.manager.held_by("v")] == ["J"]


def test_turn_ends_at_the_goal() -> None:
    bench = Bench(plant(*lane("A B C"), *lane("C A"), *lane("D E F")), v="A", u="D")
    bench.want("v", "B")
    bench.decided()
    bench.manager.finish_route("v")
    bench.want("u", "F")

    bench.want("v", "B")

    assert sorted("vu", key=bench.manager._turn_of) == ["u", "v"]
