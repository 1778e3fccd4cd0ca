"""Costs of routes through real plants, computed once by other means, where the models are at hand."""

from itertools import permutations

import pytest

from nena_order_service.routing.router import Router
from nena_plant_formats.opentcs_xml import read
from nena_shared.plant import PlantModel
from support.reference import reference_dir

DEMO = "demo-01.v7.0.0.xml"
NENA = "nena-turtlebot3.v0.0.2.xml"


def plant(name: str) -> PlantModel:
    return read(reference_dir("opentcs-plant-models", name).read_bytes()).model


@pytest.mark.parametrize(
    ("name", "source", "destination", "cost", "steps"),
    [
        (DEMO, "Goods in north 01", "Goods out 01", 112050, 16),
        (DEMO, "Goods in north 02", "Storage 01", 18952, 3),
        (DEMO, "Goods in south 01", "Goods out 02", 24888, 3),
        (DEMO, "Storage 02", "Working station 01", 86968, 12),
        (DEMO, "Working station 03", "Recharge 01", 113009, 17),
        (DEMO, "Goods out 02", "Goods in south 02", 118077, 18),
        (DEMO, "Recharge 04", "Storage 02", 65719, 10),
        (NENA, "Almelo", "Oldenzaal", 25931, 1),
        (NENA, "Enschede ", "Almelo", 55238, 2),
        (NENA, "Haaksbergen", "Enschede K", 83655, 3),
        (NENA, "Oldenzaal", "Haaksbergen", 59544, 2),
    ],
)
def test_from_location_to_location(name: str, source: str, destination: str, cost: float, steps: int) -> None:
    model = plant(name)
    (start,) = model.access_points(source, "NOP")
    (route,) = Router(model).route_through(start, [model.access_points(destination, "NOP")])
    assert (route.cost, len(route.steps)) == (cost, steps)


@pytest.mark.parametrize(
    ("name", "total", "farthest"),
    [
        (DEMO, 297635690, ("Point-0055", "Point-0061", 224807)),
        (NENA, 1620348, ("point-enschede-k", "point-haaksbergen", 124985)),
    ],
)
def test_between_all_points(name: str, total: float, farthest: tuple[str, str, float]) -> None:
    model = plant(name)
    router = Router(model)
    routes = [router.route(*pair) for pair in permutations(model.points_by_name, 2)]
    assert sum(route.cost for route in routes) == total
    longest = max(routes, key=lambda route: route.cost)
    assert (longest.source, longest.destination, longest.cost) == farthest
