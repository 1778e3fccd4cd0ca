from __future__ import annotations

from collections.abc import Collection
from math import inf
from typing import Any

import pytest

from nena_order_service.vehicles.parking import RechargeLocations, Recharging
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant import Link, Location, LocationType, PlantModel, Vehicle
from nena_shared.plant.property_keys import (
    ASSIGNED_RECHARGE_LOCATION,
    PREFERRED_RECHARGE_LOCATION,
    VDA5050_RECHARGE_OPERATION,
)
from support.plants import point


def dock(name: str, *points: str, kind: str = "Dock", **more: Any) -> Location:
    return Location(name=name, type=kind, links=tuple(Link(point=each) for each in points), **more)


PLANT = PlantModel(
    name="docks",
    points=tuple(point(name) for name in "ABCD"),
    location_types=(
        LocationType(name="Dock", allowed_operations=("Clean", "Charge")),
        LocationType(name="Coil", allowed_operations=("Hum",)),
    ),
    locations=(
        dock("near", "A", "B"),
        dock("far", "C"),
        dock("coil", "D", kind="Coil"),
        dock("off", "A", locked=True),
    ),
)
COSTS = {"A": 5.0, "B": 2.0, "C": 3.0, "D": 9.0}


def choose(
    taken: Collection[str] = (),
    *,
    in_vain: Collection[str] = (),
    costs: dict[str, float] | None = None,
    requests: dict[str, str] | None = None,
) -> Recharging:
    model = Vehicle(name="V1", properties=requests or {})
    return RechargeLocations(PLANT, lambda operation: operation == "Charge").choose(
        model,
        cost=lambda name: (COSTS if costs is None else costs).get(name, inf),
        taken=lambda name: name in taken,
        idly_occupied=lambda name: name in in_vain,
    )


def route_request(key: str, value: str) -> dict[str, str]:
    return {key: value}


def test_nearest_free_location_is_taken_by_its_nearest_point() -> None:
    assert choose() == Recharging("near", "Charge")
    assert choose(["B"]).location == "far"
    assert choose(["B", "C"]).location == "near"


def test_assigned_location_is_the_only_one_and_the_preferred_one_goes_first() -> None:
    assert choose(requests=route_request(ASSIGNED_RECHARGE_LOCATION, "far")).location == "far"
    taken = choose(["C"], requests=route_request(ASSIGNED_RECHARGE_LOCATION, "far"))
    assert taken == Recharging(
        reason=Reason(ReasonCode.ASSIGNED_RECHARGE, Reason(ReasonCode.IS_TAKEN), location="far")
    )
    assert "cannot be reached" in str(
        choose(requests=route_request(ASSIGNED_RECHARGE_LOCATION, "coil")).reason
    )
    assert choose(requests=route_request(PREFERRED_RECHARGE_LOCATION, "far")).location == "far"
    assert choose(["C"], requests=route_request(PREFERRED_RECHARGE_LOCATION, "far")).location == "near"


def test_a_vehicle_may_recharge_by_an_operation_of_its_own() -> None:
    assert choose(requests=route_request(VDA5050_RECHARGE_OPERATION, "Hum")) == Recharging("coil", "Hum")


def test_an_idly_occupied_location_is_chosen_if_none_is_free() -> None:
    assert str(choose("ABC").reason) == "each recharge location is taken"
    assert choose("ABC", in_vain="C").location == "far"
    assert choose("AB", in_vain="AB").location == "far"


@pytest.mark.parametrize("costs", [{}, {"D": 1.0}])
def test_the_reason_why_no_vehicle_can_recharge_is_reported(costs: dict[str, float]) -> None:
    assert str(choose(costs=costs).reason) == "there is no reachable recharge location"
