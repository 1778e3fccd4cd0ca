"""The hall of the guided tour: one-way roads and aisles, as many sections as its robots need.

```
 parking     |    |    |    |        In each section of six aisles: goods in at the first aisle,
 North   <---+----+----+----+---     goods out at the last one, storage in between.
         |   ^    |    ^    ...      Aisles lead up and down in turn.
 Middle  +---+-->-[Gate]--->+--->
         v   |    v    |    ...
 South   ----+----+----+----+-->
 parking     |    |    |    |  chargers
```
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import pi
from typing import Final

from nena_shared.plant import property_keys as keys
from nena_shared.plant.model import (
    RECHARGE_OPERATION,
    EnergyThresholds,
    Link,
    Location,
    LocationType,
    PlantModel,
    Vehicle,
)
from nena_shared.plant.track import BoundingBox, Path, PeripheralOperation, Point
from nena_shared.plant_terms import ExecutionTrigger, PointType

MAP_ID: Final = "demo-hall"
MANUFACTURER: Final = "NeNa"
GATE: Final = "Gate"
"""The door in the middle road."""
BLOCKED_AISLE: Final = "Middle 3 --- Middle 4"
"""The path that the tour blocks; every station stays reachable without it."""

LOAD, UNLOAD = "Load cargo", "Unload cargo"
SPEED_MM_S, SPUR_SPEED_MM_S = 2000, 1000
AISLE_SPACING, HEIGHT, SPUR = 6, 16, 2
"""m"""
SECTION = 6
"""Aisles of a section; even, so that each begins with an aisle that leads down."""
ROBOTS_PER_CHARGER = 6
VEHICLE_BOX = BoundingBox(length_mm=700, width_mm=500, height_mm=400)
POINT_BOX = BoundingBox(length_mm=1200, width_mm=900, height_mm=2000)


@dataclass(frozen=True, slots=True)
class Place:
    """Where a robot starts, m and rad."""

    x: float
    y: float
    theta: float


@dataclass(slots=True)
class Section:
    """Names of the stations of a section. Loads stay in it, so drives are as short as in a small hall."""

    goods_in: list[str] = field(default_factory=list)
    storage: list[str] = field(default_factory=list)
    goods_out: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Hall:
    """The plant model, the start of each of its vehicles, in their order, and the sections."""

    plant: PlantModel
    starts: tuple[Place, ...]
    sections: tuple[Section, ...]

    @property
    def width(self) -> float:
        """Return the largest x of the hall, m."""
        return max(point.x_m for point in self.plant.points)


def make_hall(serial_numbers: tuple[str, ...]) -> Hall:
    """Return a hall with these vehicles, each at a parking position of its own."""
    sketch = _Sketch(_number_of_aisles(len(serial_numbers)))
    sketch.draw_roads()
    sketch.draw_aisles()
    sketch.draw_stations()
    sketch.draw_edge(chargers=_number_of_chargers(len(serial_numbers)))
    plant = PlantModel(
        name="Demo hall",
        points=tuple(sketch.points),
        paths=tuple(sketch.paths),
        location_types=(
            LocationType(name="Transfer station", allowed_operations=(LOAD, UNLOAD)),
            LocationType(name="Charger", allowed_operations=(RECHARGE_OPERATION,)),
            LocationType(name="Door", allowed_peripheral_operations=("open", "close")),
        ),
        locations=tuple(sketch.locations),
        vehicles=tuple(_make_vehicle(number) for number in serial_numbers),
    )
    return Hall(plant, tuple(sketch.parking[: len(serial_numbers)]), tuple(sketch.sections))


def _number_of_chargers(robots: int) -> int:
    return max(2, robots // ROBOTS_PER_CHARGER)


def _number_of_aisles(robots: int) -> int:
    """Return the number of aisles in the fewest sections that have a parking position for each robot."""
    aisles = SECTION
    while 2 * (2 * aisles - 1) - _number_of_chargers(robots) < robots:
        aisles += SECTION
    return aisles


def _make_vehicle(serial_number: str) -> Vehicle:
    return Vehicle(
        name=serial_number,
        bounding_box=VEHICLE_BOX,
        energy_thresholds=EnergyThresholds(
            critical=25, good=60, sufficiently_recharged=70, fully_recharged=95
        ),
        max_velocity_mm_s=SPEED_MM_S,
        max_reverse_velocity_mm_s=SPUR_SPEED_MM_S,
        properties={
            keys.VDA5050_MANUFACTURER: MANUFACTURER,
            keys.VDA5050_SERIAL_NUMBER: serial_number,
            keys.VDA5050_MAP_ID: MAP_ID,
            keys.VDA5050_VERSION: "2.1.0",
            keys.VDA5050_DEVIATION_XY: "0.5",
        },
    )


@dataclass
class _Sketch:
    """A hall in the making."""

    aisles: int
    points: list[Point] = field(default_factory=list)
    paths: list[Path] = field(default_factory=list)
    locations: list[Location] = field(default_factory=list)
    parking: list[Place] = field(default_factory=list)
    sections: list[Section] = field(default_factory=list)

    def draw_roads(self) -> None:
        """Draw three roads with a point every 3 m; each second one is on an aisle."""
        for road, y, forward in (("South", 0, True), ("Middle", HEIGHT // 2, True), ("North", HEIGHT, False)):
            names = [
                self._add_point(f"{road} {n + 1}", n * AISLE_SPACING // 2, y) for n in self._along_road()
            ]
            self._draw_line(names if forward else names[::-1])

    def draw_aisles(self) -> None:
        """Draw the aisles: the first leads down, the second up, and so on."""
        for aisle in range(self.aisles):
            x, crossing = aisle * AISLE_SPACING, 2 * aisle + 1
            below = self._add_point(f"Aisle {aisle + 1} south", x, HEIGHT // 4)
            above = self._add_point(f"Aisle {aisle + 1} north", x, HEIGHT * 3 // 4)
            upwards = [f"South {crossing}", below, f"Middle {crossing}", above, f"North {crossing}"]
            self._draw_line(upwards if aisle % 2 else upwards[::-1])

    def draw_stations(self) -> None:
        """Draw the stations: on both sides of a section's first and last aisle, on one side of the others."""
        for first in range(0, self.aisles, SECTION):
            section = Section()
            self.sections.append(section)
            last = first + SECTION - 1
            self._draw_aisle_stations("Goods in", first, section.goods_in, both_sides=True)
            for aisle in range(first + 1, last):
                self._draw_aisle_stations("Storage", aisle, section.storage, both_sides=False)
            self._draw_aisle_stations("Goods out", last, section.goods_out, both_sides=True)

    def _draw_aisle_stations(self, kind: str, aisle: int, names: list[str], *, both_sides: bool) -> None:
        """Draw the stations of an aisle, and add their names."""
        for half, y in (("south", HEIGHT // 4), ("north", HEIGHT * 3 // 4)):
            for side in (SPUR, -SPUR) if both_sides else (SPUR,):
                number = sum(location.name.startswith(kind) for location in self.locations) + 1
                x = aisle * AISLE_SPACING + side
                stand = self._draw_spur(f"{kind} {number} stand", x, y, f"Aisle {aisle + 1} {half}")
                self._add_location(f"{kind} {number}", "Transfer station", stand)
                names.append(f"{kind} {number}")

    def draw_edge(self, *, chargers: int) -> None:
        """Draw parking positions along the north and south roads, and chargers at the end of the latter."""
        for road, y in (("North", HEIGHT + SPUR), ("South", -SPUR)):
            for n in self._along_road():
                x, mouth = n * AISLE_SPACING // 2, f"{road} {n + 1}"
                if road == "South" and n >= 2 * self.aisles - 1 - chargers:
                    number = n - (2 * self.aisles - 1 - chargers) + 1
                    stand = self._draw_spur(f"Charger {number} stand", x, y, mouth)
                    self._add_location(f"Charger {number}", "Charger", stand)
                else:
                    self._draw_spur(f"Parking {len(self.parking) + 1}", x, y, mouth, PointType.PARK_POSITION)
                    self.parking.append(Place(x, y, pi / 2 if y < 0 else -pi / 2))
        self.locations.append(
            Location(name=GATE, type="Door", x_mm=self._gate * 3000 - 1500, y_mm=HEIGHT * 500)
        )

    @property
    def _gate(self) -> int:
        """The number of the point of the middle road before the gate, at the middle aisle."""
        return 2 * (self.aisles // 2) - 1

    def _along_road(self) -> range:
        return range(2 * self.aisles - 1)

    def _add_point(self, name: str, x: int, y: int, kind: PointType = PointType.HALT_POSITION) -> str:
        """Add a point at a position in m."""
        self.points.append(
            Point(name=name, x_mm=x * 1000, y_mm=y * 1000, type=kind, max_vehicle_bounding_box=POINT_BOX)
        )
        return name

    def _draw_line(self, names: list[str]) -> None:
        for source, destination in pairwise(names):
            self._add_path(source, destination, SPEED_MM_S)

    def _draw_spur(
        self, name: str, x: int, y: int, mouth: str, kind: PointType = PointType.HALT_POSITION
    ) -> str:
        """Add a point beside a road, with a path there and back."""
        self._add_point(name, x, y, kind)
        self._add_path(mouth, name, SPUR_SPEED_MM_S)
        self._add_path(name, mouth, SPUR_SPEED_MM_S)
        return name

    def _add_path(self, source: str, destination: str, speed: int) -> None:
        one, other = (self._position_of(each) for each in (source, destination))
        self.paths.append(
            Path(
                name=f"{source} --- {destination}",
                source=source,
                destination=destination,
                length_mm=abs(one[0] - other[0]) + abs(one[1] - other[1]),
                max_velocity_mm_s=speed,
                max_reverse_velocity_mm_s=0,
                peripheral_operations=self._door_operations(source, destination),
            )
        )

    def _door_operations(self, source: str, destination: str) -> tuple[PeripheralOperation, ...]:
        """Return the door's operations: opened before the path through it, closed behind the next one."""
        gate = self._gate
        if (source, destination) == (f"Middle {gate}", f"Middle {gate + 1}"):
            return (_door_operation("open", ExecutionTrigger.AFTER_ALLOCATION, required=True),)
        if (source, destination) == (f"Middle {gate + 1}", f"Middle {gate + 2}"):
            return (_door_operation("close", ExecutionTrigger.AFTER_MOVEMENT, required=False),)
        return ()

    def _position_of(self, name: str) -> tuple[int, int]:
        return next((point.x_mm, point.y_mm) for point in reversed(self.points) if point.name == name)

    def _add_location(self, name: str, kind: str, stand: str) -> None:
        x, y = self._position_of(stand)
        self.locations.append(Location(name=name, type=kind, x_mm=x, y_mm=y, links=(Link(point=stand),)))


def _door_operation(name: str, trigger: ExecutionTrigger, *, required: bool) -> PeripheralOperation:
    return PeripheralOperation(
        name=name, location=GATE, execution_trigger=trigger, completion_required=required
    )
