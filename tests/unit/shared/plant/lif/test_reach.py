from __future__ import annotations

from nena_shared.plant import Path, PlantModel, Point
from nena_shared.plant.lif.reach import reach_warnings
from nena_shared.plant.vehicle_type import VehicleTypeAtPoint, VehicleTypeOnPath
from support.plants import path, point


def open_point(name: str, types: str) -> Point:
    uses = tuple(VehicleTypeAtPoint(vehicle_type_id=each) for each in types.split())
    return point(name, vehicle_types=uses)


def open_path(ends: str, types: str) -> Path:
    uses = tuple(VehicleTypeOnPath(vehicle_type_id=each, rotation_allowed=False) for each in types.split())
    return path(ends, vehicle_types=uses)


def told(*objects: Point | Path) -> list[str]:
    model = PlantModel(
        name="m",
        points=tuple(each for each in objects if isinstance(each, Point)),
        paths=tuple(each for each in objects if isinstance(each, Path)),
    )
    return [each.text for each in reach_warnings(model)]


A, B = open_point("A", "t u"), open_point("B", "t u")
THERE, BACK = open_path("A B", "t u"), open_path("B A", "t u")


def test_types_that_get_everywhere_and_back_are_not_mentioned() -> None:
    assert told(A, B, THERE, BACK) == []


def test_a_type_that_cannot_come_back_is_named_with_what_is_cut_off() -> None:
    (only,) = told(A, B, THERE, open_path("B A", "t"))
    assert only.startswith("vehicles of type 'u' cannot get everywhere and back; cut off: ")
    assert only.count("'") == 4, "one type and one point"


def test_what_is_closed_to_a_type_is_not_missed_by_it() -> None:
    """It may not be at C, so no way there is wanted, and none that leads through it."""
    own = (open_point("C", "t"), open_path("A C", "t u"), open_path("C A", "t u"))
    assert told(A, B, THERE, BACK, *own) == []


def test_of_one_type_alone_nothing_is_said_here() -> None:
    assert told(open_point("A", "t"), open_point("B", "t"), open_path("A B", "t")) == []


def test_only_some_of_many_points_are_named() -> None:
    far = [open_point(f"P{number}", "u") for number in range(15)]
    (only,) = told(A, B, THERE, BACK, *far)
    assert only.endswith(" ...")
    assert only.count("'") == 2 * (1 + 10)
