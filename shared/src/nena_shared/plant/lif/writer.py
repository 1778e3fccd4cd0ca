"""Writes LIF 1.0.0."""

from collections.abc import Sequence
from datetime import datetime
from typing import Final

from nena_shared.plant.lif.from_plant import Given, from_plant
from nena_shared.plant.lif.losses import losses
from nena_shared.plant.model import PlantModel
from nena_shared.plant.reports import ExportReport

DEFAULT_VEHICLE_TYPE: Final = "vehicle"
"""The one to which everything is open, where neither the model nor the caller knows a type."""

DEFAULT_MAP_ID: Final = "map"


def write(
    model: PlantModel, *, at: datetime, map_id: str | None = None, vehicle_types: Sequence[str] = ()
) -> ExportReport:
    """Write a plant model as LIF; the warnings name what LIF cannot hold. `at` (aware) dates the file.

    `map_id` is the map of points that name none, by default the one on which all vehicles drive. What the
    model opens to everybody is opened to `vehicle_types`, by default to those of its vehicles.
    """
    maps = {vehicle.map_id for vehicle in model.vehicles if vehicle.map_id}
    types = {vehicle.vehicle_type for vehicle in model.vehicles if vehicle.vehicle_type}
    given = Given(
        at=at,
        map_id=map_id or (maps.pop() if len(maps) == 1 else DEFAULT_MAP_ID),
        vehicle_types=tuple(vehicle_types) or tuple(sorted(types)) or (DEFAULT_VEHICLE_TYPE,),
    )
    file = from_plant(model, given)
    text = file.model_dump_json(by_alias=True, exclude_none=True, exclude_defaults=True, indent=2)
    return ExportReport(text.encode() + b"\n", tuple(losses(model)))
