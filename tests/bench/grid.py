"""The second plant of the order service's benchmarks: a grid of 400 points, where robots meet."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from random import Random
from typing import Any

from bench.lanes import MAP_ID, Hall, robot, serving, vehicle
from bench.robots import Start
from nena_shared.plant import PlantModel
from support.plants import grid_name, grid_plant

COLUMNS = ROWS = 20
APART_M = 2


def _column_and_row(number: int) -> tuple[int, int]:
    """Return where a robot begins: in every second row and column, as long as there is room."""
    return 2 * (number % (COLUMNS // 2)), 2 * (number // (COLUMNS // 2))


def start_of(number: int) -> Start:
    """Return the start position of a robot; there is room for 100."""
    column, row = _column_and_row(number)
    return Start(robot(number), grid_name(column, row), float(column * APART_M), float(row * APART_M), MAP_ID)


class Lot:
    """Orders to random points, with no vehicle named; the same ones in each run."""

    def __init__(self) -> None:
        self._lot = Random(1)

    def order(self) -> dict[str, Any]:
        """Make the next order."""
        point = grid_name(self._lot.randrange(COLUMNS), self._lot.randrange(ROWS))
        return {"destinations": [{"locationName": point}]}


@asynccontextmanager
async def grid(folder: Path, robots: int) -> AsyncIterator[Hall]:
    """Start a broker and an order service with traffic control on the grid."""
    plain = grid_plant(COLUMNS, ROWS)
    plant = PlantModel(
        name=plain.name,
        points=plain.points,
        paths=plain.paths,
        vehicles=tuple(map(vehicle, range(robots))),
    )
    async with serving(folder, plant, robots) as hall:
        yield hall
