"""Where a robot of some size fits on a map, and which straight drives are free."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import ceil, hypot

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.graph import MCP_Geometric

from nena_plant_formats.from_map.robot_map import RobotMap

Cells = NDArray[np.float64]
"""Places on the map: columns and rows, in cells."""


@dataclass(frozen=True, slots=True)
class RobotSize:
    """Size of the robots for which a plant is proposed, m."""

    width: float
    length: float
    clearance: float
    """Room that stays free on each side."""


class FreeSpace:
    """The part of a map on which the middle of a robot may be; all lengths in cells."""

    def __init__(self, robot_map: RobotMap, size: RobotSize) -> None:
        cell = robot_map.resolution
        # What is outside the map is unknown.
        padded = np.pad(robot_map.free, 1)
        self.distance = ndimage.distance_transform_edt(padded)[1:-1, 1:-1].astype(np.float32)
        """To the next cell that is not free."""
        # One cell more: distances are those of the middles of cells.
        self.needed = (size.width / 2 + size.clearance) / cell + 1
        """Distance that the middle of a robot keeps."""
        self.apart = (size.width + size.clearance) / cell
        """Distance of two lanes side by side."""
        self.length = (size.length + size.clearance) / cell
        """Shortest useful distance of two points: each has room for one robot."""
        self.turning = (hypot(size.width, size.length) / 2 + size.clearance) / cell + 1
        """Distance that a robot needs to turn on the spot."""
        fits = self.distance >= self.needed
        parts, count = ndimage.label(fits)  # in four directions, as drives cut no corners
        sizes = np.bincount(parts.ravel(), minlength=count + 1)[1:]
        self.area = int(sizes.max(initial=0))
        """Number of cells of the largest connected part, which is the drivable one."""
        largest = int(sizes.argmax()) + 1 if count else -1
        self.drivable: NDArray[np.bool_] = parts == largest
        others = [each for each in range(1, count + 1) if each != largest]
        roomiest = ndimage.maximum_position(self.distance, parts, others)
        self.other_parts = [
            (int(sizes[part - 1]), np.array(place[::-1], dtype=float))
            for part, place in zip(others, roomiest, strict=True)
        ]
        """The other connected parts: the number of cells, and the place with most room."""

    def is_drivable(self, points: Cells) -> NDArray[np.bool_]:
        """Return for each place whether the middle of a robot may be there."""
        columns, rows = np.rint(points).astype(int).T
        height, width = self.drivable.shape
        inside = (columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)
        result = np.zeros(len(points), dtype=bool)
        result[inside] = self.drivable[rows[inside], columns[inside]]
        return result

    def distance_at(self, point: Cells) -> float:
        """Return the distance of a place to the next cell that is not free."""
        column, row = np.rint(point).astype(int)
        return float(self.distance[row, column])

    def sees(self, start: Cells, end: Cells) -> bool:
        """Return whether a robot may drive straight from one place to another."""
        return bool(self.is_drivable(line(start, end)).all())

    @cached_property
    def _costs(self) -> NDArray[np.float64]:
        """Costs of cells: low in the middle of free space; -1: not drivable."""
        return np.where(self.drivable, 1 + 10 / np.maximum(self.distance, 1), -1.0)

    def way_between(self, starts: Cells, ends: Cells) -> list[Cells]:
        """Return the corners of the best way from one of some places to one of others."""
        first, last = (
            [tuple(np.rint(each[::-1]).astype(int)) for each in places] for places in (starts, ends)
        )
        search = MCP_Geometric(self._costs, fully_connected=False)
        costs, _ = search.find_costs(first, last, find_all_ends=False)
        reached = min(last, key=lambda cell: costs[cell])
        trail = [np.array(each[::-1], dtype=float) for each in search.traceback(reached)]
        corners, seen = [trail[0]], 0
        for at in range(1, len(trail)):
            if not self.sees(trail[seen], trail[at]):
                seen = at - 1
                corners.append(trail[seen])
        return [*corners, trail[-1]]

    def distance_to(self, lines: list[tuple[Cells, Cells]]) -> NDArray[np.float32]:
        """Return for each cell the distance to the next of some straight lines."""
        away = np.ones(self.drivable.shape, dtype=bool)
        for start, end in lines:
            columns, rows = np.rint(line(start, end)).astype(int).T
            away[rows, columns] = False
        distance: NDArray[np.float32] = ndimage.distance_transform_edt(away).astype(np.float32)
        return distance


def line(start: Cells, end: Cells) -> Cells:
    """Return places on a straight line, at most half a cell apart."""
    steps = max(1, ceil(2 * float(np.hypot(*(end - start)))))
    return start + np.linspace(0, 1, steps + 1)[:, None] * (end - start)


def length_of(trail: list[Cells]) -> float:
    """Return the length of a polygonal line."""
    return sum(float(np.hypot(*(b - a))) for a, b in pairwise(trail))
