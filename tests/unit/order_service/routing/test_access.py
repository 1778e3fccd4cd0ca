"""What is closed to a vehicle because of its type, load, height or maps."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import pytest

from nena_order_service.routing import CostKey, NoRouteError, Router, evaluators
from nena_shared.plant import BoundingBox, PlantModel, Vehicle, lif
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


def by_the_short_way(model: PlantModel, who: Vehicle | None, *, loaded: bool | None = None) -> bool:
    return len(Router(model).route("A", "B", vehicle=who, loaded=loaded).steps) == 1


@pytest.mark.parametrize(
    ("who", "short"), [(vehicle("t"), True), (vehicle("u"), False), (vehicle(), False), (None, True)]
)
def test_a_path_is_open_to_the_types_that_it_names(who: Vehicle | None, *, short: bool) -> None:
    assert by_the_short_way(detour(use("t"), types=("t", "u")), who) is short


def test_where_there_is_one_type_a_vehicle_without_a_name_for_its_own_is_of_it() -> None:
    assert by_the_short_way(detour(use("t")), vehicle())
    with pytest.raises(NoRouteError, match="type"):
        by_the_short_way(detour(use("t")), vehicle("other"))


def test_a_point_is_open_to_the_types_that_it_names() -> None:
    parts = (node("A", 0, 0, "t", "u"), node("B", 1, 0, "t"), edge("A B", use("t"), use("u")))
    router = Router(lif.read(lif_of(*parts)).model)
    assert router.route("A", "B", vehicle=vehicle("t")).steps
    with pytest.raises(NoRouteError):
        router.route("A", "B", vehicle=vehicle("u"))


@pytest.mark.parametrize(("loaded", "short"), [(True, False), (False, True), (None, True)])
def test_the_load_makes_a_difference_where_it_is_known(*, loaded: bool | None, short: bool) -> None:
    model = detour(use("t", loadRestriction={"loaded": False, "unloaded": True}))
    assert by_the_short_way(model, vehicle("t"), loaded=loaded) is short
    router = Router(model)
    assert len(router.route_through("A", [["B"]], vehicle=vehicle("t"), loaded=loaded)[0].steps) == 2 - short
    assert router.costs_from("A", vehicle=vehicle("t"), loaded=loaded)["B"] == (1000 if short else 17_000)


@pytest.mark.parametrize(("height_mm", "short"), [(1800, True), (1801, False)])
def test_high_vehicles_do_not_go_below_low_ceilings(height_mm: int, *, short: bool) -> None:
    who = vehicle("t", bounding_box=BoundingBox(height_mm=height_mm))
    assert by_the_short_way(detour(use("t", maxHeight=1.8)), who) is short


@pytest.mark.parametrize(("reverse", "short"), [(300, True), (0, False)])
def test_who_must_drive_backward_needs_a_reverse_speed(reverse: int, *, short: bool) -> None:
    model = detour(use("t", vehicleOrientation=pi))
    assert by_the_short_way(model, vehicle("t", max_reverse_velocity_mm_s=reverse)) is short


def test_each_type_takes_its_own_time() -> None:
    model = detour(use("t", maxSpeed=0.5), use("u", maxSpeed=0.25), types=("t", "u"))
    router = Router(model, evaluators([CostKey.TRAVELTIME], model))
    assert router.route("A", "B", vehicle=vehicle("t")).cost == 2
    assert router.route("A", "B", vehicle=vehicle("u")).cost == 4
    assert router.route("A", "B", vehicle=vehicle()).cost == 4


def on(map_id: str) -> dict[str, str]:
    return {"vda5050:mapId": map_id}


@pytest.mark.parametrize(
    ("maps", "points"), [("", "A B C"), ("hall, yard", "A B C"), ("hall", "A C"), ("x", "A C")]
)
def test_only_points_on_allowed_maps_are_driven_to(maps: str, points: str) -> None:
    model = PlantModel(
        name="m",
        points=(point("A", properties=on("hall")), point("B", properties=on("yard")), point("C")),
        paths=(path("A B"), path("A C")),
    )
    who = Vehicle(name="V", properties={"nena:allowedMaps": maps})
    assert set(Router(model).costs_from("A", vehicle=who)) == set(points.split())


def test_types_of_vehicles_make_no_difference_where_the_plant_makes_none() -> None:
    router = Router(plant(path("A B", max_reverse_velocity_mm_s=100)))
    assert router.route("B", "A", vehicle=vehicle("t"), loaded=True).steps
