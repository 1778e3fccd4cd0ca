"""Plants like those of real sites: two-way tracks as a tree with few loops, and stations in its dead ends."""

from __future__ import annotations

from collections import defaultdict
from functools import cache
from random import Random

from bench.halls import Hall, Sketch

POINTS = 253
DEAD_ENDS, ON_LOOPS = 35 / 253, 103 / 253
"""Dead ends, and tracks on the three loops, for each point of a real site; its other tracks are bridges."""
APART_MM = 2000

Cell = tuple[int, int]


@cache
def site(seed: int, points: int = POINTS) -> Hall:
    """Return a site by lot: three loops of two-way tracks side by side, and branches of them, on a grid."""
    random, grid = Random(seed), _Grid()
    grid.add_loops(random, round(ON_LOOPS * points))
    ends = grid.add_branches(random, points, round(DEAD_ENDS * points))
    sketch = Sketch()
    names = {
        cell: sketch.point(f"P{number:03d}", cell[0] * APART_MM, cell[1] * APART_MM)
        for number, cell in enumerate(grid.joined, 1)
    }
    for one, others in grid.joined.items():
        for other in others:
            sketch.one_way(names[one], names[other])
    return sketch.hall(f"site {seed}", [names[cell] for cell in ends])


class _Grid:
    """Cells of a grid, each with its neighbours to which a track leads."""

    def __init__(self) -> None:
        self.joined: defaultdict[Cell, list[Cell]] = defaultdict(list)

    def add_loops(self, random: Random, tracks: int) -> None:
        """Add a rectangle of two-way tracks with two tracks across."""
        height = random.randint(2, max(2, tracks // 8))
        width = max(3, tracks // 2 - 2 * height)
        for row in (0, height):
            for column in range(width):
                self._join((column, row), (column + 1, row))
        for column in (0, *sorted(random.sample(range(1, width), 2)), width):
            for row in range(height):
                self._join((column, row), (column, row + 1))

    def add_branches(self, random: Random, points: int, dead_ends: int) -> list[Cell]:
        """Add branches until there are so many points; return their about ``dead_ends`` dead ends."""
        ends: list[Cell] = []
        while (left := points - len(self.joined)) > 0:
            mean = left / max(1, dead_ends - len(ends))
            cell = random.choice([each for each in self.joined if each not in ends and self._free(each)])
            for _ in range(min(random.randint(1, max(1, round(2 * mean - 1))), left)):
                if free := self._free(cell):
                    there = random.choice(free)
                    self._join(cell, there)
                    cell = there
            ends.append(cell)
        return ends

    def _join(self, one: Cell, other: Cell) -> None:
        self.joined[one].append(other)
        self.joined[other].append(one)

    def _free(self, cell: Cell) -> list[Cell]:
        column, row = cell
        beside = [(column + 1, row), (column - 1, row), (column, row + 1), (column, row - 1)]
        return [each for each in beside if each not in self.joined]
