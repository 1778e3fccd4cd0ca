"""A plant model proposed from a robot's map: tracks, one-way pairs, passing places and parking positions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from string import ascii_uppercase
from typing import Final

import numpy as np
from skimage.feature import peak_local_max

from nena_plant_formats.from_map.free_space import Cells, FreeSpace, RobotSize, length_of
from nena_plant_formats.from_map.network import PASSED, Network, build_network
from nena_plant_formats.from_map.robot_map import RobotMap, RobotMapError
from nena_shared.plant import property_keys as keys
from nena_shared.plant.model import PlantModel, Vehicle
from nena_shared.plant.track import MM_PER_M, Path, Point
from nena_shared.plant_terms import PointType

COVER: Final = 2.0
"""Each place that a robot fits into is at most this far from a path, m."""
PAIR_FROM: Final = 2.5
"""Shortest track that becomes a pair of one-way lanes, in spacings."""
RING_TO: Final = 6.0
"""Longest ring at the end of a track that becomes one-way, in spacings; robots meet on it otherwise."""
QUEUE_FROM: Final = 2.5
"""Shortest drive of a ring that gets a place where robots queue to leave it, in lengths of a robot."""
PASSING_AFTER: Final = 4
"""Longest track without a passing place, in spacings."""
SQUARE: Final = 5.0
"""Side of the squares after which points are named, as on a city map, m."""
WORTH_TELLING: Final = 1.0
"""Smallest part without paths that a person is told of, m²."""
PARKING_PLACES: Final = 12
"""Maximum number of parking positions beside the tracks."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """A proposed plant, and what a person should know about it."""

    model: PlantModel
    area: float
    """Where the middle of a robot may be, m²."""
    one_way_pairs: int
    passing_places: int
    parking: tuple[Point, ...]
    remarks: tuple[str, ...]


def propose_plant(
    robot_map: RobotMap, size: RobotSize, *, spacing: float, speed: float, vehicles: tuple[Vehicle, ...] = ()
) -> Proposal:
    """Return a plant for robots of this size; ``spacing``: between points (m), ``speed``: on paths (m/s).

    Raises:
        RobotMapError: no robot of this size fits anywhere.
    """
    space = FreeSpace(robot_map, size)
    cell = robot_map.resolution
    if not space.area:
        raise RobotMapError(
            f"No place of map {robot_map.name!r} has room for a robot {size.width} m wide with "
            f"{size.clearance} m on each side. Check resolution, thresholds and negate in its YAML file."
        )
    network = build_network(space, spacing / cell, COVER / cell)

    def where(place: Cells) -> str:
        x, y = robot_map.to_plane(place[None])[0]
        return f"({x:.1f}, {y:.1f})"

    remarks = [
        f"{part * cell**2:.0f} m² around {where(place)} cannot be reached from the largest part, and have no "
        "paths: a wall, or single occupied cells in a door"
        for part, place in sorted(space.other_parts, key=lambda each: -each[0])
        if part * cell**2 >= WORTH_TELLING
    ]
    chains = list(_chains(network))
    shortest, longest_ring = (spacings * spacing / cell for spacings in (PAIR_FROM, RING_TO))
    pairs = sum([_part_directions(network, chain, shortest, longest_ring) for chain in chains])
    passing = set[int]()
    for chain in chains:
        length = length_of([network.places[at] for at in chain])
        if length <= PASSING_AFTER * spacing / cell or (chain[1], chain[0]) not in network.drives:
            continue
        added = _add_passing_places(network, chain, PASSING_AFTER * spacing / cell)
        passing |= set(added)
        if not added:
            at = where(network.places[chain[len(chain) // 2]])
            remarks.append(
                f"the track of {length * cell:.0f} m around {at} has no room for two robots to pass"
            )
    parking = _add_parking(network, spacing / cell)
    tight = [at for at, near in network.neighbours().items() if len(near) == 1 and at not in parking]
    if tight:
        ends = ", ".join(where(network.places[at]) for at in tight)
        remarks.append(f"at {len(tight)} dead ends a robot of {size.length} m has no room to turn: {ends}")
    model = _model_of(network, robot_map, parking, speed, vehicles)
    stands = tuple(point for point in model.points if point.type is PointType.PARK_POSITION)
    return Proposal(model, space.area * cell**2, pairs, len(passing), stands, tuple(remarks))


def _chains(network: Network) -> Iterator[list[int]]:
    """Yield the tracks between junctions and dead ends: their places in order."""
    near = network.neighbours()
    seen: set[tuple[int, int]] = set()
    for start, others in near.items():
        if len(others) == PASSED:
            continue
        for other in others:
            chain = [start, other]
            while len(near[chain[-1]]) == PASSED and chain[-1] != start:
                (following,) = near[chain[-1]] - {chain[-2]}
                chain.append(following)
            ends = ((chain[0], chain[1]), (chain[-1], chain[-2]))
            if len(chain) > PASSED and not seen & set(ends):
                seen |= set(ends)
                yield chain


def _part_directions(network: Network, chain: list[int], shortest: float, longest_ring: float) -> bool:
    """Make a track a pair of one-way lanes, each on the right; return false if it is short or has no room.

    A small ring becomes a one-way lane.
    """
    near = network.neighbours()
    if chain[0] == chain[-1] and length_of([network.places[at] for at in chain]) <= longest_ring:
        for before, after in pairwise(chain):
            network.drives.remove((after, before))
            start, end = network.places[before], network.places[after]
            if np.hypot(*(end - start)) >= QUEUE_FROM * network.space.length:
                middle = network.add_place((start + end) / 2)
                network.drives = network.drives - {(before, after)} | {(before, middle), (middle, after)}
    if chain[0] == chain[-1] or 1 in (len(near[chain[0]]), len(near[chain[-1]])):
        return False  # a dead end: the robots come back on the same lane
    places = [network.places[at] for at in chain]
    if length_of(places) < shortest:
        return False
    apart = network.space.apart / 2
    lanes = [[trail[0], *_beside(trail, apart), trail[-1]] for trail in (places, places[::-1])]
    if not all(network.space.sees(a, b) for lane in lanes for a, b in pairwise(lane)):
        return False
    network.drives -= {*pairwise(chain), *pairwise(chain[::-1])}
    # The first lane takes the places of the track over, so that none is left without a drive.
    for at, place in zip(chain[1:-1], lanes[0][1:-1], strict=True):
        network.places[at] = place
    back = [chain[-1], *map(network.add_place, lanes[1][1:-1]), chain[0]]
    network.drives |= {*pairwise(chain), *pairwise(back)}
    return True


def _beside(trail: list[Cells], away: float) -> list[Cells]:
    """Return the inner corners of a line, moved to its right."""
    moved = []
    for before, here, after in zip(trail, trail[1:], trail[2:], strict=False):
        along = (after - before) / max(float(np.hypot(*(after - before))), 1e-9)
        moved.append(here + away * np.array((along[1], -along[0])))
    return moved


def _add_passing_places(network: Network, chain: list[int], every: float) -> list[int]:
    """Add places beside a track where one robot lets another pass, about ``every`` cells."""
    added: list[int] = []
    passed = every / 2
    for before, at, after in zip(chain, chain[1:], chain[2:], strict=False):
        trail = [network.places[each] for each in (before, at, after)]
        passed += float(np.hypot(*(trail[1] - trail[0])))
        if passed < every:
            continue
        for side in (trail, trail[::-1]):
            (place,) = _beside(side, network.space.apart)
            if all(network.space.sees(place, end) for end in (trail[0], trail[2])):
                added.append(network.add_place(place))
                network.add_track(before, added[-1])
                network.add_track(added[-1], after)
                passed = 0.0
                break
    return added


def _add_parking(network: Network, spacing: float) -> set[int]:
    """Return dead ends with room to turn, and places added beside the tracks: where robots park."""
    space = network.space
    parking = {
        at
        for at, near in network.neighbours().items()
        if len(near) == 1 and space.distance_at(network.places[at]) >= space.turning
    }
    roomy = space.drivable & (space.distance >= space.turning)
    away = np.where(roomy, space.distance_to(network.lines()), 0)
    found = peak_local_max(  # type: ignore[no-untyped-call]
        away, min_distance=max(1, int(spacing)), threshold_abs=space.apart, exclude_border=False
    )
    known = len(network.places)
    for place in (each[::-1].astype(float) for each in found[:PARKING_PLACES]):
        nearest = np.hypot(*(np.array(network.places[:known]) - place).T).argsort()[:PASSING_AFTER]
        seen = (int(at) for at in nearest if at not in parking and space.sees(network.places[at], place))
        if (joined := next(seen, None)) is not None:
            parking.add(network.add_place(place))
            network.add_track(joined, len(network.places) - 1)
    return parking


def _model_of(
    network: Network, robot_map: RobotMap, parking: set[int], speed: float, vehicles: tuple[Vehicle, ...]
) -> PlantModel:
    """Return the plant of a network."""
    plane = robot_map.to_plane(np.array(network.places))
    names = _names_of(plane, parking)
    points = [
        Point(
            name=name,
            x_mm=round(x * MM_PER_M),
            y_mm=round(y * MM_PER_M),
            type=PointType.PARK_POSITION if at in parking else PointType.HALT_POSITION,
            properties={keys.VDA5050_MAP_ID: robot_map.name},
        )
        for at, (name, (x, y)) in enumerate(zip(names, plane, strict=True))
    ]
    paths = [
        Path(
            name=f"{names[first]} --- {names[second]}",
            source=names[first],
            destination=names[second],
            length_mm=max(1, round(float(np.hypot(*(plane[first] - plane[second]))) * MM_PER_M)),
            max_velocity_mm_s=round(speed * MM_PER_M),
        )
        for first, second in sorted(network.drives)
    ]
    return PlantModel(name=robot_map.name, points=tuple(points), paths=tuple(paths), vehicles=vehicles)


def _names_of(plane: Cells, parking: set[int]) -> list[str]:
    """Name places after their squares: A to Z from left to right, 1 and up from the bottom, then a letter."""
    squares = np.floor((plane - plane.min(axis=0)) / SQUARE).astype(int)
    taken = Counter[str]()
    names = []
    for at, (column, row) in enumerate(squares):
        name = "Parking " if at in parking else f"{_letters(int(column))}{row + 1}"
        taken[name] += 1
        number = taken[name]
        after = str(number) if at in parking else _letters(number - 2).lower() if number > 1 else ""
        names.append(name + after)
    return names


def _letters(number: int) -> str:
    """Return A to Z, then AA, AB and so on."""
    before, last = divmod(number, len(ascii_uppercase))
    return (_letters(before - 1) if before else "") + ascii_uppercase[last]
