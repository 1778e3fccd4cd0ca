"""Who may begin, who must wait and who must make room."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.traffic.relocation import CANDIDATES_TRIED, Relocator, find_conflict
from nena_order_service.traffic.resources import ResourceSet, conflict
from nena_order_service.traffic.route_search import RouteRequest
from nena_order_service.traffic.scheduler import UnknownOccupantError
from nena_shared.plant import PlantModel
from nena_shared.plant.model import Block, BlockType
from nena_shared.plant.track import Point
from nena_shared.plant_terms import PointType
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


def test_a_request_is_granted_if_the_route_is_free() -> None:
    scene = Scene(tracks("A B", "B C"), v="A")
    scene.manager.request_route(RouteRequest("v", "C"))

    assert list(scene.decide()) == ["RouteGrant v A B C"]
    assert list(scene.decide()) == []
    assert [each.point for each in scene.scheduler.occupant("v").claimed] == ["B", "C"]


def test_a_resting_blocker_prefers_parking_positions_over_nearer_points() -> None:
    scene = Scene(parking(tracks("A B", "B C", "B X", "B Y", "Y P"), "P"), v="A", w="B")
    scene.manager.request_route(RouteRequest("v", "C"))

    assert list(scene.decide()) == ["Relocation w B Y P"]
    assert str(scene.manager.refusal_of("v")) == "waits for w, which stands on 'B'"
    scene.drive_to_end("w")
    assert list(scene.decide()) == ["RouteGrant v A B C"]
    assert scene.manager.refusal_of("v") is None


def test_a_vehicle_operating_in_the_way_is_waited_for() -> None:
    scene = Scene(tracks("A B", "B C", "B X"), v="A", w="B")
    scene.manager.request_route(RouteRequest("v", "C"))

    assert list(scene.decide("w")) == []
    assert str(scene.manager.refusal_of("v")) == "waits for w, which stands on 'B'"


def test_a_vehicle_that_comes_to_rest_on_the_way_of_a_waiting_one_is_relocated() -> None:
    scene = Scene(tracks("A B", "B C", "C X"), v="A", w="B")
    scene.manager.request_route(RouteRequest("v", "C"))
    assert list(scene.decide("w")) == []

    scene.scheduler.place_at_rest("u", [scene.manager.resources.at_point("C")], length_mm=0)
    assert list(scene.decide("w")) == ["Relocation u C X"]


def test_only_a_short_detour_around_a_resting_vehicle_is_taken() -> None:
    short = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 1400), path("X C", 1400)), v="A", w="B"
    )
    short.manager.request_route(RouteRequest("v", "C"))
    assert list(short.decide("w")) == ["RouteGrant v A X C"]

    long = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 2000), path("X C", 2000)), v="A", w="B"
    )
    long.manager.request_route(RouteRequest("v", "C"))
    assert list(long.decide("w")) == []


def test_displacements_are_known_without_a_request() -> None:
    scene = Scene(plant(path("A B", 1000), path("B C", 1000), path("C D", 1000)), v="A", w="B")
    assert scene.manager.would_displace("v", "C")
    assert scene.manager.would_displace("v", "B")
    assert not scene.manager.would_displace("w", "D")
    assert not scene.manager.would_displace("w", "A"), "no route leads there"
    assert list(scene.decide()) == []


def test_a_short_detour_avoids_making_room() -> None:
    for length, displaces in ((1400, False), (2000, True)):
        around = path("A X", length), path("X C", length)
        scene = Scene(plant(path("A B", 1000), path("B C", 1000), *around), v="A", w="B")
        assert scene.manager.would_displace("v", "C") == displaces

    both = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 1000), path("X C", 1000)),
        v="A",
        w="B",
        u="X",
    )
    assert both.manager.would_displace("v", "C")


def test_a_vehicle_that_will_stop_in_the_way_must_make_room_too() -> None:
    scene = Scene(tracks("A B", "B C", "B D"), v="A", w="D")
    assert not scene.manager.would_displace("v", "C")
    scene.manager.request_route(RouteRequest("w", "B"))
    assert list(scene.decide()) == ["RouteGrant w D B"]
    assert scene.manager.would_displace("v", "C")


def test_two_vehicles_swap_positions_via_a_third() -> None:
    scene = Scene(tracks("A B", "B C", "B X"), v="A", w="C")
    scene.manager.request_route(RouteRequest("v", "C"))
    scene.manager.request_route(RouteRequest("w", "A"))

    assert list(scene.decide()) == ["Relocation w C B X"]
    scene.drive_to_end("w")
    assert list(scene.decide()) == ["RouteGrant v A B C", "RouteGrant w X B A"]
    scene.drive_to_end("v")
    scene.drive_to_end("w")


def test_an_enclosed_vehicle_is_let_out_first() -> None:
    scene = Scene(tracks("A B", "B C", "C X", "C Y"), v="A", u="B", w="C")
    scene.manager.request_route(RouteRequest("v", "B"))

    assert list(scene.decide()) == ["Relocation w C Y"]
    scene.drive_to_end("w")
    assert list(scene.decide()) == ["Relocation u B C"]
    scene.drive_to_end("u")
    assert list(scene.decide()) == ["RouteGrant v A B"]


def test_no_vehicle_stops_on_the_section_with_the_right_of_way() -> None:
    scene = Scene(tracks("A B", "B C", "C D", "D E", "E X"), v="A", w="E", u="C")
    scene.manager.request_route(RouteRequest("v", "D"))
    scene.manager.request_route(RouteRequest("w", "D"))

    assert list(scene.decide("u")) == []
    assert str(scene.manager.refusal_of("w")) == "waits for v, which goes first at 'D' (it has waited longer)"


def test_a_dropped_request_is_not_granted() -> None:
    scene = Scene(tracks("A B"), v="A")
    scene.manager.request_route(RouteRequest("v", "B"))

    scene.manager.drop_request("v")

    assert list(scene.decide()) == []


def test_a_vehicle_that_missed_its_goal_keeps_its_turn() -> None:
    scene = Scene(tracks("A B", "X B", "B C"), v="A", w="X")
    scene.manager.request_route(RouteRequest("v", "C"))
    scene.manager.request_route(RouteRequest("w", "C"), first=True)

    assert list(scene.decide()) == ["RouteGrant w X B C"]


def test_any_detour_around_a_lost_vehicle_is_taken() -> None:
    scene = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 9000), path("X C", 9000)), v="A", w="B"
    )
    scene.manager.request_route(RouteRequest("v", "C"))

    granted = list(scene.manager.decide(lambda name: name == "v", lambda name: name == "w"))

    assert [each.vehicle for each in granted] == ["v"]
    assert [each.point for each in scene.scheduler.occupant("v").claimed] == ["X", "C"]


def test_waiting_for_a_lost_vehicle_blocks_no_others() -> None:
    scene = Scene(tracks("A B", "B C", "X A", "X Y"), v="Y", w="B", u="A")
    scene.manager.request_route(RouteRequest("v", "C"))
    scene.manager.request_route(RouteRequest("u", "X"))

    granted = list(scene.manager.decide(lambda name: name != "w", lambda name: name == "w"))

    assert [each.vehicle for each in granted] == ["u"]


def test_a_straight_way_needs_the_point_at_its_end() -> None:
    scene = Scene(tracks("A B"), v="A", w="B")
    scene.manager.request_route(RouteRequest("v", "B", straight_mm=1500))
    assert list(scene.decide("w")) == []
    assert str(scene.manager.refusal_of("v")) == "waits for w, which stands on 'B'"

    scene.scheduler.remove("w")
    assert list(scene.decide()) == ["RouteGrant v "]
    assert [each.length_mm for each in scene.scheduler.occupant("v").claimed] == [1500]


def test_a_location_is_exclusive_also_for_a_vehicle_already_there() -> None:
    scene = Scene(tracks("A B"), v="A", w="B")
    scene.manager.request_route(RouteRequest("v", "A", at_goal=("Shelf",)))
    scene.manager.request_route(RouteRequest("w", "B", at_goal=("Shelf",)))

    assert list(scene.decide()) == ["RouteGrant v A"]
    assert (
        str(scene.manager.refusal_of("w"))
        == "waits for v, which goes first at 'Shelf' (they would block each other otherwise)"
    )
    assert scene.allocate("v") == ""
    assert list(scene.decide("v")) == []


def track(points: str, *, length_mm: int = 0, **places: str) -> Scene:
    """Make a single track along ``points`` that is driven in both directions."""
    names = points.split()
    paths = [path(f"{one} {other}", max_reverse_velocity_mm_s=BOTH_WAYS) for one, other in pairwise(names)]
    return Scene(plant(*paths), length_mm=length_mm, **places)


def test_held_resources_are_exclusive() -> None:
    scene = track("A B C D", v="A", w="C")
    assert scene.claim("v", "B") == ""
    assert scene.allocate("v") == ""

    assert (
        scene.claim("w", "B")
        == "waits for v, which goes first at 'B' (they would block each other otherwise)"
    )
    assert not scene.scheduler.occupant("w").claimed


def test_passed_resources_are_freed() -> None:
    scene = track("A B C D", v="A", w="D")
    scene.claim("v", "B")
    scene.drive_to_end("v")

    assert scene.scheduler.users_of("A") == frozenset()
    assert scene.scheduler.users_of("B") == {"v"}
    assert scene.scheduler.users_of("A --- B") == {"v"}


def test_a_way_over_a_resting_vehicle_is_refused_with_its_name() -> None:
    scene = track("A B C D", v="A", w="C")

    assert scene.claim("v", "D") == "waits for w, which stands on 'C'"
    assert scene.scheduler.resting_on("v", scene.way("v", "D")) == ("w",)


def test_only_one_of_two_oncoming_vehicles_enters_a_single_track() -> None:
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


def test_no_vehicle_stops_where_another_has_to_pass() -> None:
    scene = Scene(plant(path("A B"), path("B C"), path("X B"), path("B Y")), v="A", w="X")
    assert scene.claim("v", "C") == ""
    assert scene.claim("w", "B") == ""

    assert (
        scene.allocate("w") == "waits for v, which goes first at 'B' (they would block each other otherwise)"
    )
    scene.drive_to_end("v")
    assert scene.allocate("w") == ""


def test_a_cycle_of_vehicles_is_refused() -> None:
    scene = Scene(plant(path("A B"), path("B C"), path("C A")), u="A", v="B", w="C")

    assert scene.claim("u", "B") == "waits for v, which stands on 'B'"
    assert scene.claim("v", "C") == "waits for w, which stands on 'C'"
    assert scene.claim("w", "A") == "waits for u, which stands on 'A'"


def test_vehicles_follow_each_other_at_the_same_time() -> None:
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

    assert scene.scheduler.users_of("C") == {"v"}
    assert scene.scheduler.users_of("B --- C") == {"v"}
    assert scene.scheduler.users_of("B") == frozenset()


def test_dropping_a_claim_keeps_held_resources() -> None:
    scene = track("A B C D", v="A", w="D")
    scene.claim("v", "C")
    scene.allocate("v")

    scene.scheduler.give_up_claim("v")

    assert scene.scheduler.users_of("B") == {"v"}
    assert scene.scheduler.users_of("C") == frozenset()
    assert scene.claim("w", "C") == ""


def test_a_refused_claim_keeps_the_previous_one() -> None:
    scene = track("A B C D", v="A", w="D")
    scene.claim("v", "B")

    assert scene.claim("v", "D") == "waits for w, which stands on 'D'"

    assert [each.point for each in scene.scheduler.occupant("v").claimed] == ["B"]
    assert scene.scheduler.users_of("C") == frozenset()


def test_a_removed_vehicle_frees_everything() -> None:
    scene = track("A B C D", v="A", w="D")
    scene.claim("v", "C")
    scene.allocate("v")

    scene.scheduler.remove("v")

    assert "v" not in scene.scheduler
    assert all(scene.scheduler.users_of(name) <= {"w"} for name in ("A", "A --- B", "B", "B --- C", "C"))
    with pytest.raises(UnknownOccupantError, match="position of vehicle 'v' is unknown"):
        scene.scheduler.occupant("v")


def test_allocation_requires_a_claim() -> None:
    with pytest.raises(LookupError, match="claims nothing"):
        track("A B", v="A").allocate("v")


def test_a_vehicle_does_not_approach_a_resting_one_on_its_route() -> None:
    scene = track("A B C D", v="A", w="C")
    scene.claim("w", "D")
    scene.claim("v", "C")
    scene.scheduler.give_up_claim("w")

    assert scene.allocate("v") == "waits for w, which stands on 'C'"
    assert scene.claim("w", "D") == ""
    assert scene.allocate("v") == ""


def test_grants_from_before_a_restart_are_held_and_claimed() -> None:
    scene = track("A B C D", v="A", w="C")
    way = scene.way("v", "D")

    scene.scheduler.restore_claim("v", way[:2], way[2:])

    assert scene.scheduler.users_of("C") == {"v", "w"}
    assert scene.scheduler.find_sharer("w") == ("v", "C")
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
        self._relocator = Relocator(
            model, self.scene.manager.resources, self.scene.scheduler, self.scene.routes
        )

    def relocate(self, *blockers: str, kept: Iterable[str] = (), fixed: str = "") -> dict[str, str]:
        """Send vehicles away from the points ``kept``; return the goal of each that goes."""
        kept_free = [self.scene.manager.resources.at_point(each) for each in kept]
        found = self._relocator.relocate(blockers, kept_free, lambda name: name not in fixed.split())
        return {each.vehicle: each.route.points[-1] for each in found}

    def claimed(self, vehicle: str) -> list[str]:
        return [each.point for each in self.scene.scheduler.occupant(vehicle).claimed]


def test_evasion_claims_the_route_to_the_nearest_point() -> None:
    bench = Bench(tracks_of_evasion("A B", "B C", "C D"), w="B")
    assert bench.relocate("w", kept=["A"]) == {"w": "C"}
    assert bench.claimed("w") == ["C"]


def test_parking_positions_precede_near_points() -> None:
    bench = Bench(tracks_of_evasion("A B", "B C", "C D", "D P", parking="P"), w="B")
    assert bench.relocate("w") == {"w": "P"}
    assert bench.claimed("w") == ["C", "D", "P"]


def test_an_occupied_or_targeted_position_is_not_chosen() -> None:
    bench = Bench(tracks_of_evasion("A B", "A C", "A D", "X D", "A Y", "Y Z", "X Q"), w="A", u="C", v="X")
    bench.scene.claim("v", "D")
    assert bench.relocate("w", kept=["B"]) == {"w": "Y"}


def test_a_route_may_cross_but_not_end_on_what_is_kept_free() -> None:
    bench = Bench(tracks_of_evasion("A B", "B C"), w="A")
    assert bench.relocate("w", kept=["B"]) == {"w": "C"}
    assert Bench(tracks_of_evasion("A B", "B C"), w="A").relocate("w", kept=["B", "C"]) == {}


def test_a_vehicle_is_not_sent_past_a_stopped_one() -> None:
    """It would be stuck at once, its route would end, and it would be sent there again, without end."""
    bench = Bench(tracks_of_evasion("A B", "B C", "C D", "B E", "E F", "X C"), w="B", s="X")
    bench._relocator.closed = [bench.scene.manager.resources.at_point("C")]
    ways = [each.route.points for each in bench._relocator.relocate(["w"], [], lambda _: True)]
    assert ways == [("B", "A")]
    assert bench.relocate("s") == {}, "its only way out is closed"


def test_a_long_vehicle_drives_until_its_tail_is_clear() -> None:
    model = tracks_of_evasion("A B", "B C", "C D", "D E")
    assert Bench(model, w="A").relocate("w", kept=["B"]) == {"w": "C"}
    assert Bench(model, w="A", length_mm=1500).relocate("w", kept=["B"]) == {"w": "D"}
    assert Bench(model, w="A", length_mm=2500).relocate("w", kept=["B"]) == {"w": "E"}


def test_immovable_vehicles_stay_and_others_move_once() -> None:
    bench = Bench(tracks_of_evasion("A B", "B C", "C D"), w="B")
    assert bench.relocate("w", fixed="w") == {}
    assert bench.claimed("w") == []
    assert list(bench._relocator.relocate(["w", "w"], [], lambda _: True))[1:] == []


def test_several_vehicles_get_different_positions() -> None:
    bench = Bench(tracks_of_evasion("A B", "A C", "X A", "X Y"), w="A", u="X")
    went = bench.relocate("w", "u", kept=["A", "X"])
    assert went.keys() == {"w", "u"}
    assert len(set(went.values())) == 2


def test_vehicles_enclosing_another_move_first_and_farther() -> None:
    """In a row with a free place for each, the last one goes first, behind the places of the others."""
    bench = Bench(tracks_of_evasion("A B", "B C", "C X", "X Y", "Y Z"), u="A", w="B", v="C")
    went = []
    for _ in range(3):
        (vehicle, goal), *others = bench.relocate("u", kept=["A"]).items()
        assert others == []
        bench.scene.drive_to_end(vehicle)
        went.append((vehicle, goal))
    assert went == [("v", "Z"), ("w", "X"), ("u", "B")]


def test_no_vehicle_moves_if_that_would_not_let_another_out() -> None:
    bench = Bench(tracks_of_evasion("A B", "B C", "C X"), u="A", w="B", v="C")
    assert bench.relocate("u", kept=["A"], fixed="v") == {}


@pytest.mark.parametrize(("behind", "goes"), [(CANDIDATES_TRIED - 1, {"w": "Far"}), (CANDIDATES_TRIED, {})])
def test_the_number_of_points_tried_is_limited(behind: int, goes: dict[str, str]) -> None:
    """Put a vehicle that stays before all near places."""
    near = [path("H Gate", 100), *(path(f"Gate N{number}", 100) for number in range(behind))]
    bench = Bench(plant(*near, path("H Far", 5000)), w="H", u="Gate")
    assert bench.relocate("w", fixed="u") == goes


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
    found = find_conflict(one, other)
    assert found in wanted if wanted else found is None
    assert (find_conflict(other, one) is None) is (found is None)


@pytest.mark.parametrize(
    ("one", "other", "overlapping"),
    [("north", "north", False), ("north", "south", True), (None, "north", True), (None, None, True)],
)
def test_one_direction_is_shared(one: str | None, other: str | None, *, overlapping: bool) -> None:
    def using(direction: str | None) -> list[ResourceSet]:
        return [ResourceSet("P", 0, {"Aisle": direction})]

    assert find_conflict(using(one), using(other)) == ("Aisle" if overlapping else None)
    assert find_conflict(using(other), using(one)) == ("Aisle" if overlapping else None)
