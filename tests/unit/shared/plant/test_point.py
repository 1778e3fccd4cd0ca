from __future__ import annotations

from math import pi

import pytest

from nena_shared.plant.point import Point
from nena_shared.plant.vehicle_type import VehicleTypeAtPoint


@pytest.mark.parametrize(
    ("degrees", "radians"), [(None, None), (0, 0), (90, pi / 2), (270, -pi / 2), (-90, -pi / 2)]
)
def test_the_heading_is_within_half_a_turn(degrees: float | None, radians: float | None) -> None:
    heading = Point(name="P", x_mm=0, y_mm=0, orientation_deg=degrees).heading_rad

    assert heading == (None if radians is None else pytest.approx(radians))


def test_places_are_told_in_metres() -> None:
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
