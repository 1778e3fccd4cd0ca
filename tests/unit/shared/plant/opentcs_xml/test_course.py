"""From the pixels of a drawing into the plant's frame."""

from __future__ import annotations

from xml.etree.ElementTree import Element

import pytest

from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.geometry import LabelLayout
from nena_shared.plant.opentcs_xml.course import FRAME_TOLERANCE_MM, course, same_place
from nena_shared.plant.opentcs_xml.drawing import Drawn
from nena_shared.plant.opentcs_xml.format_version import FormatVersion
from nena_shared.plant.opentcs_xml.notes import Notes
from nena_shared.plant.opentcs_xml.xml_object import XmlObject
from nena_shared.plant.path import ConnectionType, PathLayout
from nena_shared.plant.visual_layout import VisualLayout

SCALED = VisualLayout(scale_x_mm_per_px=50.0, scale_y_mm_per_px=20.0)


def drawn(kind: ConnectionType, points: int, *, same_frame: bool = True) -> tuple[PathLayout, list[str]]:
    """Give the course of a path with so many control points, and what is said of it."""
    obj = XmlObject(Element("path"), ObjectKind.PATH, "P", Notes(FormatVersion.V6_0_0))
    pixels = tuple((number + 1, 10 * (number + 1)) for number in range(points))
    as_drawn = Drawn(label=LabelLayout(layer_id=4), connection_type=kind, control_points_px=pixels)
    made = course(obj, as_drawn, SCALED, same_frame=same_frame)
    assert made.layer_id == 4
    return made, [each.text for each in obj.notes.warnings]


def test_pixels_become_millimetres_and_y_points_up() -> None:
    made, said = drawn(ConnectionType.BEZIER, 2)
    assert [(each.x_mm, each.y_mm) for each in made.control_points] == [(50.0, -200.0), (100.0, -400.0)]
    assert (made.connection_type, said) == (ConnectionType.BEZIER, [])


@pytest.mark.parametrize(
    ("kind", "points", "kept"),
    [
        (ConnectionType.BEZIER, 2, True),
        (ConnectionType.BEZIER, 1, False),
        (ConnectionType.BEZIER, 5, False),
        (ConnectionType.BEZIER_3, 5, True),
        (ConnectionType.BEZIER_3, 2, False),
        (ConnectionType.POLYPATH, 0, True),
        (ConnectionType.POLYPATH, 7, True),
        (ConnectionType.DIRECT, 0, True),
    ],
)
def test_a_curve_needs_its_number_of_control_points(
    kind: ConnectionType,
    points: int,
    kept: bool,  # noqa: FBT001 - an example
) -> None:
    made, said = drawn(kind, points)
    assert made.connection_type is (kind if kept else ConnectionType.DIRECT)
    assert len(made.control_points) == (points if kept else 0)
    assert bool(said) is not kept


def test_control_points_of_another_frame_are_dropped_and_none_are_not_missed() -> None:
    made, (said,) = drawn(ConnectionType.BEZIER, 2, same_frame=False)
    assert made == PathLayout(layer_id=4)
    assert "drawn as a straight line" in said
    made, said_of_none = drawn(ConnectionType.ELBOW, 0, same_frame=False)
    assert (made.connection_type, said_of_none) == (ConnectionType.ELBOW, [])


@pytest.mark.parametrize(
    ("off", "same"), [(0, True), (FRAME_TOLERANCE_MM, True), (FRAME_TOLERANCE_MM + 1, False)]
)
def test_places_a_millimetre_apart_are_the_same(off: int, same: bool) -> None:  # noqa: FBT001 - an example
    assert same_place((10, 20), (10 + off, 20)) is same
    assert same_place((10, 20), (10, 20 - off)) is same
