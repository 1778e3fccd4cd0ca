"""Plane geometry, against points that are tried one by one."""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.geometry import (
    Point,
    Polygon,
    bounding_box,
    boxes_intersect,
    contains,
    heading_matches,
    is_same_position,
    is_simple,
    is_within_deviation,
    polygons_overlap,
    radius,
    rectangle,
    turn,
    turning_circle,
)
from nena_shared.vda5050.order import AllowedDeviationXY
from support.robot_core import MAP, position

SQUARE: Polygon = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
HORSESHOE: Polygon = (
    (0.0, 0.0),
    (9.0, 0.0),
    (9.0, 9.0),
    (6.0, 9.0),
    (6.0, 3.0),
    (3.0, 3.0),
    (3.0, 9.0),
    (0.0, 9.0),
)
numbers = st.floats(-10, 10).map(lambda value: round(value, 2))
points = st.tuples(numbers, numbers)


def moved(polygon: Polygon, by: Point) -> Polygon:
    return tuple((x + by[0], y + by[1]) for x, y in polygon)


@pytest.mark.parametrize(
    ("point", "inside"),
    [((1.0, 1.0), True), ((4.5, 1.0), True), ((4.5, 8.0), False), ((7.5, 8.0), True), ((-1.0, 1.0), False)],
)
def test_points_inside_a_polygon(point: Point, *, inside: bool) -> None:
    assert contains(HORSESHOE, point) is inside


@pytest.mark.parametrize(
    ("by", "meets"),
    [((3.0, 3.0), True), ((5.0, 0.0), False), ((4.0, 0.0), True), ((4.0, 4.0), True), ((0.0, 0.0), True)],
)
def test_intersecting_squares(by: Point, *, meets: bool) -> None:
    assert polygons_overlap(SQUARE, moved(SQUARE, by)) is meets


def test_a_polygon_inside_another_overlaps_it() -> None:
    small = moved(tuple((x / 8, y / 8) for x, y in SQUARE), (1.0, 1.0))

    assert polygons_overlap(SQUARE, small)
    assert polygons_overlap(small, SQUARE)


def test_a_polygon_in_the_gap_of_another_does_not_overlap_it() -> None:
    post: Polygon = ((4.0, 5.0), (5.0, 5.0), (5.0, 6.0), (4.0, 6.0))

    assert not polygons_overlap(HORSESHOE, post)
    assert boxes_intersect(bounding_box(HORSESHOE), bounding_box(post))


@given(points, st.floats(0.2, 4), st.floats(0.2, 4), points)
def test_overlap_agrees_with_the_distance_between_upright_boxes(
    place: Point, width: float, height: float, other: Point
) -> None:
    one = moved(((0.0, 0.0), (width, 0.0), (width, height), (0.0, height)), place)
    two = moved(SQUARE, other)

    assert polygons_overlap(one, two) is boxes_intersect(bounding_box(one), bounding_box(two))
    assert polygons_overlap(one, two) is polygons_overlap(two, one)


@given(points, points, st.floats(-pi, pi))
def test_a_swept_rectangle_contains_the_robot_on_the_whole_way(
    start: Point, end: Point, theta: float
) -> None:
    ground = rectangle(start, end, length=1.0, width=0.6, theta=theta)
    if start != end:
        theta = atan2(end[1] - start[1], end[0] - start[0])
    for share in (0.0, 0.3, 1.0):
        centre = (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
        for along, across in ((0.49, 0.29), (-0.49, 0.29), (0.49, -0.29), (-0.49, -0.29)):
            corner = (
                centre[0] + along * cos(theta) - across * sin(theta),
                centre[1] + along * sin(theta) + across * cos(theta),
            )
            assert contains(ground, corner)


@given(points, st.floats(-pi, pi))
def test_a_turning_robot_stays_in_its_turning_circle(centre: Point, theta: float) -> None:
    circle = turning_circle(centre, length=1.0, width=0.6)
    radius = hypot(1.0, 0.6) / 2 * 0.999

    assert contains(circle, (centre[0] + radius * cos(theta), centre[1] + radius * sin(theta)))


@pytest.mark.parametrize(
    ("polygon", "simple"),
    [
        (SQUARE, True),
        (HORSESHOE, True),
        (tuple(reversed(SQUARE)), True),
        (((0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 4.0)), False),
        (((0.0, 0.0), (1.0, 1.0), (2.0, 2.0)), False),
        (((0.0, 0.0), (4.0, 0.0), (2.0, 0.0), (2.0, 4.0)), False),
    ],
)
def test_a_contour_that_crosses_itself_is_not_simple(polygon: Polygon, *, simple: bool) -> None:
    assert is_simple(polygon) is simple


@pytest.mark.clause("7.3/deviation")
def test_an_ellipse_is_rotated_by_its_angle() -> None:
    place = position(0.0).model_copy(
        update={"allowed_deviation_xy": AllowedDeviationXY(a=2.0, b=0.5, theta=pi / 2)}
    )

    assert is_within_deviation(Pose(0.0, 1.9, 0.0, MAP), place, 0.1)
    assert not is_within_deviation(Pose(1.9, 0.0, 0.0, MAP), place, 0.1)
    assert radius(place, 0.1) == 0.5


def test_another_map_is_another_position() -> None:
    assert not is_within_deviation(Pose(0.0, 0.0, 0.0, "cellar"), position(0.0), 10.0)


@pytest.mark.clause("7.3/deviation")
def test_without_a_deviation_the_robots_default_applies() -> None:
    assert radius(position(0.0), 0.3) == 0.3
    assert radius(position(0.0, radius=0.0), 0.3) == 0.3


@pytest.mark.clause("7.3/theta")
@pytest.mark.parametrize(("theta", "fits"), [(pi - 0.1, True), (-pi + 0.1, True), (pi - 0.5, False)])
def test_headings_are_compared_across_pi(theta: float, fits: bool) -> None:  # noqa: FBT001
    assert heading_matches(Pose(0.0, 0.0, theta, MAP), position(0.0, theta=pi), 0.2) is fits


@pytest.mark.clause("7.3/theta")
def test_without_a_theta_every_heading_matches() -> None:
    assert heading_matches(Pose(0.0, 0.0, 1.0, MAP), position(0.0), 0.1)


def test_the_shortest_turn() -> None:
    assert turn(3.0, -3.0) == pytest.approx(2 * pi - 6.0)
    assert turn(0.0, pi) == pytest.approx(-pi)


def test_a_position_is_the_same_unless_it_requires_another_heading() -> None:
    assert is_same_position(position(1.0), position(1.0))
    assert is_same_position(position(1.0, theta=1.0), position(1.0))
    assert not is_same_position(position(1.0), position(1.0, theta=1.0))
    assert not is_same_position(position(1.0), position(1.1))
