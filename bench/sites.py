"""Plants like those of real sites: two-way tracks as a tree with few loops, and stations in its dead ends."""

from __future__ import annotations

from collections import defaultdict
from functools import cache
from random import Random

from bench.halls import Hall, Sketch

POINTS = 253
DEAD_ENDS, ON_LOOPS = 35 / 253, 103 / 253
"""Dead ends, and tracks on the three loops, for each point of a real site; its other tracks are bridges."""
SINGLE_TRACK = 30 / 253
"""Tracks between two loops, for each point: so long that 13 robots complete as few orders as there."""
APART_MM = 700
"""As close that robots that never meet complete as many orders as on a real site."""

Cell = tuple[int, int]


@cache
def site(seed: int, points: int = POINTS) -> Hall:
    """Return a site by lot: three loops joined by long single tracks, and branches of them, on a grid."""
    random, grid = Random(seed), _Grid()
    grid.add_loops(random, round(ON_LOOPS * points), round(SINGLE_TRACK * points))
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

    def add_loops(self, random: Random, tracks: int, between: int) -> None:
        """Add three rectangles in a row, each joined to the next by ``between`` tracks."""
        column = row = 0
        for loop in range(3):
            half = tracks // 2 * (loop + 1) // 3 - tracks // 2 * loop // 3
            height = random.randint(2, half // 2)
            width = half - height
            self._line(column, row, width, 1, 0)
            self._line(column, row + height, width, 1, 0)
            self._line(column, row, height, 0, 1)
            self._line(column + width, row, height, 0, 1)
            column, row = column + width, row + random.randint(0, height)
            if loop < 2:
                self._line(column, row, between, 1, 0)
                column, row = column + between, row - random.randint(0, 2)

    def _line(self, column: int, row: int, tracks: int, right: int, up: int) -> None:
        for number in range(tracks):
            here = column + number * right, row + number * up
            self._join(here, (here[0] + right, here[1] + up))

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
