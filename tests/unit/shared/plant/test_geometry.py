"""What is found by the grid is what is found by looking at everything."""

from __future__ import annotations

from math import cos, hypot, inf, nan, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.plant import MapPlace, MapTransform, PlantPlace, PlantPose
from nena_shared.plant.geometry import Box, PlanarIndex, normalized

METRES = st.floats(-1000, 1000)
ANGLES = st.floats(-10 * pi, 10 * pi)
TRANSFORMS = st.builds(
    MapTransform, scale=st.floats(0.01, 100), rotation_rad=ANGLES, offset_x_m=METRES, offset_y_m=METRES
)


def test_scale_then_rotation_then_offset() -> None:
    transform = MapTransform(scale=0.1, rotation_rad=pi / 2, offset_x_m=5.0, offset_y_m=-1.0)
    place = transform.to_map(PlantPlace(10.0, 20.0))
    assert (place.x_m, place.y_m) == pytest.approx((3.0, 0.0))
    assert transform.heading_to_map(pi) == pytest.approx(-pi / 2)
    assert transform.length_to_map(10.0) == pytest.approx(1.0)


def test_without_numbers_nothing_is_changed() -> None:
    there = MapTransform().pose_to_map(PlantPose(1.5, -2.5, 0.5))
    assert (there.x_m, there.y_m, there.heading_rad) == (1.5, -2.5, 0.5)


def test_plant_and_map_positions_are_never_equal() -> None:
    place: object = PlantPlace(1.0, 2.0)
    assert MapTransform().to_map(PlantPlace(1.0, 2.0)) == MapPlace(1.0, 2.0)
    assert MapPlace(1.0, 2.0) != place


@pytest.mark.clause("6.3/frame")
@given(TRANSFORMS, METRES, METRES, st.floats(-pi, pi))
def test_there_and_back(transform: MapTransform, x_m: float, y_m: float, heading_rad: float) -> None:
    back = transform.pose_to_plant(transform.pose_to_map(PlantPose(x_m, y_m, heading_rad)))
    assert (back.x_m, back.y_m) == pytest.approx((x_m, y_m), abs=1e-6)
    assert cos(back.heading_rad - heading_rad) == pytest.approx(1.0)
    assert transform.length_to_plant(transform.length_to_map(x_m)) == pytest.approx(x_m)


@given(TRANSFORMS, METRES, METRES, METRES, METRES)
def test_distances_grow_with_the_scale(
    transform: MapTransform, ax: float, ay: float, bx: float, by: float
) -> None:
    a, b = transform.to_map(PlantPlace(ax, ay)), transform.to_map(PlantPlace(bx, by))
    expected = transform.length_to_map(hypot(ax - bx, ay - by))
    assert hypot(a.x_m - b.x_m, a.y_m - b.y_m) == pytest.approx(expected, abs=1e-6)


@pytest.mark.clause("6.3/frame")
@given(TRANSFORMS, METRES, METRES, ANGLES, st.floats(1, 10))
def test_the_heading_turns_as_the_way_ahead_does(
    transform: MapTransform, x_m: float, y_m: float, heading_rad: float, ahead_m: float
) -> None:
    way = PlantPlace(x_m + ahead_m * cos(heading_rad), y_m + ahead_m * sin(heading_rad))
    ahead, here = transform.to_map(way), transform.to_map(PlantPlace(x_m, y_m))
    map_heading, length = transform.heading_to_map(heading_rad), transform.length_to_map(ahead_m)
    expected = (here.x_m + length * cos(map_heading), here.y_m + length * sin(map_heading))
    assert (ahead.x_m, ahead.y_m) == pytest.approx(expected, abs=1e-6)


@pytest.mark.clause("6.3/frame")
@given(st.floats(-1e6, 1e6))
def test_angles_are_normalised(angle_rad: float) -> None:
    assert -pi <= normalized(angle_rad) <= pi
    assert (cos(normalized(angle_rad)), sin(normalized(angle_rad))) == pytest.approx(
        (cos(angle_rad), sin(angle_rad)), abs=1e-6
    )


@pytest.mark.parametrize(
    "numbers", [{"scale": 0.0}, {"scale": -1.0}, {"scale": inf}, {"rotation_rad": nan}, {"offset_x_m": inf}]
)
def test_numbers_that_are_no_transform_are_refused(numbers: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="scale above 0"):
        MapTransform(**numbers)


COORDINATES = st.integers(-50, 50) | st.sampled_from([-1e6, 0.5, 2e5, 1e9])
PLACES = st.tuples(COORDINATES, COORDINATES)


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
