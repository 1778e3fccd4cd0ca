from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nena_shared.plant.geometry import BoundingBox

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
    """Give the sides of a box as seen from its reference point: behind, ahead, right, left."""
    x, y = box.reference_offset_x_mm, box.reference_offset_y_mm
    return -box.length_mm / 2 - x, box.length_mm / 2 - x, -box.width_mm / 2 - y, box.width_mm / 2 - y


@given(BOXES, BOXES)
def test_a_box_holds_what_sticks_out_of_it_on_no_side(outer: BoundingBox, inner: BoundingBox) -> None:
    behind, ahead, right, left = edges(outer)
    other = edges(inner)
    lies_within = behind <= other[0] and other[1] <= ahead and right <= other[2] and other[3] <= left

    assert outer.holds(inner) is (lies_within and inner.height_mm <= outer.height_mm)


@given(BOXES)
def test_a_box_holds_itself(box: BoundingBox) -> None:
    assert box.holds(box)
