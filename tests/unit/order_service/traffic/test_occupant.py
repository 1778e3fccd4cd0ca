"""What a vehicle of some length covers."""

from __future__ import annotations

from collections import deque

import pytest

from nena_order_service.traffic.resources import Occupant, ResourceSet, covered_from

WAY = [
    ResourceSet(name, length, {name: None})
    for name, length in [("A", 0), ("B", 1000), ("C", 400), ("D", 700)]
]


@pytest.mark.parametrize(
    ("length_mm", "first"),
    [(0, 3), (700, 3), (701, 2), (1100, 2), (1101, 1), (2100, 1), (2101, 0), (9999, 0)],
)
def test_sets_that_a_vehicle_at_the_last_point_covers(length_mm: int, first: int) -> None:
    assert covered_from(WAY, 3, length_mm) == first


def state(occupant: Occupant) -> tuple[str, int, bool]:
    return occupant.point, occupant.ahead, occupant.resting


def test_what_is_behind_the_tail_is_free_and_what_is_ahead_is_kept() -> None:
    occupant = Occupant("v", 500, deque(WAY))

    assert occupant.arrive(1) == [WAY[0]]
    assert state(occupant) == ("B", 2, False)
    assert occupant.arrive(1) == []
    assert state(occupant) == ("C", 1, False)
    assert occupant.arrive(2) == WAY[1:3]
    assert state(occupant) == ("D", 0, True)


def test_a_vehicle_with_a_claim_does_not_rest() -> None:
    occupant = Occupant("v", 0, deque(WAY[:1]))
    occupant.claimed.extend(WAY[1:])

    assert state(occupant) == ("A", 0, False)
    assert occupant.at_end(occupant.claimed) == WAY[3:]
