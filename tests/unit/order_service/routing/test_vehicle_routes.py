"""Ways as each vehicle may drive."""

from __future__ import annotations

import pytest

from nena_order_service.dispatching.way import RouteFinder
from nena_order_service.routing import NoRouteError, Router, evaluators
from nena_order_service.routing.graph import CostKey
from nena_order_service.routing.vehicle_routes import VehicleRoutes
from nena_order_service.vehicles.registry import VehicleRegistry
from nena_shared.plant import PlantModel, Vehicle
from support.plants import path, point

PLANT = PlantModel(
    name="two ways",
    points=(point("A"), point("B"), point("C")),
    paths=(
        path("A B", properties={"tcs:routingCostForwardheavy": "Infinity", "tcs:routingCostForward": "1"}),
        path("A C", properties={"tcs:routingCostForwardheavy": "1", "tcs:routingCostForward": "9"}),
        path("C B", properties={"tcs:routingCostForwardheavy": "1", "tcs:routingCostForward": "9"}),
    ),
    vehicles=(Vehicle(name="light"), Vehicle(name="heavy", properties={"tcs:routingGroup": "heavy"})),
)


def make() -> tuple[RouteFinder, VehicleRoutes]:
    finder = RouteFinder(PLANT, Router(PLANT, evaluators([CostKey.EXPLICIT_PROPERTIES], PLANT)))
    return finder, VehicleRoutes(finder, VehicleRegistry(PLANT, default_map_id="", adopt_unknown=True))


def test_each_vehicle_has_the_ways_of_its_routing_group() -> None:
    _, ways = make()

    assert ways.route("light", "A", "B").points == ("A", "B")
    assert ways.route("heavy", "A", "B").points == ("A", "C", "B")
    assert ways.route("adopted", "A", "B").points == ("A", "B")
    assert (ways.costs("heavy", "A")["B"], ways.costs("light", "A")["B"]) == (2.0, 1.0)
    assert ways.route("light", "A", "B", avoid={"A --- B"}).points == ("A", "C", "B")


def test_routes_are_remembered_until_the_plant_changes() -> None:
    finder, ways = make()
    before = ways.route("heavy", "A", "B")
    finder.set_locks({"C --- B": True})

    assert ways.route("heavy", "A", "B") is before
    ways.forget()
    with pytest.raises(NoRouteError):
        ways.route("heavy", "A", "B")
