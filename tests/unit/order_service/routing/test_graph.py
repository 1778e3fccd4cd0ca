"""What is closed to a vehicle because of its type, load, height or maps."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, pi
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.routing.graph import (
    CostEvaluator,
    CostKey,
    ExplicitProperties,
    NoRouteError,
    Route,
    RoutingProfile,
    Step,
    VehicleKinds,
    cost_evaluators,
)
from nena_order_service.routing.router import Router
from nena_plant_formats import lif
from nena_shared.plant import BoundingBox, DirectedEdge, Orientation, PlantModel, Vehicle
from support.lif_files import edge, lif_of, node, use
from support.plants import path, plant, point


def vehicle(vehicle_type: str = "", **more: Any) -> Vehicle:
    properties = {"nena:vehicleType": vehicle_type} if vehicle_type else {}
    return Vehicle(name="V", properties=properties, **more)


def detour(*uses: Mapping[str, Any], types: tuple[str, ...] = ("t",)) -> PlantModel:
    """Make the short way A B with these uses, and the long one A C B for every type."""
    every = [use(each) for each in types]
    parts = [node("A", 0, 0, *types), node("B", 1, 0, *types), node("C", 9, 0, *types)]
    edges = [edge("A B", *map(dict, uses)), edge("A C", *every), edge("C B", *every)]
    return lif.read(lif_of(*parts, *edges)).model


def by_the_short_way(model: PlantModel, who: Vehicle | None) -> bool:
    return len(Router(model).route("A", "B", vehicle=who).steps) == 1


@pytest.mark.parametrize(
    ("who", "short"), [(vehicle("t"), True), (vehicle("u"), False), (vehicle(), False), (None, True)]
)
def test_a_path_is_open_to_the_types_that_it_names(who: Vehicle | None, *, short: bool) -> None:
    assert by_the_short_way(detour(use("t"), types=("t", "u")), who) is short


def test_a_vehicle_without_a_type_is_of_the_only_one() -> None:
    assert by_the_short_way(detour(use("t")), vehicle())
    with pytest.raises(NoRouteError, match="type"):
        by_the_short_way(detour(use("t")), vehicle("other"))


def test_a_point_is_open_to_the_types_that_it_names() -> None:
    parts = (node("A", 0, 0, "t", "u"), node("B", 1, 0, "t"), edge("A B", use("t"), use("u")))
    router = Router(lif.read(lif_of(*parts)).model)
    assert router.route("A", "B", vehicle=vehicle("t")).steps
    with pytest.raises(NoRouteError):
        router.route("A", "B", vehicle=vehicle("u"))


@pytest.mark.parametrize(("height_mm", "short"), [(1800, True), (1801, False)])
def test_tall_vehicles_avoid_low_ceilings(height_mm: int, *, short: bool) -> None:
    who = vehicle("t", bounding_box=BoundingBox(height_mm=height_mm))
    assert by_the_short_way(detour(use("t", maxHeight=1.8)), who) is short


@pytest.mark.parametrize(("reverse", "short"), [(300, True), (0, False)])
def test_driving_backward_needs_a_reverse_speed(reverse: int, *, short: bool) -> None:
    model = detour(use("t", vehicleOrientation=pi))
    assert by_the_short_way(model, vehicle("t", max_reverse_velocity_mm_s=reverse)) is short


def test_travel_times_depend_on_the_vehicle_type() -> None:
    model = detour(use("t", maxSpeed=0.5), use("u", maxSpeed=0.25), types=("t", "u"))
    router = Router(model, cost_evaluators([CostKey.TRAVELTIME], model))
    assert router.route("A", "B", vehicle=vehicle("t")).cost == 2
    assert router.route("A", "B", vehicle=vehicle("u")).cost == 4
    assert router.route("A", "B", vehicle=vehicle()).cost == 4


def on(map_id: str) -> dict[str, str]:
    return {"vda5050:mapId": map_id}


@pytest.mark.parametrize(
    ("maps", "points"), [("", "A B C"), ("hall, yard", "A B C"), ("hall", "A C"), ("x", "A C")]
)
def test_only_points_on_allowed_maps_are_reachable(maps: str, points: str) -> None:
    model = PlantModel(
        name="m",
        points=(point("A", properties=on("hall")), point("B", properties=on("yard")), point("C")),
        paths=(path("A B"), path("A C")),
    )
    who = Vehicle(name="V", properties={"nena:allowedMaps": maps})
    assert set(Router(model).costs_from("A", vehicle=who)) == set(points.split())


def test_types_of_vehicles_make_no_difference_where_the_plant_makes_none() -> None:
    router = Router(plant(path("A B", max_reverse_velocity_mm_s=100)))
    assert router.route("B", "A", vehicle=vehicle("t")).steps


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
    (only,) = cost_evaluators([key], plant(PATH))
    return only


def test_every_key_has_an_evaluator_of_its_own() -> None:
    assert len(set(cost_evaluators(CostKey, plant(PATH)))) == len(CostKey)


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
def test_travel_time_uses_the_lower_speed_of_path_and_vehicle(
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
    router = Router(model, cost_evaluators([CostKey.DISTANCE, CostKey.BOUNDING_BOX], model))
    assert router.route("A", "D").points == ("A", "B", "D")
    assert router.route("A", "D", vehicle=WIDE).points == ("A", "C", "D")
    assert router.route("B", "D", vehicle=WIDE).points == ("B", "D")
    with pytest.raises(NoRouteError, match="the cost of path"):
        router.route("A", "B", vehicle=WIDE)
    assert Router(model).route("A", "B", vehicle=WIDE).points == ("A", "B")


def test_evaluators_are_added_up() -> None:
    model = plant(path("A B", 10), path("B D", 10), path("A D", 21))
    chosen = [CostKey.DISTANCE, CostKey.HOPS, CostKey.HOPS]
    assert Router(model, cost_evaluators(chosen, model)).route("A", "D").cost == 23
    assert Router(model).route("A", "D").cost == 20


def test_vehicles_with_equal_routing_profiles_are_of_one_kind() -> None:
    kinds = VehicleKinds(frozenset())
    one, twin = Vehicle(name="V1"), Vehicle(name="V2")
    slow = Vehicle(name="V3", max_velocity_mm_s=1)
    assert kinds.kind_of(one) is kinds.kind_of(twin)
    assert kinds.kind_of(slow).number != kinds.kind_of(one).number
    assert kinds.kind_of(slow).profile == RoutingProfile.of(slow)
    assert kinds.kind_of(None).profile == RoutingProfile()


def test_a_changed_vehicle_is_checked_again() -> None:
    kinds = VehicleKinds(frozenset())
    before = kinds.kind_of(Vehicle(name="V1"))
    assert kinds.kind_of(Vehicle(name="V1", max_velocity_mm_s=1)) is not before


LENGTHS = st.lists(st.integers(1, 10_000), max_size=6)


def route(lengths: list[int]) -> Route:
    """Drive along a chain of paths of these lengths, each for half of its millimetres."""
    edges = [
        DirectedEdge(path(f"{number} {number + 1}", length), Orientation.FORWARD)
        for number, length in enumerate(lengths)
    ]
    return Route("0", str(len(lengths)), tuple(Step(each, each.path.length_mm / 2) for each in edges))


@given(LENGTHS)
def test_cost_and_length_are_those_of_all_steps(lengths: list[int]) -> None:
    found = route(lengths)

    assert found.cost == pytest.approx(sum(lengths) / 2)
    assert found.length_m == pytest.approx(sum(lengths) / 1000)


@given(LENGTHS)
def test_it_passes_every_point_from_its_source_to_its_destination(lengths: list[int]) -> None:
    found = route(lengths)

    assert found.points == tuple(map(str, range(len(lengths) + 1)))
    assert (found.points[0], found.points[-1]) == (found.source, found.destination)


def test_a_step_is_its_edge() -> None:
    (step,) = route([700]).steps

    assert (step.source, step.destination, step.orientation) == ("0", "1", Orientation.FORWARD)
    assert (step.path.name, step.edge_id) == ("0 --- 1", step.edge.id)


def test_traffic_decides_between_parallel_paths() -> None:
    model = plant(path("A B", max_reverse_velocity_mm_s=1000), path("B A"))
    (free,) = Router(model).route("B", "A").steps

    (burdened,) = Router(model).route("B", "A", burden={free.edge_id: 0.3}).steps

    assert burdened.edge_id != free.edge_id
