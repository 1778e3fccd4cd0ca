"""What LIF cannot hold, each by itself."""

from __future__ import annotations

from typing import Any

import pytest

from nena_shared.plant import Block, Link, Location, LocationType, Path, PlantModel, Point, Vehicle
from nena_shared.plant.geometry import BoundingBox, Envelope
from nena_shared.plant.lif.losses import losses
from nena_shared.plant.lif.to_plant import UNLIMITED_SIZE
from nena_shared.plant.path import ConnectionType, PathLayout, PeripheralOperation
from nena_shared.plant.point import PointType
from nena_shared.plant.vehicle_type import Trajectory, TrajectoryPoint, VehicleTypeOnPath
from support.plants import path, point


def model(
    first: Point | None = None, way: Path | None = None, kind: LocationType | None = None, **more: Any
) -> PlantModel:
    """Make two points 1 m apart with a path between; without more LIF holds all of it."""
    content: dict[str, Any] = {
        "points": (first or point("A"), point("B", 1000)),
        "paths": (way or path("A B"),),
        "location_types": (kind or LocationType(name="T"),),
        "locations": (Location(name="L", type="T", links=(Link(point="A"),)),),
        **more,
    }
    return PlantModel(name="m", **content)


def told(plant: PlantModel) -> list[str]:
    found = list(losses(plant))
    assert all((each.code, each.name) == ("NOT_EXPORTED", "m") for each in found)
    return [each.text.removesuffix(": LIF has nothing for this") for each in found]


OPERATION = PeripheralOperation(name="open", location="L")
BENT = PathLayout(connection_type=ConnectionType.POLYPATH)
DRAWN = VehicleTypeOnPath(
    vehicle_type_id="t",
    rotation_allowed=False,
    trajectory=Trajectory(
        knot_vector=(0, 0, 1, 1), control_points=(TrajectoryPoint(x=0, y=0), TrajectoryPoint(x=1, y=0))
    ),
)


@pytest.mark.parametrize(
    "plant",
    [
        model(),
        model(first=point("A", max_vehicle_bounding_box=UNLIMITED_SIZE)),
        model(first=point("A", properties={"vda5050:mapId": "m", "lif:name": "x"})),
        model(way=path("A B", 1001)),
        model(first=point("A", 1000), way=path("A B", 2)),
        model(way=path("A B", 1700, vehicle_types=(DRAWN,), layout=BENT)),
    ],
)
def test_what_lif_holds_is_no_loss(plant: PlantModel) -> None:
    assert told(plant) == []


@pytest.mark.parametrize(
    ("plant", "loss"),
    [
        (model(first=point("A", type=PointType.PARK_POSITION)), "parking positions"),
        (
            model(first=point("A", max_vehicle_bounding_box=BoundingBox(length_mm=1))),
            "largest vehicles at points",
        ),
        (model(first=point("A", envelopes=(Envelope(key="e", vertices=()),))), "envelopes of points"),
        (model(first=point("A", z_mm=-1)), "heights (z) of points"),
        (model(way=path("A B", locked=True)), "locks of paths, which will be open"),
        (model(way=path("A B", envelopes=(Envelope(key="e", vertices=()),))), "envelopes of paths"),
        (model(way=path("A B", peripheral_operations=(OPERATION,))), "peripheral operations of paths"),
        (model(way=path("A B", 1002)), "lengths that are not the distance of the ends"),
        (model(way=path("A B", layout=BENT)), "drawn courses of paths, which will be straight"),
        (model(locations=(Location(name="L", type="T"),)), "locations without a link"),
        (
            model(locations=(Location(name="L", type="T", links=(Link(point="A"),), locked=True),)),
            "locks of locations, which will be open",
        ),
        (
            model(kind=LocationType(name="T", allowed_peripheral_operations=("open",))),
            "peripheral operations of location types",
        ),
        (model(blocks=(Block(name="K"),)), "blocks"),
        (model(vehicles=(Vehicle(name="V"),)), "vehicles"),
        (model(properties={"tcs:x": "1", "lif:creator": "me"}), "properties"),
        (model(way=path("A B", properties={"a": "1"})), "properties"),
    ],
)
def test_each_loss_is_said_with_how_often_it_is_met(plant: PlantModel, loss: str) -> None:
    assert told(plant) == [f"{loss} (1 times)"]


def test_many_of_a_kind_are_one_loss() -> None:
    blocks = tuple(Block(name=name) for name in "KLM")
    assert told(model(blocks=blocks)) == ["blocks (3 times)"]
