from math import inf

import pytest

from nena_order_service.routing import EVALUATORS, CostKey, ExplicitProperties
from nena_order_service.routing.profile import RoutingProfile
from nena_shared.plant import DirectedEdge, Orientation, Vehicle
from support.plants import path

PATH = path(
    "A B",
    6000,
    max_velocity_mm_s=1000,
    max_reverse_velocity_mm_s=300,
    properties={
        "tcs:routingCostForward": "7",
        "tcs:routingCostReverse": "Infinity",
        "tcs:routingCostForwardWIDE": "9.5",
        "tcs:routingCostReverseWIDE": "many",
        "tcs:routingCostForwardODD": "-1",
        "tcs:routingCostReverseODD": "NaN",
    },
)
FORWARD = DirectedEdge(PATH, Orientation.FORWARD)
BACKWARD = DirectedEdge(PATH, Orientation.BACKWARD)


def test_every_key_has_an_evaluator() -> None:
    assert set(EVALUATORS) == set(CostKey)


@pytest.mark.parametrize(
    ("key", "forward", "backward"),
    [(CostKey.DISTANCE, 6000, 6000), (CostKey.HOPS, 1, 1), (CostKey.TRAVELTIME, 6, 20)],
)
def test_costs_for_any_vehicle(key: CostKey, forward: float, backward: float) -> None:
    assert EVALUATORS[key](FORWARD, RoutingProfile()) == forward
    assert EVALUATORS[key](BACKWARD, RoutingProfile()) == backward


@pytest.mark.parametrize(
    ("own", "own_reverse", "forward", "backward"), [(500, 600, 12, 20), (2000, 100, 6, 60), (0, 0, inf, inf)]
)
def test_travel_time_goes_by_the_slower_of_path_and_vehicle(
    own: int, own_reverse: int, forward: float, backward: float
) -> None:
    vehicle = Vehicle(name="V", max_velocity_mm_s=own, max_reverse_velocity_mm_s=own_reverse)
    profile = RoutingProfile.of(vehicle)
    assert EVALUATORS[CostKey.TRAVELTIME](FORWARD, profile) == forward
    assert EVALUATORS[CostKey.TRAVELTIME](BACKWARD, profile) == backward


@pytest.mark.parametrize(
    ("group", "forward", "backward"),
    [("", 7.0, inf), ("WIDE", 9.5, 100.0), ("ODD", 100.0, 100.0), ("NEW", 100.0, 100.0)],
)
def test_explicit_costs_go_by_the_routing_group(group: str, forward: float, backward: float) -> None:
    vehicle = Vehicle(name="V", properties={"tcs:routingGroup": group})
    evaluate = ExplicitProperties(missing=100.0)
    assert evaluate(FORWARD, RoutingProfile.of(vehicle)) == forward
    assert evaluate(BACKWARD, RoutingProfile.of(vehicle)) == backward
