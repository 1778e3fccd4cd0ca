"""Compares plants that `nena plant new --map` proposes with plants that a person drew for the same map.

``python -m bench.proposals`` prints the orders that robots finish in half an hour (docs/hall-planning.md).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import hypot
from pathlib import Path
from tempfile import TemporaryDirectory

from bench.halls import Sketch
from nena_plant_formats.from_map.free_space import RobotSize
from nena_plant_formats.from_map.proposal import propose_plant
from nena_plant_formats.from_map.robot_map import read_map
from nena_shared.plant import PlantModel, PointType
from nena_simulate.demand import Demand, Relation
from nena_simulate.simulation import simulate
from nena_simulate.site import Case
from support.drawn_maps import CELL, Pixels, office, warehouse, write_map

SIZE = RobotSize(width=0.6, length=0.8, clearance=0.1)
FLEETS, SEEDS, HOURS = (3, 6, 10), (1, 2, 3), 0.5
BACKLOG = 20

Place = tuple[float, float]
"""Right of and below the upper left corner of a map, m."""


class Drawing(Sketch):
    """A plant drawn over a map."""

    def __init__(self, image: Pixels) -> None:
        super().__init__()
        self._height = image.shape[0] * CELL

    def at(self, name: str, x: float, y: float, kind: PointType = PointType.HALT_POSITION) -> str:
        """Add a point at a place of the map, m."""
        return self.point(name, round(1000 * x), round(1000 * (self._height - y)), kind)

    def lane(self, *names: str) -> None:
        """Join points in a row, one way."""
        for one, other in pairwise(names):
            self.one_way(one, other)


def drawn_warehouse(image: Pixels) -> PlantModel:
    """Return a plant with one-way aisles, neighbours in opposite directions, and two lanes at both ends."""
    drawing, rows = Drawing(image), (2.5, 6.6, 10.6, 14.6, 19.1)
    for row, y in enumerate(rows):
        aisle = [drawing.at(f"{row}-{x}", x, y) for x in range(6, 28, 2)]
        drawing.lane(*(aisle if row % 2 == 0 else aisle[::-1]))
    for side, inner, outer, wall, end in (("left", 4.2, 3.0, 1.8, 6), ("right", 27.8, 29.0, 30.2, 26)):
        for row, y in enumerate(rows):
            down, up = drawing.at(f"{side} down {row}", inner, y), drawing.at(f"{side} up {row}", outer, y)
            parking = drawing.at(f"{side} parking {row}", wall, y, PointType.PARK_POSITION)
            drawing.line(f"{row}-{end}", down, up, parking)
        drawing.lane(*(f"{side} down {row}" for row in range(len(rows))))
        drawing.lane(*(f"{side} up {row}" for row in reversed(range(len(rows)))))
    return drawing.hall("drawn", ()).plant


def drawn_office(image: Pixels) -> PlantModel:
    """Return a plant with a two-way corridor, and a one-way ring in each room."""
    drawing = Drawing(image)
    corridor = [drawing.at("west", 1.8, 6.5)]
    for number in range(3):
        x = 4.55 + 8 * number
        corridor.append(drawing.at(f"door {number}", x, 6.5))
        corridor.append(drawing.at(f"corridor {number}", min(x + 3.95, 24.2), 6.5))
        for side, (inside, near, far) in {"north": (4.8, 3.2, 1.9), "south": (8.2, 9.8, 11.1)}.items():
            room = f"{side} {number}"
            entrance = drawing.at(room, x, inside)
            drawing.line(f"door {number}", entrance)
            ring = [(x - 2, near), (x - 2, far), (x, far), (x + 2.5, far), (x + 2.5, near)]
            places = [drawing.at(f"{room}-{at}", *place) for at, place in enumerate(ring)]
            drawing.lane(entrance, *places, entrance)
    drawing.line(*corridor)
    return drawing.hall("drawn", ()).plant


@dataclass(frozen=True)
class Site:
    """A map, a plant that a person drew for it, and the places between which loads are carried both ways."""

    map: Callable[[], Pixels]
    drawn: Callable[[Pixels], PlantModel]
    docks: tuple[Place, ...]
    shelves: tuple[Place, ...]


SITES = (
    Site(
        warehouse,
        drawn_warehouse,
        tuple((2, y) for y in (5, 10, 15, 19)),
        tuple((x, y) for x in (10, 14, 18, 22) for y in (2.5, 6.6, 10.6, 14.6, 19.1)),
    ),
    Site(
        office,
        drawn_office,
        tuple((2.5 + 8 * room, 2.5) for room in range(3)),
        tuple((6.5 + 8 * room, y) for room in range(3) for y in (3.2, 10)),
    ),
)


def finished(site: Site, plant: PlantModel, robots: int, seed: int) -> int:
    """Return how many orders robots finish between the points next to the site's places."""
    height = site.map().shape[0] * CELL

    def nearest(place: Place) -> str:
        x, y = place[0], height - place[1]
        return min(plant.points, key=lambda point: hypot(point.x_m - x, point.y_m - y)).name

    ends = {(nearest(dock), nearest(shelf)) for dock in site.docks for shelf in site.shelves}
    ways = sorted({way for one, other in ends for way in ((one, other), (other, one)) if one != other})
    demand = Demand(relations=tuple(Relation(*way, per_hour=1) for way in ways), backlog=BACKLOG)
    return simulate(Case(plant, demand, robots, hours=HOURS, seed=seed)).finished


def main() -> None:
    """Print the orders finished on the proposed and on the drawn plant, for each site and fleet."""
    for site in SITES:
        image = site.map()
        with TemporaryDirectory() as folder:
            proposed = propose_plant(
                read_map(write_map(Path(folder), image)), SIZE, spacing=3.0, speed=1.0
            ).model
        drawn = site.drawn(image)
        for robots in FLEETS:
            for seed in SEEDS:
                ours, theirs = (finished(site, plant, robots, seed) for plant in (proposed, drawn))
                case = f"{site.map.__name__}, {robots} robots, seed {seed}"
                sys.stdout.write(f"{case}: proposed {ours}, drawn {theirs}, {ours / theirs:.2f} x\n")
                sys.stdout.flush()


if __name__ == "__main__":
    main()
