"""Random plants: single tracks with passing places, loops, side tracks; and road maps."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations, pairwise
from math import dist
from random import Random

from nena_shared.plant import PlantModel
from nena_shared.plant.model import Block, Vehicle
from nena_shared.plant.track import Path, Point
from nena_shared.plant_terms import PointType


@dataclass
class PlantSketch:
    """A plant in the making."""

    random: Random
    points: list[Point] = field(default_factory=list)
    paths: list[Path] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    stations: list[str] = field(default_factory=list)

    def point(self, kind: PointType = PointType.HALT_POSITION) -> str:
        """Add a point; its coordinates are of no account here."""
        name = f"p{len(self.points)}"
        self.points.append(Point(name=name, x_mm=0, y_mm=0, type=kind))
        return name

    def path(self, one: str, other: str, *, one_way: bool = False) -> None:
        """Join two points by a path of 1 to 6 m."""
        self.paths.append(
            Path(
                name=f"{one}--{other}",
                source=one,
                destination=other,
                length_mm=self.random.randint(1000, 6000),
                max_reverse_velocity_mm_s=0 if one_way else 1000,
            )
        )

    def line(self, one: str, other: str, between: int, *, one_way: bool = False) -> list[str]:
        """Join two points by a track with some points on it, which are returned."""
        added = [self.point() for _ in range(between)]
        ends = [one, *added, other]
        for before, after in pairwise(ends):
            self.path(before, after, one_way=one_way)
        return added


def random_plant(random: Random, robots: int) -> tuple[PlantModel, tuple[str, ...]]:
    """Make a plant with room for ``robots``; return it with its stations.

    Junctions form a tree of single tracks in both directions, with passing places and some loops on top of
    it. Each robot has a parking place; stations are at side tracks, and some right on a through track.
    """
    sketch = PlantSketch(random)
    junctions = [sketch.point()]
    for _ in range(random.randint(3, 6) + robots // 4):
        _branch(sketch, junctions)
    for _ in range(random.randint(0, 2) + robots // 10):
        one, other = random.sample(junctions, 2)
        sketch.line(one, other, random.randint(1, 3), one_way=random.random() < 0.5)
    for _ in range(robots + 2):
        sketch.path(random.choice(junctions), sketch.point(PointType.PARK_POSITION))
    for _ in range(max(4, robots)):
        station = sketch.point()
        sketch.path(random.choice(junctions), station)
        sketch.stations.append(station)
    sketch.stations.extend(random.sample(junctions, min(2, len(junctions))))
    vehicles = tuple(Vehicle(name=f"v{number}") for number in range(robots))
    plant = PlantModel(
        name="random",
        points=tuple(sketch.points),
        paths=tuple(sketch.paths),
        blocks=tuple(sketch.blocks),
        vehicles=vehicles,
    )
    return plant, tuple(sketch.stations)


def _branch(sketch: PlantSketch, junctions: list[str]) -> None:
    """Add a junction at the end of a single track, which may have a passing place or lie in a block."""
    random, end = sketch.random, sketch.point()
    start = random.choice(junctions)
    middle = sketch.line(start, end, random.randint(0, 3))
    if len(middle) >= 2 and random.random() < 0.7:
        sketch.line(middle[0], middle[-1], 1)
    elif middle and random.random() < 0.3:
        sketch.blocks.append(Block(name=f"b{len(sketch.blocks)}", members=tuple(middle)))
    junctions.append(end)


def random_roads(random: Random, robots: int, *, points_each: int = 5) -> tuple[PlantModel, tuple[str, ...]]:
    """Make a road map with ``points_each`` points for each robot; return it with its stations.

    Two points are joined both ways if no third one lies in the circle between them (Gabriel 1969). Points
    with at most three paths are stations, up to one for each robot.
    """
    sketch = PlantSketch(random)
    places = [(random.random(), random.random()) for _ in range(points_each * robots + 6)]
    degrees = dict.fromkeys((sketch.point() for _ in places), 0)
    for (one, a), (other, b) in combinations(zip(degrees, places, strict=True), 2):
        middle = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2
        if all(dist(middle, each) >= dist(a, b) / 2 for each in places if each not in (a, b)):
            sketch.path(one, other, one_way=False)
            degrees[one] += 1
            degrees[other] += 1
    quiet = sorted(degrees, key=degrees.__getitem__)
    vehicles = tuple(Vehicle(name=f"v{number}") for number in range(robots))
    plant = PlantModel(
        name="roads", points=tuple(sketch.points), paths=tuple(sketch.paths), vehicles=vehicles
    )
    return plant, tuple(quiet[: max(4, robots)])
