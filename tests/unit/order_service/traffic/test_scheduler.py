"""Claims, allocations and what they let others do."""

from __future__ import annotations

from itertools import pairwise

import pytest

from nena_order_service.traffic.traffic_control import UnknownOccupantError
from nena_shared.plant.block import Block, BlockType
from support.plants import path, plant
from support.traffic.scenes import Scene

BOTH_WAYS = 1000


def track(points: str, *, length_mm: int = 0, **places: str) -> Scene:
    """Make a single track along ``points`` that is driven in both directions."""
    names = points.split()
    paths = [path(f"{one} {other}", max_reverse_velocity_mm_s=BOTH_WAYS) for one, other in pairwise(names)]
    return Scene(plant(*paths), length_mm=length_mm, **places)


def test_what_one_vehicle_holds_nobody_else_gets() -> None:
    scene = track("A B C D", v="A", w="C")
    assert scene.claim("v", "B") == ""
    assert scene.allocate("v") == ""

    assert scene.claim("w", "B") == "lets v go first at 'B'"
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

    assert scene.claim("v", "D") == "waits for 'C', where w rests"
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

    assert scene.allocate("w") == "lets v go first at 'C'"
    scene.drive("v")
    scene.drive_to_end("v")
    scene.drive_to_end("w")

    assert scene.scheduler.occupant("v").point == "Y"
    assert scene.scheduler.occupant("w").point == "X"


def test_nobody_comes_to_rest_where_somebody_else_has_still_to_pass() -> None:
    scene = Scene(plant(path("A B"), path("B C"), path("X B"), path("B Y")), v="A", w="X")
    assert scene.claim("v", "C") == ""
    assert scene.claim("w", "B") == ""

    assert scene.allocate("w") == "lets v go first at 'B'"
    scene.drive_to_end("v")
    assert scene.allocate("w") == ""


def test_a_ring_of_vehicles_in_which_each_wants_the_next_ones_place_is_not_begun() -> None:
    scene = Scene(plant(path("A B"), path("B C"), path("C A")), u="A", v="B", w="C")

    assert scene.claim("u", "B") == "waits for 'B', where v rests"
    assert scene.claim("v", "C") == "waits for 'C', where w rests"
    assert scene.claim("w", "A") == "waits for 'A', where u rests"


def test_one_behind_the_other_they_drive_at_the_same_time() -> None:
    scene = track("A B C D E", v="A", w="B")
    assert scene.claim("w", "E") == ""
    assert scene.claim("v", "D") == ""

    assert scene.allocate("v") == "waits for 'B', which w holds"
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

    assert scene.allocate("w") == "waits for 'Crossing', which v holds"
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


def test_one_who_stands_for_good_keeps_the_way_to_the_next_point_alone() -> None:
    scene = track("A B C D", v="A")
    scene.claim("v", "D")
    for _ in range(3):
        scene.allocate("v")

    scene.scheduler.stand("v")

    assert scene.scheduler.users("A") == {"v"}
    assert scene.scheduler.users("B") == {"v"}
    assert scene.scheduler.users("C") == frozenset()
    assert scene.scheduler.occupant("v").resting


def test_a_refused_claim_leaves_the_one_before() -> None:
    scene = track("A B C D", v="A", w="D")
    scene.claim("v", "B")

    assert scene.claim("v", "D") == "waits for 'D', where w rests"

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

    assert scene.allocate("v") == "waits for 'C', where w rests"
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
