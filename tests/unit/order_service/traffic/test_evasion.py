"""Where a vehicle goes that rests in the way of others."""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.traffic.resources import ResourceSet, conflict
from nena_order_service.traffic.traffic_control import CANDIDATES_TRIED, Evader, overlap
from nena_shared.plant import PlantModel
from nena_shared.plant.point import PointType
from support.plants import path, plant
from support.traffic.scenes import Scene

BOTH_WAYS = 1000


def tracks(*ends: str, parking: str = "") -> PlantModel:
    """Make a plant of tracks of 1 m for both directions; ``parking`` names its parking positions."""
    made = plant(*(path(each, max_reverse_velocity_mm_s=BOTH_WAYS) for each in ends))
    park = {"type": PointType.PARK_POSITION}
    points = (each.model_copy(update=park if each.name in parking.split() else {}) for each in made.points)
    return made.model_copy(update={"points": tuple(points)})


class Bench:
    def __init__(self, model: PlantModel, *, length_mm: int = 0, **places: str) -> None:
        self.scene = Scene(model, length_mm=length_mm, **places)
        self._evader = Evader(model, self.scene.control.resources, self.scene.scheduler, self.scene)

    def evade(self, *blockers: str, kept: Iterable[str] = (), fixed: str = "") -> dict[str, str]:
        """Send vehicles away from the points ``kept``; gives the goal of each that goes."""
        kept_free = [self.scene.control.resources.at(each) for each in kept]
        found = self._evader.evade(blockers, kept_free, lambda name: name not in fixed.split())
        return {each.vehicle: each.route.points[-1] for each in found}

    def claimed(self, vehicle: str) -> list[str]:
        return [each.point for each in self.scene.scheduler.occupant(vehicle).claimed]


def test_it_goes_to_the_nearest_place_and_has_claimed_the_way() -> None:
    bench = Bench(tracks("A B", "B C", "C D"), w="B")
    assert bench.evade("w", kept=["A"]) == {"w": "C"}
    assert bench.claimed("w") == ["C"]


def test_where_vehicles_park_goes_before_what_is_near() -> None:
    bench = Bench(tracks("A B", "B C", "C D", "D P", parking="P"), w="B")
    assert bench.evade("w") == {"w": "P"}
    assert bench.claimed("w") == ["C", "D", "P"]


def test_a_place_that_somebody_stands_on_or_comes_to_is_none() -> None:
    bench = Bench(tracks("A B", "A C", "A D", "X D", "A Y", "Y Z", "X Q"), w="A", u="C", v="X")
    bench.scene.claim("v", "D")
    assert bench.evade("w", kept=["B"]) == {"w": "Y"}


def test_the_way_may_lead_over_what_is_kept_free_but_not_end_there() -> None:
    bench = Bench(tracks("A B", "B C"), w="A")
    assert bench.evade("w", kept=["B"]) == {"w": "C"}
    assert Bench(tracks("A B", "B C"), w="A").evade("w", kept=["B", "C"]) == {}


def test_a_long_vehicle_goes_as_far_as_it_takes_to_have_its_tail_out_of_the_way() -> None:
    model = tracks("A B", "B C", "C D", "D E")
    assert Bench(model, w="A").evade("w", kept=["B"]) == {"w": "C"}
    assert Bench(model, w="A", length_mm=1500).evade("w", kept=["B"]) == {"w": "D"}
    assert Bench(model, w="A", length_mm=2500).evade("w", kept=["B"]) == {"w": "E"}


def test_who_cannot_be_moved_stays_and_who_is_named_twice_goes_once() -> None:
    bench = Bench(tracks("A B", "B C", "C D"), w="B")
    assert bench.evade("w", fixed="w") == {}
    assert bench.claimed("w") == []
    assert list(bench._evader.evade(["w", "w"], [], lambda _: True))[1:] == []


def test_several_get_places_of_their_own() -> None:
    bench = Bench(tracks("A B", "A C", "X A", "X Y"), w="A", u="X")
    went = bench.evade("w", "u", kept=["A", "X"])
    assert went.keys() == {"w", "u"}
    assert len(set(went.values())) == 2


def test_who_is_enclosed_has_the_others_go_first_and_farther() -> None:
    """In a row with a free place for each, the last one goes first, behind the places of the others."""
    bench = Bench(tracks("A B", "B C", "C X", "X Y", "Y Z"), u="A", w="B", v="C")
    went = []
    for _ in range(3):
        (vehicle, goal), *others = bench.evade("u", kept=["A"]).items()
        assert others == []
        bench.scene.drive_to_end(vehicle)
        went.append((vehicle, goal))
    assert went == [("v", "Z"), ("w", "X"), ("u", "B")]


def test_nobody_goes_for_somebody_whom_that_would_not_let_out() -> None:
    bench = Bench(tracks("A B", "B C", "C X"), u="A", w="B", v="C")
    assert bench.evade("u", kept=["A"], fixed="v") == {}


@pytest.mark.parametrize(("behind", "goes"), [(CANDIDATES_TRIED - 1, {"w": "Far"}), (CANDIDATES_TRIED, {})])
def test_only_so_many_places_are_looked_at(behind: int, goes: dict[str, str]) -> None:
    """All places near are behind somebody who stays."""
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
