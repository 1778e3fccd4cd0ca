"""Who may begin, who must wait and who must make room."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.traffic.evasion import CANDIDATES_TRIED, Evader, Evasion, overlap
from nena_order_service.traffic.resources import ResourceSet, conflict
from nena_order_service.traffic.scheduler import UnknownOccupantError
from nena_order_service.traffic.traffic_control import RouteGrant, RouteRequest
from nena_shared.plant import PlantModel
from nena_shared.plant.model import Block, BlockType
from nena_shared.plant.track import Point, PointType
from support.plants import path, plant
from support.traffic.scenes import Scene

BOTH_WAYS = 1000


def parking(model: PlantModel, *names: str) -> PlantModel:
    """Make these points parking positions."""
    points = tuple(
        Point(name=each.name, x_mm=0, y_mm=0, type=PointType.PARK_POSITION) if each.name in names else each
        for each in model.points
    )
    return model.model_copy(update={"points": points})


def tracks(*ends: str) -> PlantModel:
    return plant(*(path(each, max_reverse_velocity_mm_s=BOTH_WAYS) for each in ends))


def test_a_wish_is_granted_where_the_way_is_free() -> None:
    scene = Scene(tracks("A B", "B C"), v="A")
    scene.control.request_route(RouteRequest("v", "C"))

    assert list(scene.decide()) == ["RouteGrant v A B C"]
    assert list(scene.decide()) == []
    assert [each.point for each in scene.scheduler.occupant("v").claimed] == ["B", "C"]


def test_only_so_many_routes_are_searched_in_one_decision_and_the_rest_in_the_next() -> None:
    scene = Scene(plant(*(path(f"A{n} B{n}") for n in range(3))), v="A0", w="A1", x="A2")
    for number, name in enumerate("vwx"):
        scene.control.request_route(RouteRequest(name, f"B{number}"))

    first = scene.control.decide(lambda _: True, searches=2)
    assert [each.vehicle for each in first if isinstance(each, RouteGrant)] == ["v", "w"]
    assert scene.control.unfinished
    second = scene.control.decide(lambda _: True, searches=2)
    assert [each.vehicle for each in second if isinstance(each, RouteGrant)] == ["x"]
    assert not scene.control.unfinished


def test_a_route_that_is_known_needs_no_search() -> None:
    scene = Scene(tracks("A B", "B C", "X C"), v="A", w="B", x="X")
    for name in "vx":
        scene.control.request_route(RouteRequest(name, "B"))
    for _ in range(2):
        list(scene.control.decide(lambda name: name != "w", searches=1))
    assert not scene.control.unfinished, "both are refused, with routes that are kept"


def test_searches_for_free_places_are_left_to_the_next_decisions_and_each_vehicle_has_its_turn() -> None:
    hopeless = [f"A{n} B{n}|B{n} X{n}|X{n} {n}0" for n in (1, 2)]
    behind = [f"{n}{end} {n}{end + 1}" for n in (1, 2) for end in range(8)]
    ends = [*"|".join(hopeless).split("|"), *behind, "A3 B3", "B3 C3", "B3 D3"]
    scene = Scene(tracks(*ends), a1="A1", b1="B1", x1="X1", a2="A2", b2="B2", x2="X2", a3="A3", b3="B3")
    for n, goal in ((1, "X1"), (2, "X2"), (3, "C3")):
        scene.control.request_route(RouteRequest(f"a{n}", goal))

    sent, searches = list[str](), list[int]()
    for _ in range(40):
        before = scene.routes.searches
        found = scene.control.decide(lambda name: name not in ("x1", "x2"), searches=2)
        sent += [each.vehicle for each in found if isinstance(each, Evasion)]
        searches.append(scene.routes.searches - before)
        if not scene.control.unfinished:
            break

    assert not scene.control.unfinished, searches
    assert sent == ["b3"], "the ways out of the others are blocked"
    assert max(searches) <= 2 + 2, "a vehicle that has its turn may need two more"
    assert sum(searches) > 20, "the others were tried"


def test_who_rests_in_the_way_goes_to_a_parking_place_though_others_are_nearer() -> None:
    scene = Scene(parking(tracks("A B", "B C", "B X", "B Y", "Y P"), "P"), v="A", w="B")
    scene.control.request_route(RouteRequest("v", "C"))

    assert list(scene.decide()) == ["Evasion w B Y P"]
    assert str(scene.control.why_waiting("v")) == "waits for w, which stands on 'B'"
    scene.drive_to_end("w")
    assert list(scene.decide()) == ["RouteGrant v A B C"]
    assert scene.control.why_waiting("v") is None


def test_who_works_where_it_stands_is_waited_for() -> None:
    scene = Scene(tracks("A B", "B C", "B X"), v="A", w="B")
    scene.control.request_route(RouteRequest("v", "C"))

    assert list(scene.decide("w")) == []
    assert str(scene.control.why_waiting("v")) == "waits for w, which stands on 'B'"


def test_a_short_detour_around_somebody_who_rests_is_taken_and_a_long_one_is_not() -> None:
    short = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 1400), path("X C", 1400)), v="A", w="B"
    )
    short.control.request_route(RouteRequest("v", "C"))
    assert list(short.decide("w")) == ["RouteGrant v A X C"]

    long = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 2000), path("X C", 2000)), v="A", w="B"
    )
    long.control.request_route(RouteRequest("v", "C"))
    assert list(long.decide("w")) == []


def test_whether_others_would_have_to_make_room_is_known_before_anybody_is_asked_to() -> None:
    scene = Scene(plant(path("A B", 1000), path("B C", 1000), path("C D", 1000)), v="A", w="B")
    assert scene.control.displaces(RouteRequest("v", "C"))
    assert scene.control.displaces(RouteRequest("v", "B"))
    assert not scene.control.displaces(RouteRequest("w", "D"))
    assert not scene.control.displaces(RouteRequest("w", "A")), "no route leads there"
    assert list(scene.decide()) == []


def test_nobody_has_to_make_room_where_a_short_detour_leads_around() -> None:
    for length, displaces in ((1400, False), (2000, True)):
        around = path("A X", length), path("X C", length)
        scene = Scene(plant(path("A B", 1000), path("B C", 1000), *around), v="A", w="B")
        assert scene.control.displaces(RouteRequest("v", "C")) == displaces

    both = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 1000), path("X C", 1000)),
        v="A",
        w="B",
        u="X",
    )
    assert both.control.displaces(RouteRequest("v", "C"))


def test_somebody_who_comes_to_rest_in_the_way_would_have_to_make_room_too() -> None:
    scene = Scene(tracks("A B", "B C", "B D"), v="A", w="D")
    assert not scene.control.displaces(RouteRequest("v", "C"))
    scene.control.request_route(RouteRequest("w", "B"))
    assert list(scene.decide()) == ["RouteGrant w D B"]
    assert scene.control.displaces(RouteRequest("v", "C"))


def test_two_who_want_each_others_places_change_them_by_way_of_a_third() -> None:
    scene = Scene(tracks("A B", "B C", "B X"), v="A", w="C")
    scene.control.request_route(RouteRequest("v", "C"))
    scene.control.request_route(RouteRequest("w", "A"))

    assert list(scene.decide()) == ["Evasion w C B X"]
    scene.drive_to_end("w")
    assert list(scene.decide()) == ["RouteGrant v A B C", "RouteGrant w X B A"]
    scene.drive_to_end("v")
    scene.drive_to_end("w")


def test_somebody_who_is_enclosed_is_let_out_first() -> None:
    scene = Scene(tracks("A B", "B C", "C X", "C Y"), v="A", u="B", w="C")
    scene.control.request_route(RouteRequest("v", "B"))

    assert list(scene.decide()) == ["Evasion w C Y"]
    scene.drive_to_end("w")
    assert list(scene.decide()) == ["Evasion u B C"]
    scene.drive_to_end("u")
    assert list(scene.decide()) == ["RouteGrant v A B"]


def test_nobody_comes_to_rest_on_the_way_of_the_one_who_has_waited_longest() -> None:
    scene = Scene(tracks("A B", "B C", "C D", "D E", "E X"), v="A", w="E", u="C")
    scene.control.request_route(RouteRequest("v", "D"))
    scene.control.request_route(RouteRequest("w", "D"))

    assert list(scene.decide("u")) == []
    assert (
        str(scene.control.why_waiting("w")) == "waits for v, which goes first at 'D' (it has waited longer)"
    )


def test_a_wish_that_is_dropped_is_not_granted() -> None:
    scene = Scene(tracks("A B"), v="A")
    scene.control.request_route(RouteRequest("v", "B"))

    scene.control.drop("v")

    assert list(scene.decide()) == []


def test_who_had_its_turn_and_could_not_come_to_its_goal_is_first_again() -> None:
    scene = Scene(tracks("A B", "X B", "B C"), v="A", w="X")
    scene.control.request_route(RouteRequest("v", "C"))
    scene.control.request_route(RouteRequest("w", "C"), first=True)

    assert scene.control.requesting == ("w", "v")
    assert list(scene.decide()) == ["RouteGrant w X B C"]


def test_around_somebody_who_is_lost_any_detour_is_taken() -> None:
    scene = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 9000), path("X C", 9000)), v="A", w="B"
    )
    scene.control.request_route(RouteRequest("v", "C"))

    granted = list(scene.control.decide(lambda name: name == "v", lambda name: name == "w"))

    assert [each.vehicle for each in granted] == ["v"]
    assert [each.point for each in scene.scheduler.occupant("v").claimed] == ["X", "C"]


def test_who_waits_for_somebody_who_is_lost_keeps_nobody_else_from_anything() -> None:
    scene = Scene(tracks("A B", "B C", "X A", "X Y"), v="Y", w="B", u="A")
    scene.control.request_route(RouteRequest("v", "C"))
    scene.control.request_route(RouteRequest("u", "X"))

    granted = list(scene.control.decide(lambda name: name != "w", lambda name: name == "w"))

    assert [each.vehicle for each in granted] == ["u"]


def test_a_straight_way_needs_the_point_at_its_end() -> None:
    scene = Scene(tracks("A B"), v="A", w="B")
    scene.control.request_route(RouteRequest("v", "B", straight_mm=1500))
    assert list(scene.decide("w")) == []
    assert str(scene.control.why_waiting("v")) == "waits for w, which stands on 'B'"

    scene.scheduler.remove("w")
    assert list(scene.decide()) == ["RouteGrant v "]
    assert [each.length_mm for each in scene.scheduler.occupant("v").claimed] == [1500]


def test_a_location_is_one_vehicles_also_where_that_stands_there_already() -> None:
    scene = Scene(tracks("A B"), v="A", w="B")
    scene.control.request_route(RouteRequest("v", "A", location="Shelf"))
    scene.control.request_route(RouteRequest("w", "B", location="Shelf"))

    assert list(scene.decide()) == ["RouteGrant v A"]
    assert (
        str(scene.control.why_waiting("w"))
        == "waits for v, which goes first at 'Shelf' (they would block each other otherwise)"
    )
    assert scene.allocate("v") == ""
    assert list(scene.decide("v")) == []


def track(points: str, *, length_mm: int = 0, **places: str) -> Scene:
    """Make a single track along ``points`` that is driven in both directions."""
    names = points.split()
    paths = [path(f"{one} {other}", max_reverse_velocity_mm_s=BOTH_WAYS) for one, other in pairwise(names)]
    return Scene(plant(*paths), length_mm=length_mm, **places)


def test_what_one_vehicle_holds_nobody_else_gets() -> None:
    scene = track("A B C D", v="A", w="C")
    assert scene.claim("v", "B") == ""
    assert scene.allocate("v") == ""

    assert (
        scene.claim("w", "B")
        == "waits for v, which goes first at 'B' (they would block each other otherwise)"
    )
    assert not scene.scheduler.occupant("w").claimed


def test_what_is_left_behind_is_free() -> None:
    scene = track("A B C D", v="A", w="D")
    scene.claim("v", "B")
    scene.drive_to_end("v")

    assert scene.scheduler.users("A") == frozenset()
    assert scene.scheduler.users("B") == {"v"}
    assert scene.scheduler.users("A --- B") == {"v"}


def test_a_way_over_somebody_who_rests_is_refused_with_who_it_is() -> None:
    scene = track("A B C D", v="A", w="C")

    assert scene.claim("v", "D") == "waits for w, which stands on 'C'"
    assert scene.scheduler.resting_on("v", scene.way("v", "D")) == ("w",)


def test_two_who_want_to_pass_each_other_on_a_single_track_are_not_both_let_in() -> None:
    scene = Scene(
        plant(
            *(
                path(ends, max_reverse_velocity_mm_s=BOTH_WAYS)
                for ends in ("A B", "B C", "C D", "B X", "C Y")
            ),
        ),
        v="A",
        w="D",
    )
    assert scene.claim("v", "Y") == ""
    assert scene.claim("w", "X") == ""
    assert scene.allocate("v") == ""  # to B: w must wait until v has left it

    assert (
        scene.allocate("w") == "waits for v, which goes first at 'C' (they would block each other otherwise)"
    )
    scene.drive("v")
    scene.drive_to_end("v")
    scene.drive_to_end("w")

    assert scene.scheduler.occupant("v").point == "Y"
    assert scene.scheduler.occupant("w").point == "X"


def test_nobody_comes_to_rest_where_somebody_else_has_still_to_pass() -> None:
    scene = Scene(plant(path("A B"), path("B C"), path("X B"), path("B Y")), v="A", w="X")
    assert scene.claim("v", "C") == ""
    assert scene.claim("w", "B") == ""

    assert (
        scene.allocate("w") == "waits for v, which goes first at 'B' (they would block each other otherwise)"
    )
    scene.drive_to_end("v")
    assert scene.allocate("w") == ""


def test_a_ring_of_vehicles_in_which_each_wants_the_next_ones_place_is_not_begun() -> None:
    scene = Scene(plant(path("A B"), path("B C"), path("C A")), u="A", v="B", w="C")

    assert scene.claim("u", "B") == "waits for v, which stands on 'B'"
    assert scene.claim("v", "C") == "waits for w, which stands on 'C'"
    assert scene.claim("w", "A") == "waits for u, which stands on 'A'"


def test_one_behind_the_other_they_drive_at_the_same_time() -> None:
    scene = track("A B C D E", v="A", w="B")
    assert scene.claim("w", "E") == ""
    assert scene.claim("v", "D") == ""

    assert scene.allocate("v") == "waits for w, which passes 'B' first"
    assert scene.allocate("w") == ""
    scene.drive("w")
    assert scene.allocate("v") == ""
    assert scene.allocate("w") == ""


def test_a_block_holds_one_vehicle() -> None:
    block = Block(name="Crossing", members=("B", "Y"))
    scene = Scene(plant(path("A B"), path("B C"), path("X Y"), path("Y Z"), blocks=(block,)), v="A", w="X")
    scene.claim("v", "C")
    scene.claim("w", "Z")
    assert scene.allocate("v") == ""

    assert scene.allocate("w") == "waits for v, which passes 'Crossing' first"
    scene.drive("v")
    assert scene.allocate("v") == ""
    scene.drive("v")
    assert scene.allocate("w") == ""


@pytest.mark.parametrize(("direction", "let_in"), [("north", True), ("south", False)])
def test_a_same_direction_block_holds_those_of_one_direction(direction: str, let_in: bool) -> None:  # noqa: FBT001 - an example
    block = Block(name="Aisle", type=BlockType.SAME_DIRECTION_ONLY, members=("B", "Y"))
    scene = Scene(
        plant(
            path("A B", properties={"tcs:blockEntryDirection": "north"}),
            path("B C"),
            path("X Y", properties={"tcs:blockEntryDirection": direction}),
            path("Y Z"),
            blocks=(block,),
        ),
        v="A",
        w="X",
    )
    scene.claim("v", "C")
    scene.claim("w", "Z")
    scene.allocate("v")

    assert (scene.allocate("w") == "") is let_in


def test_a_long_vehicle_keeps_what_its_tail_covers() -> None:
    scene = track("A B C D", length_mm=1500, v="A")
    scene.claim("v", "D")
    scene.drive_to_end("v")

    assert scene.scheduler.users("C") == {"v"}
    assert scene.scheduler.users("B --- C") == {"v"}
    assert scene.scheduler.users("B") == frozenset()


def test_a_claim_that_is_given_up_leaves_what_is_held() -> None:
    scene = track("A B C D", v="A", w="D")
    scene.claim("v", "C")
    scene.allocate("v")

    scene.scheduler.give_up_claim("v")

    assert scene.scheduler.users("B") == {"v"}
    assert scene.scheduler.users("C") == frozenset()
    assert scene.claim("w", "C") == ""


def test_a_refused_claim_leaves_the_one_before() -> None:
    scene = track("A B C D", v="A", w="D")
    scene.claim("v", "B")

    assert scene.claim("v", "D") == "waits for w, which stands on 'D'"

    assert [each.point for each in scene.scheduler.occupant("v").claimed] == ["B"]
    assert scene.scheduler.users("C") == frozenset()


def test_a_vehicle_that_is_taken_out_frees_everything() -> None:
    scene = track("A B C D", v="A", w="D")
    scene.claim("v", "C")
    scene.allocate("v")

    scene.scheduler.remove("v")

    assert "v" not in scene.scheduler
    assert all(scene.scheduler.users(name) <= {"w"} for name in ("A", "A --- B", "B", "B --- C", "C"))
    with pytest.raises(UnknownOccupantError, match="place vehicle 'v'"):
        scene.scheduler.occupant("v")


def test_who_claims_nothing_is_allocated_nothing() -> None:
    with pytest.raises(LookupError, match="claims nothing"):
        track("A B", v="A").allocate("v")


def test_who_finds_somebody_resting_farther_on_its_way_does_not_come_nearer() -> None:
    scene = track("A B C D", v="A", w="C")
    scene.claim("w", "D")
    scene.claim("v", "C")
    scene.scheduler.give_up_claim("w")

    assert scene.allocate("v") == "waits for w, which stands on 'C'"
    assert scene.claim("w", "D") == ""
    assert scene.allocate("v") == ""


def test_what_was_granted_before_a_restart_is_held_and_claimed_unasked() -> None:
    scene = track("A B C D", v="A", w="C")
    way = scene.way("v", "D")

    scene.scheduler.resume("v", way[:2], way[2:])

    assert scene.scheduler.users("C") == {"v", "w"}
    assert scene.scheduler.sharing("w") == ("v", "C")
    assert scene.scheduler.occupant("v").ahead == 2
    scene.scheduler.seize("v")
    assert scene.scheduler.occupant("v").ahead == 3
    assert not scene.scheduler.occupant("v").claimed


def tracks_of_evasion(*ends: str, parking: str = "") -> PlantModel:
    """Make a plant of tracks of 1 m for both directions; ``parking`` names its parking positions."""
    made = plant(*(path(each, max_reverse_velocity_mm_s=BOTH_WAYS) for each in ends))
    park = {"type": PointType.PARK_POSITION}
    points = (each.model_copy(update=park if each.name in parking.split() else {}) for each in made.points)
    return made.model_copy(update={"points": tuple(points)})


class Bench:
    def __init__(self, model: PlantModel, *, length_mm: int = 0, **places: str) -> None:
        self.scene = Scene(model, length_mm=length_mm, **places)
        self._evader = Evader(model, self.scene.control.resources, self.scene.scheduler, self.scene.routes)

    def evade(self, *blockers: str, kept: Iterable[str] = (), fixed: str = "") -> dict[str, str]:
        """Send vehicles away from the points ``kept``; return the goal of each that goes."""
        kept_free = [self.scene.control.resources.at(each) for each in kept]
        found = self._evader.evade(blockers, kept_free, lambda name: name not in fixed.split())
        return {each.vehicle: each.route.points[-1] for each in found}

    def claimed(self, vehicle: str) -> list[str]:
        return [each.point for each in self.scene.scheduler.occupant(vehicle).claimed]


def test_it_goes_to_the_nearest_place_and_has_claimed_the_way() -> None:
    bench = Bench(tracks_of_evasion("A B", "B C", "C D"), w="B")
    assert bench.evade("w", kept=["A"]) == {"w": "C"}
    assert bench.claimed("w") == ["C"]


def test_where_vehicles_park_goes_before_what_is_near() -> None:
    bench = Bench(tracks_of_evasion("A B", "B C", "C D", "D P", parking="P"), w="B")
    assert bench.evade("w") == {"w": "P"}
    assert bench.claimed("w") == ["C", "D", "P"]


def test_a_place_that_somebody_stands_on_or_comes_to_is_none() -> None:
    bench = Bench(tracks_of_evasion("A B", "A C", "A D", "X D", "A Y", "Y Z", "X Q"), w="A", u="C", v="X")
    bench.scene.claim("v", "D")
    assert bench.evade("w", kept=["B"]) == {"w": "Y"}


def test_the_way_may_lead_over_what_is_kept_free_but_not_end_there() -> None:
    bench = Bench(tracks_of_evasion("A B", "B C"), w="A")
    assert bench.evade("w", kept=["B"]) == {"w": "C"}
    assert Bench(tracks_of_evasion("A B", "B C"), w="A").evade("w", kept=["B", "C"]) == {}


def test_a_long_vehicle_goes_as_far_as_it_takes_to_have_its_tail_out_of_the_way() -> None:
    model = tracks_of_evasion("A B", "B C", "C D", "D E")
    assert Bench(model, w="A").evade("w", kept=["B"]) == {"w": "C"}
    assert Bench(model, w="A", length_mm=1500).evade("w", kept=["B"]) == {"w": "D"}
    assert Bench(model, w="A", length_mm=2500).evade("w", kept=["B"]) == {"w": "E"}


def test_who_cannot_be_moved_stays_and_who_is_named_twice_goes_once() -> None:
    bench = Bench(tracks_of_evasion("A B", "B C", "C D"), w="B")
    assert bench.evade("w", fixed="w") == {}
    assert bench.claimed("w") == []
    assert list(bench._evader.evade(["w", "w"], [], lambda _: True))[1:] == []


def test_several_get_places_of_their_own() -> None:
    bench = Bench(tracks_of_evasion("A B", "A C", "X A", "X Y"), w="A", u="X")
    went = bench.evade("w", "u", kept=["A", "X"])
    assert went.keys() == {"w", "u"}
    assert len(set(went.values())) == 2


def test_who_is_enclosed_has_the_others_go_first_and_farther() -> None:
    """In a row with a free place for each, the last one goes first, behind the places of the others."""
    bench = Bench(tracks_of_evasion("A B", "B C", "C X", "X Y", "Y Z"), u="A", w="B", v="C")
    went = []
    for _ in range(3):
        (vehicle, goal), *others = bench.evade("u", kept=["A"]).items()
        assert others == []
        bench.scene.drive_to_end(vehicle)
        went.append((vehicle, goal))
    assert went == [("v", "Z"), ("w", "X"), ("u", "B")]


def test_nobody_goes_for_somebody_whom_that_would_not_let_out() -> None:
    bench = Bench(tracks_of_evasion("A B", "B C", "C X"), u="A", w="B", v="C")
    assert bench.evade("u", kept=["A"], fixed="v") == {}


@pytest.mark.parametrize(("behind", "goes"), [(CANDIDATES_TRIED - 1, {"w": "Far"}), (CANDIDATES_TRIED, {})])
def test_only_so_many_places_are_looked_at(behind: int, goes: dict[str, str]) -> None:
    """Put a vehicle that stays before all near places."""
    near = [path("H Gate", 100), *(path(f"Gate N{number}", 100) for number in range(behind))]
    bench = Bench(plant(*near, path("H Far", 5000)), w="H", u="Gate")
    assert bench.evade("w", fixed="u") == goes


USES = st.dictionaries(st.sampled_from("abc"), st.sampled_from([None, "north", "south"]), max_size=3)
SETS = st.lists(st.builds(ResourceSet, point=st.just("P"), length_mm=st.just(0), uses=USES), max_size=3)


@given(SETS, SETS)
def test_sets_overlap_where_two_vehicles_are_in_conflict(
    one: list[ResourceSet], other: list[ResourceSet]
) -> None:
    wanted = {
        name
        for each in one
        for name, direction in each.uses.items()
        if any(name in also.uses and conflict(direction, also.uses[name]) for also in other)
    }
    found = overlap(one, other)
    assert found in wanted if wanted else found is None
    assert (overlap(other, one) is None) is (found is None)


@pytest.mark.parametrize(
    ("one", "other", "overlapping"),
    [("north", "north", False), ("north", "south", True), (None, "north", True), (None, None, True)],
)
def test_one_direction_is_shared(one: str | None, other: str | None, *, overlapping: bool) -> None:
    def using(direction: str | None) -> list[ResourceSet]:
        return [ResourceSet("P", 0, {"Aisle": direction})]

    assert overlap(using(one), using(other)) == ("Aisle" if overlapping else None)
    assert overlap(using(other), using(one)) == ("Aisle" if overlapping else None)
