"""A layout of 10,000 nodes is loaded in time that grows with its size only; `make bench` has figures."""

from __future__ import annotations

from datetime import UTC, datetime

from nena_shared.plant.lif import read, write
from support.cpu import least_cpu
from support.plants import grid_plant

MOST_GROWTH = 8.0
"""For four times as many nodes; what grows with the square of their number takes sixteen times as long."""


def test_loading_grows_with_the_layout_and_not_faster() -> None:
    day = datetime(2026, 11, 20, tzinfo=UTC)
    small, large = (write(grid_plant(side, side), at=day).data for side in (50, 100))
    model = read(large, strict=True).model
    assert (len(model.points), len(model.paths)) == (10_000, 39_600)

    assert least_cpu(lambda: read(large), 2) <= MOST_GROWTH * least_cpu(lambda: read(small), 2)
