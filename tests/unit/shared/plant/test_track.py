from __future__ import annotations

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from nena_shared.plant import BACKWARD_SUFFIX, Orientation
from nena_shared.plant.track import (
    BoundingBox,
    PathOrientationType,
    Point,
    VehicleTypeAtPoint,
    VehicleTypeOnPath,
)
from support.plants import path, plant

SIZES = st.integers(1, 10_000)
OFFSETS = st.integers(-5_000, 5_000)
BOXES = st.builds(
    BoundingBox,
    length_mm=SIZES,
    width_mm=SIZES,
    height_mm=SIZES,
    reference_offset_x_mm=OFFSETS,
    reference_offset_y_mm=OFFSETS,
)


def edges(box: BoundingBox) -> tuple[float, float, float, float]:
    """Return the sides of a box as seen from its reference point: behind, ahead, right, left."""
    x, y = box.reference_offset_x_mm, box.reference_offset_y_mm
    return -box.length_mm / 2 - x, box.length_mm / 2 - x, -box.width_mm / 2 - y, box.width_mm / 2 - y


@given(BOXES, BOXES)
def test_box_contains_only_boxes_within_all_sides(outer: BoundingBox, inner: BoundingBox) -> None:
    behind, ahead, right, left = edges(outer)
    other = edges(inner)
    lies_within = behind <= other[0] and other[1] <= ahead and right <= other[2] and other[3] <= left

    assert outer.contains(inner) is (lies_within and inner.height_mm <= outer.height_mm)


@pytest.mark.parametrize(
    ("forward", "reverse", "orientations"),
    [
        (1000, 0, [Orientation.FORWARD]),
        (0, 300, [Orientation.BACKWARD]),
        (1000, 300, [Orientation.FORWARD, Orientation.BACKWARD]),
        (0, 0, []),
    ],
)
def test_each_speed_yields_an_edge(forward: int, reverse: int, orientations: list[Orientation]) -> None:
    edges = path("A B", max_velocity_mm_s=forward, max_reverse_velocity_mm_s=reverse).edges()
    assert [edge.orientation for edge in edges] == orientations


def test_the_edges_of_a_path_lead_both_ways() -> None:
    model = plant(path("A B", max_velocity_mm_s=1500, max_reverse_velocity_mm_s=300))
    edges = {edge.id: edge for edge in model.edges()}
    forward, backward = edges["A --- B"], edges["A --- B" + BACKWARD_SUFFIX]
    assert (forward.source, forward.destination, forward.max_velocity_m_s) == ("A", "B", 1.5)
    assert (backward.source, backward.destination, backward.max_velocity_m_s) == ("B", "A", 0.3)
    assert forward.path is backward.path


def test_a_length_is_at_least_a_millimetre() -> None:
    with pytest.raises(ValidationError, match="length_mm"):
        path("A B", 0)


@pytest.mark.parametrize(
    ("degrees", "radians"), [(None, None), (0, 0), (90, pi / 2), (270, -pi / 2), (-90, -pi / 2)]
)
def test_the_heading_is_within_half_a_turn(degrees: float | None, radians: float | None) -> None:
    heading = Point(name="P", x_mm=0, y_mm=0, orientation_deg=degrees).heading_rad

    assert heading == (None if radians is None else pytest.approx(radians))


def test_positions_are_in_metres() -> None:
    point = Point(name="P", x_mm=1500, y_mm=-250)
    assert (point.x_m, point.y_m) == (1.5, -0.25)


def test_a_point_is_open_to_all_types_or_to_those_that_it_names() -> None:
    anywhere = Point(name="P", x_mm=0, y_mm=0)
    for_forks = anywhere.model_copy(update={"vehicle_types": (VehicleTypeAtPoint(vehicle_type_id="fork"),)})

    assert anywhere.is_open_to("tug")
    assert for_forks.is_open_to("fork")
    assert not for_forks.is_open_to("tug")


def test_the_map_is_a_property() -> None:
    point = Point(name="P", x_mm=0, y_mm=0, properties={"vda5050:mapId": "upstairs"})
    assert (point.map_id, Point(name="Q", x_mm=0, y_mm=0).map_id) == ("upstairs", None)


@pytest.mark.parametrize(
    ("orientation", "kind", "backward"),
    [
        (None, PathOrientationType.TANGENTIAL, False),
        (0.0, PathOrientationType.TANGENTIAL, False),
        (pi, PathOrientationType.TANGENTIAL, True),
        (pi / 4, PathOrientationType.TANGENTIAL, False),
        (pi, PathOrientationType.GLOBAL, False),
    ],
)
def test_orientation_against_the_path_means_driving_backward(
    orientation: float | None, kind: PathOrientationType, *, backward: bool
) -> None:
    use = VehicleTypeOnPath(
        vehicle_type_id="t", rotation_allowed=True, vehicle_orientation=orientation, orientation_type=kind
    )
    assert use.is_backward is backward
