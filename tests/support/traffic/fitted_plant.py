"""Plants of the traffic simulation with what orders need: stations, docks, vehicles with a length."""

from __future__ import annotations

from nena_shared.plant import Link, Location, LocationType, PlantModel
from nena_shared.plant.track import BoundingBox
from nena_shared.plant_terms import PointType


def with_docks(plant: PlantModel) -> PlantModel:
    """Add charging locations at each third of the parking positions."""
    parking = [each.name for each in plant.points if each.type is PointType.PARK_POSITION]
    docks = (Location(name=f"dock {each}", type="Dock", links=(Link(point=each),)) for each in parking[::3])
    dock = LocationType(name="Dock", allowed_operations=("Charge",))
    return plant.model_copy(
        update={
            "locations": (*plant.locations, *docks),
            "location_types": (*plant.location_types, dock),
        }
    )


def with_stations(plant: PlantModel, stations: tuple[str, ...], length_mm: int) -> PlantModel:
    """Add a location at each station, positions of points, and a length of vehicles."""
    points = tuple(
        point.model_copy(update={"x_mm": 20_000 * (index % 40), "y_mm": 20_000 * (index // 40)})
        for index, point in enumerate(plant.points)
    )
    locations = tuple(
        Location(name=f"at {station}", type="Station", links=(Link(point=station),)) for station in stations
    )
    box = BoundingBox(length_mm=max(length_mm, 1))
    return plant.model_copy(
        update={
            "points": points,
            "locations": locations,
            "location_types": (LocationType(name="Station", allowed_operations=("Load",)),),
            "vehicles": tuple(each.model_copy(update={"bounding_box": box}) for each in plant.vehicles),
        }
    )
