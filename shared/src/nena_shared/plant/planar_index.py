"""Finds what is near a place of the plane without looking at everything: a grid of square cells."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import ceil, floor, hypot, inf
from typing import Final, Generic, NamedTuple, TypeVar

T = TypeVar("T")

MOST_CELLS_OF_ONE: Final = 10_000
"""Cells that one item may be noted in; larger ones are always looked at."""


class Box(NamedTuple):
    """From the least to the greatest coordinates, in one unit."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float


class PlanarIndex(Generic[T]):
    """Keeps items by the boxes that they lie in; a point's box has no extent."""

    def __init__(self, items: Iterable[tuple[Box, T]]) -> None:
        self._items = list(items)
        self._cell = _cell_of([box for box, _ in self._items])
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._large: list[int] = []
        for index, (box, _) in enumerate(self._items):
            columns, rows = self._span(box)
            if len(columns) * len(rows) > MOST_CELLS_OF_ONE:
                self._large.append(index)
                continue
            for column in columns:
                for row in rows:
                    self._cells.setdefault((column, row), []).append(index)
        self._columns = _range([column for column, _ in self._cells])
        self._rows = _range([row for _, row in self._cells])

    def near(self, x: float, y: float, reach: float) -> list[T]:
        """Give at least all items whose boxes come nearer to the place than ``reach``, in their order."""
        columns, rows = self._span(Box(x - reach, y - reach, x + reach, y + reach))
        found = set(self._large)
        for column in _overlap(columns, self._columns):
            for row in _overlap(rows, self._rows):
                found.update(self._cells.get((column, row), ()))
        return [self._items[index][1] for index in sorted(found)]

    def nearest(self, x: float, y: float) -> T | None:
        """Give the point that is nearest to the place, the first of several; None where there is none."""
        best, least = -1, inf
        for ring, indices in enumerate(self._rings(x, y)):
            if least < (ring - 1) * self._cell:
                break
            for index in indices:
                box = self._items[index][0]
                distance = hypot(box.x_min - x, box.y_min - y)
                if distance < least or (distance == least and index < best):
                    best, least = index, distance
        return self._items[best][1] if best >= 0 else None

    def _span(self, box: Box) -> tuple[range, range]:
        columns = range(floor(box.x_min / self._cell), floor(box.x_max / self._cell) + 1)
        return columns, range(floor(box.y_min / self._cell), floor(box.y_max / self._cell) + 1)

    def _rings(self, x: float, y: float) -> Iterator[Iterable[int]]:
        """Give what is in the cell that is nearest to the place, then in those around it, and so on."""
        if not self._cells:
            return
        column = min(max(floor(x / self._cell), self._columns.start), self._columns.stop - 1)
        row = min(max(floor(y / self._cell), self._rows.start), self._rows.stop - 1)
        for ring in range(max(len(self._columns), len(self._rows))):
            yield [
                index
                for cell in _ring(column, row, ring, self._columns, self._rows)
                for index in self._cells.get(cell, ())
            ]


def _cell_of(boxes: list[Box]) -> float:
    """Give the side of cells of which there are about as many as items."""
    if not boxes:
        return 1.0
    width = max(box.x_max for box in boxes) - min(box.x_min for box in boxes)
    height = max(box.y_max for box in boxes) - min(box.y_min for box in boxes)
    across = max(width, height)
    square = max(width * height, across * across / len(boxes))
    return float(ceil((square / len(boxes)) ** 0.5)) or 1.0


def _range(numbers: list[int]) -> range:
    return range(min(numbers), max(numbers) + 1) if numbers else range(0)


def _overlap(one: range, other: range) -> range:
    return range(max(one.start, other.start), min(one.stop, other.stop))


def _ring(column: int, row: int, ring: int, columns: range, rows: range) -> Iterator[tuple[int, int]]:
    """Give the cells that are ``ring`` columns or rows away, and not more, as far as there are any."""
    left, right, low, high = column - ring, column + ring, row - ring, row + ring
    for each in _overlap(range(left, right + 1), columns):
        if low in rows:
            yield each, low
        if high in rows and ring:
            yield each, high
    for each in _overlap(range(low + 1, high), rows):
        if left in columns:
            yield left, each
        if right in columns:
            yield right, each
