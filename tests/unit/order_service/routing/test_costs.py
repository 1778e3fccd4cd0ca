from math import inf

import pytest

from nena_order_service.routing import CostEvaluator, CostKey, NoRouteError, Router, evaluators
from nena_order_service.routing.graph import ExplicitProperties, RoutingProfile
from nena_shared.plant import BoundingBox, DirectedEdge, Orientation, Vehicle
from support.plants import path, plant, point

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


def evaluator(key: CostKey) -> CostEvaluator:
    (only,) = evaluators([key], plant(PATH))
    return only


def test_every_key_has_an_evaluator_of_its_own() -> None:
    assert len(set(evaluators(CostKey, plant(PATH)))) == len(CostKey)


@pytest.mark.parametrize(
    ("key", "forward", "backward"),
    [(CostKey.DISTANCE, 6000, 6000), (CostKey.HOPS, 1, 1), (CostKey.TRAVELTIME, 6, 20)],
)
def test_costs_for_any_vehicle(key: CostKey, forward: float, backward: float) -> None:
    assert evaluator(key)(FORWARD, RoutingProfile()) == forward
    assert evaluator(key)(BACKWARD, RoutingProfile()) == backward


@pytest.mark.parametrize(
    ("own", "own_reverse", "forward", "backward"), [(500, 600, 12, 20), (2000, 100, 6, 60), (0, 0, inf, inf)]
)
def test_travel_time_goes_by_the_slower_of_path_and_vehicle(
    own: int, own_reverse: int, forward: float, backward: float
) -> None:
    vehicle = Vehicle(name="V", max_velocity_mm_s=own, max_reverse_velocity_mm_s=own_reverse)
    profile = RoutingProfile.of(vehicle)
    assert evaluator(CostKey.TRAVELTIME)(FORWARD, profile) == forward
    assert evaluator(CostKey.TRAVELTIME)(BACKWARD, profile) == backward


@pytest.mark.parametrize(
    ("group", "forward", "backward"),
    [("", 7.0, inf), ("WIDE", 9.5, 100.0), ("ODD", 100.0, 100.0), ("NEW", 100.0, 100.0)],
)
def test_explicit_costs_go_by_the_routing_group(group: str, forward: float, backward: float) -> None:
    vehicle = Vehicle(name="V", properties={"tcs:routingGroup": group})
    evaluate = ExplicitProperties(missing=100.0)
    assert evaluate(FORWARD, RoutingProfile.of(vehicle)) == forward
    assert evaluate(BACKWARD, RoutingProfile.of(vehicle)) == backward


WIDE = Vehicle(name="Wide", bounding_box=BoundingBox(length_mm=1200, width_mm=1001))


def test_a_vehicle_is_not_sent_where_it_is_too_large() -> None:
    narrow = plant(path("A B", 10), path("B D", 10), path("A C", 100), path("C D", 100))
    large = BoundingBox(length_mm=2000, width_mm=2000)
    model = narrow.model_copy(
        update={
            "points": tuple(
                each if each.name == "B" else point(each.name, max_vehicle_bounding_box=large)
                for each in narrow.points
            )
        }
    )
    router = Router(model, evaluators([CostKey.DISTANCE, CostKey.BOUNDING_BOX], model))
    assert router.route("A", "D").points == ("A", "B", "D")
    assert router.route("A", "D", vehicle=WIDE).points == ("A", "C", "D")
    assert router.route("B", "D", vehicle=WIDE).points == ("B", "D")
    with pytest.raises(NoRouteError, match="size"):
        router.route("A", "B", vehicle=WIDE)
    assert Router(model).route("A", "B", vehicle=WIDE).points == ("A", "B")


def test_evaluators_are_added_up() -> None:
    model = plant(path("A B", 10), path("B D", 10), path("A D", 21))
    chosen = [CostKey.DISTANCE, CostKey.HOPS, CostKey.HOPS]
    assert Router(model, evaluators(chosen, model)).route("A", "D").cost == 23
    assert Router(model).route("A", "D").cost == 20
