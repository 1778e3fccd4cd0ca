"""The plant of the order service's benchmarks: each robot has a lane of its own, two points and both ways."""

from __future__ import annotations

from pathlib import Path

from bench.robots import Start
from nena_shared.plant import PlantModel, Point, Vehicle
from nena_shared.plant.geometry import BoundingBox
from support.plants import path

MAP_ID = "bench-lanes"
LENGTH_M = 5
APART_M = 2
ROBOT_MM = 800


def robot(number: int) -> str:
    """Name a robot: its serial number, and its vehicle."""
    return f"lane-{number:04d}"


def end_of(number: int, end: int) -> str:
    """Name an end, 0 or 1, of a robot's lane."""
    return f"{robot(number)}-{end}"


def start_of(number: int) -> Start:
    """Give where a robot stands at first."""
    return Start(robot(number), end_of(number, 0), 0.0, float(number * APART_M), MAP_ID)


def write_lanes(folder: Path, robots: int) -> Path:
    """Write the plant model for so many robots."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "lanes.json"
    file.write_text(_lanes(robots).to_json(), encoding="utf-8")
    return file


def _lanes(robots: int) -> PlantModel:
    ends = [(number, end) for number in range(robots) for end in (0, 1)]
    return PlantModel(
        name=f"{robots} lanes",
        points=tuple(
            Point(name=end_of(*each), x_mm=each[1] * LENGTH_M * 1000, y_mm=each[0] * APART_M * 1000)
            for each in ends
        ),
        paths=tuple(
            path(f"{end_of(number, end)} {end_of(number, 1 - end)}", LENGTH_M * 1000) for number, end in ends
        ),
        vehicles=tuple(map(_vehicle, range(robots))),
    )


def _vehicle(number: int) -> Vehicle:
    return Vehicle(
        name=robot(number),
        bounding_box=BoundingBox(length_mm=ROBOT_MM, width_mm=ROBOT_MM),
        properties={
            "vda5050:manufacturer": "NeNa",
            "vda5050:serialNumber": robot(number),
            "vda5050:version": "2.1.0",
            "vda5050:mapId": MAP_ID,
        },
    )
