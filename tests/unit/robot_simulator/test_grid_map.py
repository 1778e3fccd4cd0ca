from __future__ import annotations

import math

import pytest

from nena_robot_simulator.grid_map import OCCUPIED, GridMap, hall
from nena_robot_simulator.pose import Pose


@pytest.fixture
def place() -> GridMap:
    return hall(min_x=-2.0, min_y=-1.0, max_x=8.0, max_y=4.0, resolution=0.1)


def test_the_cells_fill_the_grid_with_walls_around(place: GridMap) -> None:
    assert (place.width, place.height) == (104, 54)
    assert len(place.cells) == 104 * 54
    assert place.cells.count(OCCUPIED) == 104 * 54 - 100 * 50
    assert (place.origin_x, place.origin_y) == pytest.approx((-2.2, -1.2))


@pytest.mark.parametrize(
    ("x", "y", "free", "covered"),
    [
        (0.0, 0.0, True, True),
        (7.95, 3.95, True, True),
        (8.05, 0.0, False, True),
        (0.0, -1.1, False, True),
        (8.5, 0.0, False, False),
        (0.0, -9.0, False, False),
        (math.nan, 0.0, False, False),
        (0.0, math.inf, False, False),
        (1e308, -1e308, False, False),
    ],
)
def test_inside_wall_and_outside(place: GridMap, x: float, y: float, *, free: bool, covered: bool) -> None:
    assert place.is_free(x, y) is free
    assert place.covers(x, y) is covered


def test_a_free_goal_stays_where_it_is(place: GridMap) -> None:
    assert place.free_near(Pose(1.0, 1.0, 0.3), 0.5) == Pose(1.0, 1.0, 0.3)


def test_a_goal_in_the_wall_moves_to_the_nearest_free_place(place: GridMap) -> None:
    near = place.free_near(Pose(8.15, 1.0, 0.3), 0.5)
    assert near is not None
    assert place.is_free(near.x, near.y)
    assert near.x == pytest.approx(7.95)
    assert (near.y, near.yaw) == pytest.approx((1.0, 0.3))


def test_a_goal_too_deep_in_the_wall_or_outside_has_no_place(place: GridMap) -> None:
    assert place.free_near(Pose(8.15, 1.0, 0.0), 0.1) is None
    assert place.free_near(Pose(8.3, 1.0, 0.0), 0.5) is None
