"""The halls of the traffic benchmark: plant models, their stations, and the robots' start positions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import dist
from random import Random

from nena_plant_formats.opentcs_xml import read
from nena_shared.plant import (
    BoundingBox,
    Link,
    Location,
    LocationType,
    Path,
    PlantModel,
    Point,
    PointType,
    Vehicle,
)
from support.reference import is_there, reference_dir

MAP_ID = "bench-hall"
SPEED_MM_S = 3000
"""Of the robots, and of paths that name no speed."""
ROBOT_MM = 800
PICK, DROP = "Load cargo", "Unload cargo"
MANUFACTURER = "NeNa"

APART_MM = 4000
SPUR_MM = 2000
COLUMNS, ROWS = 20, 15
TWO_WAY_EACH = 5
STATIONS = 35

HALF_COLUMNS, HALF_ROWS = 8, 6
TRACK_POINTS = 7

ROAD_POINTS = 400
ROAD_WIDTH_MM, ROAD_HEIGHT_MM = 100_000, 75_000
ROAD_APART_MM = 3000
ROAD_LONGEST_MM = 15_000

DEMO = ("opentcs-plant-models", "demo-01.v7.0.0.xml")


@dataclass(frozen=True)
class Hall:
    """A plant model without vehicles, and the locations at which loads are picked and dropped."""

    name: str
    plant: PlantModel
    stations: tuple[str, ...]

    @property
    def station_points(self) -> dict[str, str]:
        """The point of each station."""
        return {name: self.plant.location(name).links[0].point for name in self.stations}

    def starts(self, robots: int) -> tuple[Point, ...]:
        """Return random start positions, not at stations; the same for a number each time."""
        taken = set(self.station_points.values())
        free = [point for point in self.plant.points if point.name not in taken]
        return tuple(Random(robots).sample(free, robots))

    def with_robots(self, robots: int) -> PlantModel:
        """Return the plant model with so many vehicles."""
        return self.plant.model_copy(update={"vehicles": tuple(map(_vehicle, range(robots)))})


def serial_number(robot: int) -> str:
    """Name a robot, counted from 0; it is its vehicle's name too."""
    return f"robot-{robot + 1}"


def _vehicle(robot: int) -> Vehicle:
    return Vehicle(
        name=serial_number(robot),
        bounding_box=BoundingBox(length_mm=ROBOT_MM, width_mm=ROBOT_MM),
        max_velocity_mm_s=SPEED_MM_S,
        properties={
            "vda5050:manufacturer": MANUFACTURER,
            "vda5050:serialNumber": serial_number(robot),
            "vda5050:version": "2.1.0",
            "vda5050:mapId": MAP_ID,
            "vda5050:deviationXY": "0.5",
        },
    )


class Sketch:
    """A plant in the making."""

    def __init__(self) -> None:
        self.points: dict[str, Point] = {}
        self.paths: list[Path] = []

    def point(self, name: str, x_mm: int, y_mm: int, kind: PointType = PointType.HALT_POSITION) -> str:
        """Add a point, mm; return its name."""
        self.points[name] = Point(name=name, x_mm=x_mm, y_mm=y_mm, type=kind)
        return name

    def one_way(self, source: str, destination: str) -> None:
        """Join two points by a straight path."""
        one, other = self.points[source], self.points[destination]
        length = round(dist((one.x_mm, one.y_mm), (other.x_mm, other.y_mm)))
        name = f"{source} --- {destination}"
        self.paths.append(
            Path(
                name=name,
                source=source,
                destination=destination,
                length_mm=length,
                max_velocity_mm_s=SPEED_MM_S,
            )
        )

    def two_way(self, one: str, other: str) -> None:
        """Join two points by a path for each direction."""
        self.one_way(one, other)
        self.one_way(other, one)

    def line(self, *names: str) -> None:
        """Join points in a row, both ways."""
        for one, other in pairwise(names):
            self.two_way(one, other)

    def hall(self, name: str, points: Iterable[str]) -> Hall:
        """Return the hall with a station at each of ``points``."""
        at = {f"Station {number:02d}": point for number, point in enumerate(points, 1)}
        kind = LocationType(name="Station", allowed_operations=(PICK, DROP))
        locations = tuple(
            Location(
                name=station,
                type=kind.name,
                x_mm=self.points[point].x_mm,
                y_mm=self.points[point].y_mm,
                links=(Link(point=point),),
            )
            for station, point in at.items()
        )
        plant = PlantModel(
            name=name,
            points=tuple(self.points.values()),
            paths=tuple(self.paths),
            location_types=(kind,),
            locations=locations,
        )
        return Hall(name, plant, tuple(at))


def grid_point(column: int, row: int) -> str:
    """Name a point of the grid."""
    return f"P{column:02d}-{row:02d}"


def _grid(sketch: Sketch) -> None:
    """Add a grid of points: rows one-way in turn; of the columns each fifth and the last one two-way."""
    for row in range(ROWS):
        for column in range(COLUMNS):
            sketch.point(grid_point(column, row), column * APART_MM, row * APART_MM)
    for row in range(ROWS):
        for column in range(COLUMNS - 1):
            ends = grid_point(column, row), grid_point(column + 1, row)
            sketch.one_way(*(reversed(ends) if row % 2 else ends))
    for column in range(COLUMNS):
        for row in range(ROWS - 1):
            ends = grid_point(column, row), grid_point(column, row + 1)
            if column % TWO_WAY_EACH == 0 or column == COLUMNS - 1:
                sketch.two_way(*ends)
            else:
                sketch.one_way(*(reversed(ends) if column % 2 else ends))


def _served(sketch: Sketch) -> list[str]:
    return Random(STATIONS).sample(sorted(sketch.points), STATIONS)


@cache
def stations_on_aisles() -> Hall:
    """Return the hall of 300 points with stations on its aisles."""
    sketch = Sketch()
    _grid(sketch)
    return sketch.hall("aisles", _served(sketch))


@cache
def stations_on_spurs() -> Hall:
    """Return the same hall with each station on its own spur beside the aisle."""
    sketch = Sketch()
    _grid(sketch)
    spurs = []
    for name in _served(sketch):
        aisle, aside = sketch.points[name], SPUR_MM * 7 // 10
        spurs.append(sketch.point(f"S{name[1:]}", aisle.x_mm + aside, aisle.y_mm + aside))
        sketch.two_way(name, spurs[-1])
    return sketch.hall("spurs", spurs)


@cache
def two_halls() -> Hall:
    """Return two halls joined by one door, and by a two-way single track with passing places."""
    sketch = Sketch()
    above = (HALF_ROWS + 1) * APART_MM

    def name(hall: str, column: int, row: int) -> str:
        return f"{hall}{column:02d}-{row:02d}"

    for hall, bottom in (("A", 0), ("B", above)):
        for row in range(HALF_ROWS):
            for column in range(HALF_COLUMNS):
                sketch.point(name(hall, column, row), column * APART_MM, bottom + row * APART_MM)
        for row in range(HALF_ROWS):
            for column in range(HALF_COLUMNS - 1):
                ends = name(hall, column, row), name(hall, column + 1, row)
                sketch.one_way(*(reversed(ends) if row % 2 else ends))
        for column in range(HALF_COLUMNS):
            sketch.line(*(name(hall, column, row) for row in range(HALF_ROWS)))
    sketch.two_way(name("A", 2, HALF_ROWS - 1), name("B", 2, 0))  # the door
    right, step = HALF_COLUMNS * APART_MM, above // (TRACK_POINTS - 1)
    track = [sketch.point(f"T{number}", right, number * step) for number in range(TRACK_POINTS)]
    sketch.line(name("A", HALF_COLUMNS - 1, 0), *track, name("B", HALF_COLUMNS - 1, 0))
    for number in range(1, TRACK_POINTS, 2):
        aside = sketch.point(f"W{number}", right + APART_MM, number * step)
        sketch.two_way(track[number - 1], aside)
        sketch.two_way(aside, track[number + 1])
    stations = [
        name(hall, column, row) for hall in "AB" for row in (0, 2, 4) for column in range(1, HALF_COLUMNS, 2)
    ]
    return sketch.hall("two halls", stations)


@cache
def random_road_map() -> Hall:
    """Return 400 points by lot, joined both ways where no third one lies in the circle between two."""
    random, sketch = Random(ROAD_POINTS), Sketch()
    places: list[tuple[int, int]] = []
    while len(places) < ROAD_POINTS:
        place = random.randrange(ROAD_WIDTH_MM), random.randrange(ROAD_HEIGHT_MM)
        if all(dist(place, other) >= ROAD_APART_MM for other in places):
            places.append(place)
    for number, place in enumerate(places):
        sketch.point(f"R{number:03d}", *place)
    for one, a in enumerate(places):
        for other, b in enumerate(places[:one]):
            if dist(a, b) > ROAD_LONGEST_MM:
                continue
            middle = (a[0] + b[0]) / 2, (a[1] + b[1]) / 2
            if all(dist(middle, each) >= dist(a, b) / 2 for each in places if each not in (a, b)):
                sketch.two_way(f"R{one:03d}", f"R{other:03d}")
    return sketch.hall("road map", _served(sketch))


@cache
def demo_01() -> Hall:
    """Return openTCS's Demo-01 with its transfer stations; :func:`demo_is_there` first."""
    model = read(reference_dir(*DEMO).read_bytes()).model
    points = tuple(
        each.model_copy(update={"properties": {**each.properties, "vda5050:mapId": MAP_ID}})
        for each in model.points
    )
    stations = tuple(each.name for each in model.locations if each.type == "Transfer station" and each.links)
    return Hall("Demo-01", model.model_copy(update={"points": points}), stations)


def demo_is_there() -> bool:
    """Return whether the plant model of openTCS is at hand."""
    return is_there(*DEMO)


HALLS: Mapping[str, Callable[[], Hall]] = {
    "aisles": stations_on_aisles,
    "spurs": stations_on_spurs,
    "two_halls": two_halls,
    "demo_01": demo_01,
    "road_map": random_road_map,
}


def orders_by_lot(hall: Hall, seed: int = 1) -> Iterable[tuple[str, str]]:
    """Yield the stations at which each order picks and drops, without an end."""
    random = Random(seed)
    while True:
        pick, drop = random.sample(hall.stations, 2)
        yield pick, drop
