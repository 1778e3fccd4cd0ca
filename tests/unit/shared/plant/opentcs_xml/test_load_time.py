"""A plant of 10,000 points is loaded in time that grows with its size only; `make bench` has figures."""

from __future__ import annotations

from nena_shared.plant.opentcs_xml import read, write
from support.cpu import least_cpu
from support.plants import grid_plant

MOST_GROWTH = 8.0
"""For four times as many points; what grows with the square of their number takes sixteen times as long."""


def test_loading_grows_with_the_plant_and_not_faster() -> None:
    small, large = (write(grid_plant(side, side)).data for side in (50, 100))
    model = read(large).model
    assert (len(model.points), len(model.paths)) == (10_000, 39_600)

    assert least_cpu(lambda: read(large), 2) <= MOST_GROWTH * least_cpu(lambda: read(small), 2)
