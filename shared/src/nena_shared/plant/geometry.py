"""Geometry: positions in the frames of plant and maps, transforms between them, and a spatial index."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import ceil, cos, floor, hypot, inf, isfinite, pi, radians, remainder, sin
from typing import Final, Generic, NamedTuple, TypeVar


# 0019: separate types for both frames, although their content is equal: mypy refuses one for the other
@dataclass(frozen=True, slots=True)
class PlantPlace:
    """A position in the plant frame, metres."""

    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True)
class MapPlace:
    """A position in a map frame, metres."""

    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True)
class PlantPose:
    """A pose in the plant frame: metres; radians from -pi to pi, counter-clockwise from +x."""

    x_m: float
    y_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class MapPose:
    """A pose in a map frame: metres; radians from -pi to pi, counter-clockwise from +x."""

    x_m: float
    y_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class MapTransform:
    """Transform from plant to map frame: scale, rotation (rad, counter-clockwise), offset (m of the map).

    Raises ValueError for a scale that is not above 0 and for numbers that are not finite.
    """

    scale: float = 1.0
    rotation_rad: float = 0.0
    offset_x_m: float = 0.0
    offset_y_m: float = 0.0

    def __post_init__(self) -> None:
        values = (self.scale, self.rotation_rad, self.offset_x_m, self.offset_y_m)
        if not all(map(isfinite, values)) or self.scale <= 0:
            raise ValueError(f"a map transform needs finite numbers and a scale above 0, not {self}")

    def to_map(self, place: PlantPlace | PlantPose) -> MapPlace:
        """Convert a plant position to the map frame."""
        c, s = cos(self.rotation_rad), sin(self.rotation_rad)
        return MapPlace(
            self.scale * (c * place.x_m - s * place.y_m) + self.offset_x_m,
            self.scale * (s * place.x_m + c * place.y_m) + self.offset_y_m,
        )

    def to_plant(self, place: MapPlace | MapPose) -> PlantPlace:
        """Convert a map position to the plant frame."""
        c, s = cos(self.rotation_rad), sin(self.rotation_rad)
        dx, dy = (place.x_m - self.offset_x_m) / self.scale, (place.y_m - self.offset_y_m) / self.scale
        return PlantPlace(c * dx + s * dy, c * dy - s * dx)

    def heading_to_map(self, heading_rad: float) -> float:
        """Convert a plant heading to the map frame, -pi to pi."""
        return normalized(heading_rad + self.rotation_rad)

    def heading_to_plant(self, heading_rad: float) -> float:
        """Convert a map heading to the plant frame, -pi to pi."""
        return normalized(heading_rad - self.rotation_rad)

    def pose_to_map(self, pose: PlantPose) -> MapPose:
        """Convert a plant pose to the map frame."""
        place = self.to_map(pose)
        return MapPose(place.x_m, place.y_m, self.heading_to_map(pose.heading_rad))

    def pose_to_plant(self, pose: MapPose) -> PlantPose:
        """Convert a map pose to the plant frame."""
        place = self.to_plant(pose)
        return PlantPose(place.x_m, place.y_m, self.heading_to_plant(pose.heading_rad))

    # 0019: allowed deviations are lengths, and are scaled; speeds are of the real world, and are not
    def length_to_map(self, length_m: float) -> float:
        """Convert a plant length to the map frame, metres."""
        return length_m * self.scale

    def length_to_plant(self, length_m: float) -> float:
        """Convert a map length to the plant frame, metres."""
        return length_m / self.scale


def normalized(angle_rad: float) -> float:
    """Return the angle normalised to -pi to pi, as VDA 5050 requires."""
    return remainder(angle_rad, 2 * pi)


_PAIR: Final = re.compile(r"(scale|rotation|x|y)=(\S+)")
_WANTED: Final = "'scale=1 rotation=0 x=0 y=0' (rotation in degrees, x and y in metres of the map)"


def parse_transform(text: str) -> MapTransform:
    """Parse a transform such as `scale=0.1 rotation=90 x=5 y=-1`; missing values are neutral.

    Rotation in degrees counter-clockwise, x and y in metres of the map. Raises ValueError.
    """
    pairs = [_PAIR.fullmatch(part) for part in text.split()]
    values = {pair[1]: pair[2] for pair in pairs if pair}
    if not values or len(values) < len(pairs):  # a word that is no pair, or a key twice
        raise ValueError(f"{text!r} is not of the form {_WANTED}")
    numbers = {key: float(value) for key, value in values.items()}
    return MapTransform(
        scale=numbers.get("scale", 1.0),
        rotation_rad=radians(numbers.get("rotation", 0.0)),
        offset_x_m=numbers.get("x", 0.0),
        offset_y_m=numbers.get("y", 0.0),
    )


T = TypeVar("T")

MOST_CELLS_OF_ONE: Final = 10_000
"""Maximum cells of one item; larger items are always candidates."""


class Box(NamedTuple):
    """An axis-aligned box, in any unit."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float


class PlanarIndex(Generic[T]):
    """Grid index of items by their bounding boxes; that of a point has no extent."""

    def __init__(self, items: Iterable[tuple[Box, T]]) -> None:
        self._items = list(items)
        self._cell = _cell_of([box for box, _ in self._items])
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._large: list[int] = []
        for index, (box, _) in enumerate(self._items):
            columns, rows = self._cells_of_box(box)
            if len(columns) * len(rows) > MOST_CELLS_OF_ONE:
                self._large.append(index)
                continue
            for column in columns:
                for row in rows:
                    self._cells.setdefault((column, row), []).append(index)
        self._columns = _covering_range([column for column, _ in self._cells])
        self._rows = _covering_range([row for _, row in self._cells])

    def near(self, x: float, y: float, reach: float) -> list[T]:
        """Return all items with boxes nearer to the position than ``reach``, in order, and perhaps others."""
        columns, rows = self._cells_of_box(Box(x - reach, y - reach, x + reach, y + reach))
        indices = set(self._large)
        for column in _range_overlap(columns, self._columns):
            for row in _range_overlap(rows, self._rows):
                indices.update(self._cells.get((column, row), ()))
        return [self._items[index][1] for index in sorted(indices)]

    def nearest(self, x: float, y: float) -> T | None:
        """Return the item nearest to the position, the first of several; None if the index is empty."""
        best, least = -1, inf
        for ring, indices in enumerate(self._rings_around(x, y)):
            # the position may be at its cell's border: a ring's items are up to one cell nearer
            if least < (ring - 1) * self._cell:
                break
            for index in indices:
                box = self._items[index][0]
                distance = hypot(box.x_min - x, box.y_min - y)
                if distance < least or (distance == least and index < best):
                    best, least = index, distance
        return self._items[best][1] if best >= 0 else None

    def _cells_of_box(self, box: Box) -> tuple[range, range]:
        columns = range(floor(box.x_min / self._cell), floor(box.x_max / self._cell) + 1)
        return columns, range(floor(box.y_min / self._cell), floor(box.y_max / self._cell) + 1)

    def _rings_around(self, x: float, y: float) -> Iterator[Iterable[int]]:
        """Yield the items ring by ring, starting with the cell nearest to the position."""
        if not self._cells:
            return
        column = min(max(floor(x / self._cell), self._columns.start), self._columns.stop - 1)
        row = min(max(floor(y / self._cell), self._rows.start), self._rows.stop - 1)
        for ring in range(max(len(self._columns), len(self._rows))):
            yield [
                index
                for cell in _cells_of_ring(column, row, ring, self._columns, self._rows)
                for index in self._cells.get(cell, ())
            ]


def _cell_of(boxes: list[Box]) -> float:
    """Return the cell size for which there are about as many cells as items."""
    if not boxes:
        return 1.0
    width = max(box.x_max for box in boxes) - min(box.x_min for box in boxes)
    height = max(box.y_max for box in boxes) - min(box.y_min for box in boxes)
    # objects in a row cover no area: cells along the row then
    across = max(width, height)
    square = max(width * height, across * across / len(boxes))
    return float(ceil((square / len(boxes)) ** 0.5)) or 1.0


def _covering_range(numbers: list[int]) -> range:
    return range(min(numbers), max(numbers) + 1) if numbers else range(0)


def _range_overlap(one: range, other: range) -> range:
    return range(max(one.start, other.start), min(one.stop, other.stop))


def _cells_of_ring(
    column: int, row: int, ring: int, columns: range, rows: range
) -> Iterator[tuple[int, int]]:
    """Yield the existing cells at a distance of exactly ``ring`` cells."""
    left, right, low, high = column - ring, column + ring, row - ring, row + ring
    for across in _range_overlap(range(left, right + 1), columns):
        if low in rows:
            yield across, low
        if high in rows and ring:  # ring 0 is one cell
            yield across, high
    for along in _range_overlap(range(low + 1, high), rows):
        if left in columns:
            yield left, along
        if right in columns:
            yield right, along
