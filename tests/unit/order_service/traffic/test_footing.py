"""What is under a vehicle that was found somewhere."""

from __future__ import annotations

import pytest

from nena_order_service.traffic.resources import Footings, Found, Resources
from nena_shared.plant import PlantModel
from nena_shared.plant.block import Block
from nena_shared.plant.geometry import BoundingBox
from support.plants import path, point

PLANT = PlantModel(
    name="corner",
    points=(
        point("A"),
        point("B", 4000),
        point("C", 4000, 3000),
        point("far", 0, 50_000),
        point("above", 0, 0, properties={"vda5050:mapId": "upstairs"}),
    ),
    paths=(path("A B", 4000), path("B C", 3000)),
    blocks=(Block(name="corner", members=("B",)),),
)


def under(found: Found, length_mm: int = 1000) -> set[str]:
    footings = Footings(PLANT, Resources(PLANT))
    return set(footings.of(found, BoundingBox(length_mm=length_mm)).under.uses)


@pytest.mark.parametrize(
    ("found", "length_mm", "expected"),
    [
        (Found("A", on_point=True), 1000, {"A"}),
        (Found("B", on_point=True, place_mm=(3900.0, 0.0), map_id="hall"), 1000, {"B", "corner"}),
        (Found("A", on_point=True, place_mm=(0.0, 0.0), map_id="hall"), 8200, {"A", "B", "corner"}),
        (Found("A", on_point=False, place_mm=(1500.0, 300.0), map_id="hall"), 1000, {"A --- B"}),
        (
            Found("B", on_point=False, place_mm=(3700.0, 200.0), map_id="hall"),
            1000,
            {"A --- B", "B --- C", "B", "corner"},
        ),
        (Found("far", on_point=False, place_mm=(9000.0, 40_000.0), map_id="hall"), 1000, set()),
    ],
    ids=["as it says", "on a point", "long", "on a path", "near a corner", "off the plant"],
)
def test_what_is_under_a_vehicle(found: Found, length_mm: int, expected: set[str]) -> None:
    assert under(found, length_mm) == expected


def test_a_vehicle_beside_its_point_needs_that_to_come_to_it() -> None:
    footings = Footings(PLANT, Resources(PLANT))

    beside = footings.of(Found("B", on_point=False, place_mm=(4000.0, 700.0)), BoundingBox())
    on_it = footings.of(Found("B", on_point=True, place_mm=(4000.0, 100.0)), BoundingBox())

    assert on_it.entry is None
    assert beside.entry is not None
    assert (beside.entry.point, beside.entry.length_mm) == ("B", 700)
    assert set(beside.entry.uses) == {"B", "corner"}


def test_the_reference_point_may_be_far_from_the_middle() -> None:
    footings = Footings(PLANT, Resources(PLANT))
    box = BoundingBox(length_mm=1000, reference_offset_x_mm=3600)

    found = footings.of(Found("A", on_point=True, place_mm=(0.0, 0.0), map_id="hall"), box)

    assert set(found.under.uses) == {"A", "B", "corner"}
