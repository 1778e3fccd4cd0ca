"""The network of a proposal: places and the drives between them, from the shape of the free space."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import Delaunay, QhullError, cKDTree
from skimage.feature import peak_local_max
from skimage.morphology import skeletonize

from nena_plant_formats.from_map.free_space import Cells, FreeSpace

NEAR: Final = 0.4
"""Places nearer to each other than this share of the spacing become one."""
FAR: Final = 2.2
"""Longest drive between two places of a hall, in spacings."""
HALL: Final = 0.75
"""Free space wider than this on each side, in spacings, is a hall and gets a grid, not a middle line."""
ROUNDS: Final = 8
"""Maximum number of rounds in which places are added where none is near."""
PASSED: Final = 2
"""Number of neighbours of a place that lies between two others."""
PHASES: Final = 4
MIN_PLACES: Final = 4
"""Smallest number of places for a triangulation."""


class Network:
    """Places (cells) and drives, by their indices; a drive in both directions is there twice."""

    def __init__(self, space: FreeSpace) -> None:
        self.space = space
        self.places: list[Cells] = []
        self.drives: set[tuple[int, int]] = set()

    def add_place(self, place: Cells) -> int:
        """Add a place; return its index."""
        self.places.append(place)
        return len(self.places) - 1

    def add_track(self, first: int, second: int) -> None:
        """Add a drive in both directions."""
        if first != second:
            self.drives |= {(first, second), (second, first)}

    def neighbours(self) -> dict[int, set[int]]:
        """Return the neighbours of each place, in any direction."""
        found: dict[int, set[int]] = {at: set() for at in range(len(self.places))}
        for first, second in self.drives:
            found[first].add(second)
            found[second].add(first)
        return found

    def lines(self) -> list[tuple[Cells, Cells]]:
        """Return the drives as straight lines, each once."""
        return [
            (self.places[a], self.places[b]) for a, b in self.drives if a < b or (b, a) not in self.drives
        ]

    def parts(self) -> list[list[int]]:
        """Return the connected parts, the largest first."""
        near, seen, found = self.neighbours(), set[int](), []
        for start in near:
            if start in seen:
                continue
            part, queue = [], [start]
            seen.add(start)
            while queue:
                at = queue.pop()
                part.append(at)
                queue += near[at] - seen
                seen |= near[at]
            found.append(part)
        return sorted(found, key=len, reverse=True)

    def drop(self, unwanted: set[int]) -> None:
        """Drop places with their drives."""
        kept = [at for at in range(len(self.places)) if at not in unwanted]
        new = {old: at for at, old in enumerate(kept)}
        self.places = [self.places[old] for old in kept]
        self.drives = {(new[a], new[b]) for a, b in self.drives if a in new and b in new}


def build_network(space: FreeSpace, spacing: float, cover: float) -> Network:
    """Return connected tracks such that each drivable cell is at most ``cover`` from one (both in cells)."""
    network = Network(space)
    hall = _hall_cells(space, space.needed + HALL * spacing)
    middle_lines = skeletonize(space.drivable)  # type: ignore[no-untyped-call]
    _add_middle_lines(network, middle_lines & ~hall, spacing)
    _add_grid(network, hall, spacing)
    _link_neighbours(network, spacing)
    _join_parts(network)
    _merge_near(network, space.length)
    _prune(network, cover)
    for _ in range(ROUNDS):
        if not _add_uncovered(network, spacing, cover):
            break
        _link_neighbours(network, spacing)
        _join_parts(network)
        _merge_near(network, space.length / 2)
    return network


def _hall_cells(space: FreeSpace, wide: float) -> NDArray[np.bool_]:
    """Return the cells of halls: those near a place that is ``wide`` on each side."""
    near: NDArray[np.bool_] = ndimage.distance_transform_edt(space.distance < wide) <= wide - space.needed
    return space.drivable & near


def _add_middle_lines(network: Network, skeleton: NDArray[np.bool_], spacing: float) -> None:
    """Walk along the middle lines and add a place at each end, junction and corner, and every ``spacing``."""
    cells = {(int(column), int(row)) for row, column in np.argwhere(skeleton)}
    owner: dict[tuple[int, int], int] = {}
    walked: dict[tuple[int, int], float] = {}
    for seed in sorted(cells):
        if seed in owner:
            continue
        owner[seed], walked[seed] = network.add_place(np.array(seed, dtype=float)), 0.0
        queue = deque([seed])
        while queue:
            cell = queue.popleft()
            for other in _beside(cell, cells):
                if other in owner:
                    _link(network, owner[cell], owner[other], np.array(cell, dtype=float))
                    continue
                length = walked[cell] + float(np.hypot(other[0] - cell[0], other[1] - cell[1]))
                special = sum(1 for _ in _beside(other, cells)) != PASSED and length > NEAR * spacing
                here = np.array(other, dtype=float)
                hidden = not network.space.sees(network.places[owner[cell]], here)
                owner[other], walked[other] = owner[cell], length
                if special or hidden or length >= spacing:
                    at = np.array(cell, dtype=float) if hidden else here
                    owner[other], walked[other] = network.add_place(at), 0.0
                    network.add_track(owner[cell], owner[other])
                queue.append(other)


def _beside(cell: tuple[int, int], cells: set[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    column, row = cell
    for right in (-1, 0, 1):
        for up in (-1, 0, 1):
            other = (column + right, row + up)
            if (right or up) and other in cells:
                yield other


def _link(network: Network, first: int, second: int, between: Cells) -> None:
    """Link two places where two walks meet, over a place between them if they do not see each other."""
    if first == second or (first, second) in network.drives:
        return
    if network.space.sees(network.places[first], network.places[second]):
        network.add_track(first, second)
    elif all(network.space.sees(network.places[each], between) for each in (first, second)):
        # Several walks may meet around one corner.
        near = np.hypot(*(np.array(network.places) - between).T)
        ends = (network.places[first], network.places[second])
        known = (
            int(at)
            for at in np.flatnonzero(near <= network.space.length / 2)
            if at not in {first, second} and all(network.space.sees(network.places[at], end) for end in ends)
        )
        middle = next(known, None)
        if middle is None:
            middle = network.add_place(between)
        network.add_track(first, middle)
        network.add_track(middle, second)


def _add_grid(network: Network, hall: NDArray[np.bool_], spacing: float) -> None:
    """Add the places of a grid along the walls, in the phase that has most room, where no place is near."""
    if not hall.any():
        return
    angle = _angle_of_walls(network.space)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    corners = np.argwhere(hall)[:, ::-1].astype(float)
    turned = corners @ turn.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    best: Cells = np.empty((0, 2))
    for phase in np.ndindex(PHASES, PHASES):
        first = low + np.array(phase) * spacing / PHASES
        ticks = [np.arange(first[axis], high[axis] + 1, spacing) for axis in (0, 1)]
        grid = np.stack(np.meshgrid(*ticks), axis=-1).reshape(-1, 2) @ turn
        columns, rows = np.clip(np.rint(grid).astype(int), 0, np.array(hall.shape)[::-1] - 1).T
        grid = grid[network.space.is_drivable(grid) & hall[rows, columns]]
        if len(grid) > len(best):
            best = grid
    if network.places and len(best):
        best = best[cKDTree(np.array(network.places)).query(best)[0] > NEAR * spacing]
    network.places += list(best)


def _angle_of_walls(space: FreeSpace) -> float:
    """Return the angle of most walls, rad from -45 to 45 degrees."""
    near = (space.distance > 0) & (space.distance < space.needed)
    up, right = np.gradient(ndimage.gaussian_filter(space.distance, 1.5))
    angles = np.arctan2(up[near], right[near])
    # Walls at right angles to each other count together: four times their angles are equal.
    return float(np.angle(np.exp(4j * angles).sum()) / 4) if len(angles) else 0.0


def _link_neighbours(network: Network, spacing: float) -> None:
    """Link places that see each other, and have no other place between them (a Gabriel graph)."""
    places = np.array(network.places)
    if len(places) < MIN_PLACES:
        for first in range(len(places)):
            for second in range(first):
                _link(network, first, second, places[first])
        return
    try:
        triangles = Delaunay(places).simplices
    except QhullError:  # all on one line, along which they are linked
        return
    tree = cKDTree(places)
    pairs = {tuple(sorted((int(t[a]), int(t[b])))) for t in triangles for a, b in ((0, 1), (1, 2), (2, 0))}
    for first, second in pairs:
        start, end = places[first], places[second]
        length = float(np.hypot(*(end - start)))
        between = tree.query_ball_point((start + end) / 2, length / 2 * 1.01)
        if length <= FAR * spacing and len(between) <= PASSED and network.space.sees(start, end):
            network.add_track(first, second)


def _join_parts(network: Network) -> None:
    """Join the connected parts by the best ways between them."""
    while len(parts := network.parts()) > 1:
        small, others = parts[-1], [at for part in parts[:-1] for at in part]
        places = np.array(network.places)
        way = network.space.way_between(places[small], places[others])
        ends = [_index_at(network, way[0]), _index_at(network, way[-1])]
        trail = [ends[0], *(network.add_place(corner) for corner in way[1:-1]), ends[1]]
        for first, second in pairwise(trail):
            network.add_track(first, second)


def _index_at(network: Network, place: Cells) -> int:
    return int(np.abs(np.array(network.places) - place).sum(axis=1).argmin())


def _merge_near(network: Network, length: float) -> None:
    """Make one place of two that are nearer to each other than ``length``, where it sees what both saw."""
    near = network.neighbours()
    merged: set[int] = set()
    lengths = {
        (a, b): float(np.hypot(*(network.places[a] - network.places[b]))) for a, b in network.drives if a < b
    }
    pairs = sorted((drive for drive in lengths if lengths[drive] < length), key=lambda drive: lengths[drive])
    for kept, dropped in (ends for pair in pairs for ends in (pair, pair[::-1])):
        if merged & {kept, dropped}:
            continue
        others = near[dropped] - {kept}
        if all(network.space.sees(network.places[kept], network.places[other]) for other in others):
            merged.add(dropped)
            for other in others:
                near[other] = (near[other] - {dropped}) | {kept}
                network.add_track(kept, other)
            near[kept] = (near[kept] | others) - {dropped}
    network.drop(merged)


def _prune(network: Network, length: float) -> None:
    """Drop dead ends that are shorter than ``length``: most lead into corners."""
    while True:
        near = network.neighbours()
        short = {
            at
            for at, others in near.items()
            if len(others) == 1
            and np.hypot(*(network.places[at] - network.places[next(iter(others))])) < length
        }
        if not short or len(short) == len(near):
            return
        network.drop(short)


def _add_uncovered(network: Network, spacing: float, cover: float) -> int:
    """Add places in the middle of what is farther than ``cover`` from each drive; return how many."""
    away = np.where(network.space.drivable, network.space.distance_to(network.lines()), 0)
    # One cell less: the middle of a cell may be half a cell from a line, and from a place.
    found = peak_local_max(  # type: ignore[no-untyped-call]
        away, min_distance=max(1, int(spacing / 2)), threshold_abs=cover - 1, exclude_border=False
    )
    network.places += [each[::-1].astype(float) for each in found]
    return len(found)
