from __future__ import annotations

from itertools import pairwise
from math import hypot, isclose, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.plant import curve
from nena_shared.plant.track import PathTrajectory, TrajectoryPoint

NUMBERS = st.floats(-1000, 1000)


def trajectory(degree: int, knots: list[float], *places: tuple[float, float]) -> PathTrajectory:
    points = tuple(TrajectoryPoint(x=x, y=y) for x, y in places)
    return PathTrajectory(degree=degree, knot_vector=tuple(knots), control_points=points)


@st.composite
def curves(draw: st.DrawFn) -> PathTrajectory:
    """Draw curves of degree 1 to 4, also with knots that fall together, clamped at both ends."""
    degree = draw(st.integers(1, 4))
    between = sorted(draw(st.lists(st.sampled_from([0.25, 0.5, 0.75]), max_size=4)))
    count = len(between) + degree + 1
    points = [
        TrajectoryPoint(x=draw(NUMBERS), y=draw(NUMBERS), weight=draw(st.floats(0.1, 10)))
        for _ in range(count)
    ]
    knots = (*[0.0] * (degree + 1), *between, *[1.0] * (degree + 1))
    return PathTrajectory(degree=degree, knot_vector=knots, control_points=tuple(points))


@given(curves())
def test_a_clamped_curve_runs_from_its_first_to_its_last_control_point(drawn: PathTrajectory) -> None:
    assert curve.fault(drawn) == ""
    places = curve.places(drawn)
    for place, point in ((places[0], drawn.control_points[0]), (places[-1], drawn.control_points[-1])):
        assert place == pytest.approx((point.x, point.y), abs=1e-6)


@given(curves())
def test_curve_is_within_its_control_polygon_and_not_longer(drawn: PathTrajectory) -> None:
    points = drawn.control_points
    for x, y in curve.places(drawn):
        assert min(each.x for each in points) - 1e-6 <= x <= max(each.x for each in points) + 1e-6
        assert min(each.y for each in points) - 1e-6 <= y <= max(each.y for each in points) + 1e-6
    longest = sum(hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(points))
    assert curve.length(drawn) <= longest + 1e-6


def test_a_line_and_a_corner() -> None:
    assert curve.length(trajectory(1, [0, 0, 1, 1], (0, 0), (3, 4))) == pytest.approx(5)
    corner = trajectory(1, [0, 0, 0.5, 1, 1], (0, 0), (1, 0), (1, 1))
    assert curve.places(corner, 2) == ((0, 0), (1, 0), (1, 1))


def test_scaling_changes_the_knots_and_not_the_curve() -> None:
    wide = trajectory(2, [2, 2, 2, 6, 6, 6], (0, 0), (1, 1), (2, 0))
    narrow = curve.scaled(wide)
    assert list(narrow.knot_vector) == [0, 0, 0, 1, 1, 1]
    assert isclose(curve.length(narrow), curve.length(wide))
    assert curve.scaled(narrow) is narrow


@pytest.mark.parametrize(
    ("degree", "knots", "fault"),
    [
        (1, [0, 0, 1], "needs 4"),
        (1, [0, 1, 0, 1], "decrease"),
        (1, [0, 0, 0, 0], "no span between"),
        (2, [0, 0, 1, 1], "for degree 2"),
    ],
)
def test_faults(degree: int, knots: list[float], fault: str) -> None:
    assert fault in curve.fault(trajectory(degree, knots, (0, 0), (1, pi)))
