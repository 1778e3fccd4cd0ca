"""The hall of the fault tests: a grid with stations on both sides, and robots of the plant model."""

from __future__ import annotations

from pathlib import Path

from nena_shared.plant import Link, Location, LocationType, Vehicle
from nena_shared.plant.track import BoundingBox
from support.plants import GRID_MM, grid_name, grid_plant

COLUMNS, ROWS = 12, 6
ROBOT_MM = 800
MAP_ID = "fault-hall"
LOAD, UNLOAD = "Load cargo", "Unload cargo"
STATIONS = tuple(f"Station {number}" for number in range(COLUMNS))
"""Those with even numbers along the first row of the grid, the others along the last one."""


def station_point(number: int) -> str:
    """Where a station is served from."""
    return grid_name(number, ROWS - 1 if number % 2 else 0)


def start_of(robot: int) -> tuple[float, float]:
    """Return the start position of a robot, m: in the rows between the stations."""
    return (2 * (robot % 5) * GRID_MM / 1000, (2 + robot // 5) * GRID_MM / 1000)


def write_hall(folder: Path, robots: dict[str, str]) -> Path:
    """Write the plant model for robots by serial number, each with its version of VDA 5050."""
    grid = grid_plant(COLUMNS, ROWS)
    locations = tuple(
        Location(
            name=name,
            type="Station",
            x_mm=number * GRID_MM,
            y_mm=ROWS * GRID_MM if number % 2 else -GRID_MM,
            links=(Link(point=station_point(number)),),
        )
        for number, name in enumerate(STATIONS)
    )
    vehicles = tuple(
        Vehicle(
            name=serial,
            bounding_box=BoundingBox(length_mm=ROBOT_MM, width_mm=ROBOT_MM),
            properties={
                "vda5050:manufacturer": "NeNa",
                "vda5050:serialNumber": serial,
                "vda5050:version": version,
                "vda5050:mapId": MAP_ID,
                "vda5050:deviationXY": "0.5",
            },
        )
        for serial, version in robots.items()
    )
    station = LocationType(name="Station", allowed_operations=(LOAD, UNLOAD))
    model = grid.model_copy(
        update={"locations": locations, "location_types": (station,), "vehicles": vehicles}
    )
    file = folder / "hall.json"
    file.write_text(model.to_json(), encoding="utf-8")
    return file
