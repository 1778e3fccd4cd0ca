from typing import Any

import pytest

from nena_shared.plant import (
    Block,
    Link,
    Location,
    LocationType,
    PeripheralOperation,
    PlantModel,
    PointType,
    Vehicle,
)
from nena_shared.plant.checks import find_errors, find_warnings
from support.plants import path, plant

TYPE = LocationType(name="T", allowed_operations=("Load", "Charge"))


def good(**more: Any) -> PlantModel:
    model = plant(path("A B"), path("B A"), location_types=(TYPE,), **more)
    park = model.points[0].model_copy(update={"type": PointType.PARK_POSITION})
    return model.model_copy(update={"points": (park, *model.points[1:])})


def codes(model: PlantModel) -> list[tuple[str, str]]:
    return [(problem.code, problem.name) for problem in (*find_errors(model), *find_warnings(model))]


def test_a_good_model_has_no_findings() -> None:
    assert codes(good(locations=(Location(name="L", type="T", links=(Link(point="A"),)),))) == []


def test_names_are_unique_over_all_kinds_of_object() -> None:
    model = good(vehicles=(Vehicle(name="A"),), blocks=(Block(name="T"),))
    assert [(problem.kind, problem.name) for problem in find_errors(model)] == [
        ("point", "A"),
        ("location type", "T"),
        ("block", "T"),
        ("vehicle", "A"),
    ]


def test_a_name_must_not_be_that_of_a_backward_edge() -> None:
    block = Block(name="A --- B:backward")
    two_ways = (path("A B", max_reverse_velocity_mm_s=1), path("B A"))
    assert ("DUPLICATE_NAME", "A --- B") in codes(plant(*two_ways, blocks=(block,)))
    assert codes(good(blocks=(block,))) == []


def test_every_dangling_reference_is_named() -> None:
    model = plant(
        path("A B", peripheral_operations=(PeripheralOperation(name="open", location="Door"),)),
        locations=(Location(name="L", type="Nothing", links=(Link(point="Z"),)),),
        blocks=(Block(name="X", members=("A", "A --- B", "L", "Q")),),
    ).model_copy(update={"points": ()})
    errors = find_errors(model)
    assert {problem.code for problem in errors} == {"UNKNOWN_REFERENCE"}
    assert [(problem.name, problem.text.split("'")[1]) for problem in errors] == [
        ("A --- B", "A"),
        ("A --- B", "B"),
        ("A --- B", "Door"),
        ("L", "Nothing"),
        ("L", "Z"),
        ("X", "A"),
        ("X", "Q"),
    ]


@pytest.mark.parametrize("name", ["Enschede ", " Enschede", "En\tschede", "Zero\u200bwidth"])
def test_suspicious_names_are_reported_and_kept(name: str) -> None:
    model = good(blocks=(Block(name=name),))
    assert codes(model) == [("SUSPICIOUS_NAME", name)]


@pytest.mark.parametrize(
    ("more", "finding"),
    [
        ({"points": "C"}, ("POINT_WITHOUT_PATH", "C")),
        ({"locations": (Location(name="L", type="T"),)}, ("LOCATION_WITHOUT_LINK", "L")),
        ({"locations": (Location(name="L", type="T", locked=True),)}, ("LOCATION_LOCKED", "L")),
        (
            {"locations": (Location(name="L", type="T", links=(Link(point="A"), Link(point="A"))),)},
            ("DUPLICATE_LINK", "L"),
        ),
        (
            {
                "locations": (
                    Location(name="L", type="T", links=(Link(point="A", allowed_operations=("Paint",)),)),
                )
            },
            ("OPERATION_NOT_OF_TYPE", "L"),
        ),
    ],
)
def test_what_was_probably_not_intended(more: dict[str, Any], finding: tuple[str, str]) -> None:
    assert finding in codes(good(**more))


def test_tracks_that_nobody_drives() -> None:
    found = codes(plant(path("A B", locked=True), path("B A", max_velocity_mm_s=0)))
    assert ("PATH_LOCKED", "A --- B") in found
    assert ("PATH_NOT_DRIVABLE", "B --- A") in found
    assert ("NO_PARK_POSITION", "test") in found


def test_points_that_are_cut_off_are_named() -> None:
    model = plant(path("A B"), path("B A"), path("A C"))
    texts = [problem.text for problem in find_warnings(model) if problem.code == "NOT_STRONGLY_CONNECTED"]
    assert texts == ["not every point can be reached from every other; cut off from the rest: 'C'"]
