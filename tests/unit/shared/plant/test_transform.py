from math import cos, hypot, inf, nan, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.plant import MapTransform, Pose
from nena_shared.plant.transform import normalized

METRES = st.floats(-1000, 1000)
ANGLES = st.floats(-10 * pi, 10 * pi)
TRANSFORMS = st.builds(
    MapTransform, scale=st.floats(0.01, 100), rotation_rad=ANGLES, offset_x_m=METRES, offset_y_m=METRES
)


def test_scale_then_rotation_then_offset() -> None:
    transform = MapTransform(scale=0.1, rotation_rad=pi / 2, offset_x_m=5.0, offset_y_m=-1.0)
    assert transform.to_map(10.0, 20.0) == pytest.approx((3.0, 0.0))
    assert transform.heading_to_map(pi) == pytest.approx(-pi / 2)
    assert transform.length_to_map(10.0) == pytest.approx(1.0)


def test_without_numbers_nothing_is_changed() -> None:
    pose = Pose(1.5, -2.5, 0.5)
    assert MapTransform().pose_to_map(pose) == pose


@pytest.mark.clause("6.3/frame")
@given(TRANSFORMS, METRES, METRES, st.floats(-pi, pi))
def test_there_and_back(transform: MapTransform, x_m: float, y_m: float, heading_rad: float) -> None:
    back = transform.pose_to_plant(transform.pose_to_map(Pose(x_m, y_m, heading_rad)))
    assert (back.x_m, back.y_m) == pytest.approx((x_m, y_m), abs=1e-6)
    assert cos(back.heading_rad - heading_rad) == pytest.approx(1.0)
    assert transform.length_to_plant(transform.length_to_map(x_m)) == pytest.approx(x_m)


@given(TRANSFORMS, METRES, METRES, METRES, METRES)
def test_distances_grow_with_the_scale(
    transform: MapTransform, ax: float, ay: float, bx: float, by: float
) -> None:
    (map_ax, map_ay), (map_bx, map_by) = transform.to_map(ax, ay), transform.to_map(bx, by)
    expected = transform.length_to_map(hypot(ax - bx, ay - by))
    assert hypot(map_ax - map_bx, map_ay - map_by) == pytest.approx(expected, abs=1e-6)


@pytest.mark.clause("6.3/frame")
@given(TRANSFORMS, METRES, METRES, ANGLES, st.floats(1, 10))
def test_the_heading_turns_as_the_way_ahead_does(
    transform: MapTransform, x_m: float, y_m: float, heading_rad: float, ahead_m: float
) -> None:
    ahead = transform.to_map(x_m + ahead_m * cos(heading_rad), y_m + ahead_m * sin(heading_rad))
    here = transform.to_map(x_m, y_m)
    map_heading, length = transform.heading_to_map(heading_rad), transform.length_to_map(ahead_m)
    expected = (here[0] + length * cos(map_heading), here[1] + length * sin(map_heading))
    assert ahead == pytest.approx(expected, abs=1e-6)


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
