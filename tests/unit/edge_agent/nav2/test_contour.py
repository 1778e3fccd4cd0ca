"""The robot's outline by the parameters of a costmap."""

from __future__ import annotations

import math

import pytest

from nena_edge_agent.nav2.parameters import CORNERS, contour_of

pytestmark = pytest.mark.ros


def test_a_footprint_is_the_outline() -> None:
    text = "[ [0.5, 0.3], [0.5, -0.3], [-0.2, 0] ]"
    assert contour_of(text, 0.1) == ((0.5, 0.3), (0.5, -0.3), (-0.2, 0.0))


@pytest.mark.parametrize(
    "footprint", ["", "[]", "[[1, 1], [2, 2]]", "round", "[1, 2, 3]", "[[1, NaN], [1, 2], [3, 4]]"]
)
def test_without_a_polygon_the_robot_is_round(footprint: str) -> None:
    outline = contour_of(footprint, 0.4)
    assert len(outline) == CORNERS
    assert {round(math.hypot(x, y), 3) for x, y in outline} == {0.4}


@pytest.mark.parametrize("radius", [None, 0.0, math.inf])
def test_unknown_parameters_yield_no_outline(radius: float | None) -> None:
    assert contour_of("", radius) == ()
