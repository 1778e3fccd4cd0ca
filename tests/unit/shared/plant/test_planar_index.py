"""What is found by the grid is what is found by looking at everything."""

from __future__ import annotations

from math import hypot

import hypothesis.strategies as st
from hypothesis import given, settings

from nena_shared.plant.planar_index import Box, PlanarIndex

COORDINATES = st.integers(-50, 50) | st.sampled_from([-1e6, 0.5, 2e5, 1e9])
PLACES = st.tuples(COORDINATES, COORDINATES)


@settings(max_examples=300)
@given(st.lists(PLACES, max_size=30), PLACES)
def test_the_first_of_the_nearest_points_is_found(
    points: list[tuple[float, float]], place: tuple[float, float]
) -> None:
    index = PlanarIndex((Box(x, y, x, y), number) for number, (x, y) in enumerate(points))

    expected = min(
        range(len(points)),
        key=lambda number: hypot(points[number][0] - place[0], points[number][1] - place[1]),
        default=None,
    )

    assert index.nearest(*place) == expected


@settings(max_examples=300)
@given(st.lists(st.tuples(PLACES, PLACES), max_size=30), PLACES, st.floats(0.1, 1e5))
def test_nothing_near_is_passed_over_and_all_in_order(
    ends: list[tuple[tuple[float, float], tuple[float, float]]], place: tuple[float, float], reach: float
) -> None:
    boxes = [Box(min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1])) for a, b in ends]
    x, y = place

    found = PlanarIndex((box, number) for number, box in enumerate(boxes)).near(x, y, reach)

    near = {
        number
        for number, box in enumerate(boxes)
        if hypot(max(box.x_min - x, 0, x - box.x_max), max(box.y_min - y, 0, y - box.y_max)) < reach
    }
    assert near <= set(found)
    assert found == sorted(found)
