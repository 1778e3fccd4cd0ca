from __future__ import annotations

import pytest

from nena_order_service.traffic.areas import resources_in
from nena_shared.fleet_api.stops import Area
from nena_shared.plant import ConnectionType, LayoutPoint, PathLayout, PlantModel
from support.plants import path, point


def area(x_min: float, y_min: float, x_max: float, y_max: float, map_id: str | None = None) -> Area:
    return Area(x_min=x_min, y_min=y_min, x_max=x_max, y_max=y_max, map_id=map_id)


@pytest.mark.parametrize(
    ("start", "end", "crosses"),
    [
        ((0, 0), (10, 0), True),
        ((0, 2), (10, 2), False),
        ((5, 0), (5, 0), True),
        ((0, 0), (3.9, 0), False),
        ((0, 10), (10, -10), True),
        ((4, 1.5), (6, 1.5), False),
        ((3, -3), (3, 3), False),
        ((6, 1), (9, 9), True),
    ],
)
def test_straight_line_crosses_the_rectangle(
    start: tuple[float, float], end: tuple[float, float], *, crosses: bool
) -> None:
    assert area(4, -1, 6, 1).crosses(start, end) is crosses
    assert area(4, -1, 6, 1).crosses(end, start) is crosses


def test_path_across_the_area_counts_although_its_ends_are_outside() -> None:
    plant = PlantModel(name="p", points=(point("A"), point("B", 10_000)), paths=(path("A B"),))
    assert resources_in(plant, area(4, -1, 6, 1)) == {"A --- B"}
    assert resources_in(plant, area(-1, -1, 6, 1)) == {"A", "A --- B"}
    assert resources_in(plant, area(4, 1, 6, 2)) == frozenset()


@pytest.mark.parametrize("shape", [ConnectionType.BEZIER, ConnectionType.POLYPATH])
def test_drawn_curve_counts_as_well(shape: ConnectionType) -> None:
    drawn = PathLayout(
        connection_type=shape,
        control_points=(LayoutPoint(x_mm=0, y_mm=4000), LayoutPoint(x_mm=10_000, y_mm=4000)),
    )
    bent = path("A B", layout=drawn)
    plant = PlantModel(name="p", points=(point("A"), point("B", 10_000)), paths=(bent,))
    height = 3.0 if shape is ConnectionType.BEZIER else 4.0
    assert resources_in(plant, area(4, height - 0.1, 6, height + 0.1)) == {"A --- B"}
    assert resources_in(plant, area(4, 1, 6, 2)) == frozenset()


def test_area_of_one_map_leaves_other_maps_out() -> None:
    here = point("A", properties={"vda5050:mapId": "ground"})
    there = point("B", properties={"vda5050:mapId": "first"})
    anywhere = point("C")
    plant = PlantModel(name="p", points=(here, there, anywhere))
    assert resources_in(plant, area(-1, -1, 1, 1, "ground")) == {"A", "C"}
    assert resources_in(plant, area(-1, -1, 1, 1)) == {"A", "B", "C"}
