"""Find what makes robots wait for each other in a usable plant model, with advice (docs/hall-planning.md)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import dist
from typing import Final

from nena_shared.plant.errors import ObjectKind, PlantProblem
from nena_shared.plant.model import PlantModel
from nena_shared.plant_terms import PointType

LONG_TRACK: Final = 12.0
"""Length from which a two-way track needs a passing place, m."""
PASSED: Final = 2
"""Neighbours of a point inside a track."""

Neighbours = Mapping[str, Mapping[str, str]]
"""Names of paths by neighbour, by point."""


def find_advice(model: PlantModel) -> Iterator[PlantProblem]:
    """Yield dead ends, stations that block the only way, and two-way tracks without passing places."""
    found: defaultdict[str, dict[str, str]] = defaultdict(dict)
    ways = set[tuple[str, str]]()
    for edge in model.edges():
        if not edge.path.locked:
            found[edge.source][edge.destination] = found[edge.destination][edge.source] = edge.path.name
            ways.add((edge.source, edge.destination))
    near: Neighbours = found
    stations = {
        link.point
        for location in model.locations
        if model.location_type(location.type).allowed_operations
        for link in location.links
    }
    only_ways = _cut_points(near)
    for point in model.points:
        name, kind = point.name, ObjectKind.POINT
        if name in stations and name in only_ways:
            text = "no way leads around it: while a robot works at the station, others wait. Put the station "
            yield PlantProblem("STATION_BLOCKS_WAY", kind, name, text + "on a spur, or add a second way")
        if len(near.get(name, ())) == 1 and name not in stations and point.type is PointType.HALT_POSITION:
            text = "a dead end without a station: robots come back the way they came. Lead it on, "
            yield PlantProblem("DEAD_END", kind, name, text + "or make it a parking position")
    for track in _tracks(near):
        pairs = list(pairwise(track))
        if any((b, a) not in ways or (a, b) not in ways for a, b in pairs):
            continue
        places = [(model.point(name).x_m, model.point(name).y_m) for name in track]
        length = sum(map(dist, places, places[1:]))
        if length > LONG_TRACK:
            one, other = pairs[len(pairs) // 2]
            text = f"robots use the {length:.0f} m from {track[0]!r} to {track[-1]!r} in one direction "
            text += "at a time: make them one-way, or add a passing place"
            yield PlantProblem("NO_PASSING_PLACE", ObjectKind.PATH, near[one][other], text)


def _tracks(near: Neighbours) -> Iterator[list[str]]:
    """Yield the points between junctions and dead ends, in order, each track once."""
    seen = set[tuple[str, str]]()
    for start, others in near.items():
        for other in others if len(others) != PASSED else ():
            track = [start, other]
            while len(near[track[-1]]) == PASSED and track[-1] != start:
                track.append(next(name for name in near[track[-1]] if name != track[-2]))
            if (start, other) not in seen:
                seen.add((track[-1], track[-2]))
                yield track


def _cut_points(near: Neighbours) -> set[str]:
    """Return the points without which others could not reach each other, in whatever direction."""
    number: dict[str, int] = {}
    least: dict[str, int] = {}
    cut = set[str]()
    for root in near:
        if root in number:
            continue
        number[root] = least[root] = len(number)
        branches, trail = 0, [(root, "", iter(near[root]))]
        while trail:
            here, before, others = trail[-1]
            for other in others:
                if other not in number:
                    number[other] = least[other] = len(number)
                    trail.append((other, here, iter(near[other])))
                    break
                if other != before:
                    least[here] = min(least[here], number[other])
            else:
                trail.pop()
                if before:
                    least[before] = min(least[before], least[here])
                    branches += before == root
                    if before != root and least[here] >= number[before]:
                        cut.add(before)
        if branches > 1:
            cut.add(root)
    return cut
