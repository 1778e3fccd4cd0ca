"""A file's violations of its own rules, each separately."""

from __future__ import annotations

from collections.abc import Iterable
from math import pi, radians
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from nena_plant_formats.lif.checks import (
    deviations,
    errors,
    format_problems,
    reachability_warnings,
    repair,
    unsupported_features,
)
from nena_plant_formats.lif.document import LifFile
from nena_shared.plant import Path, PlantModel, Point
from nena_shared.plant.errors import PlantProblem
from nena_shared.plant.track import VehicleTypeAtPoint, VehicleTypeOnPath
from support.lif_files import action, edge, layout, lif, node, use
from support.plants import path, point

RING = (node("A"), node("B", 3, 4), edge("A B"), edge("B A"))


def file(*layouts: dict[str, Any], version: str = "1.0.0") -> LifFile:
    return LifFile.model_validate_json(lif(*layouts, version=version))


def of(*parts: dict[str, Any]) -> LifFile:
    return file(layout(*parts))


def codes_and_names(problems: Iterable[PlantProblem]) -> list[tuple[str, str]]:
    return [(each.code, each.name) for each in problems]


def heading(value: float) -> dict[str, Any]:
    return node("A", vehicleTypeNodeProperties=[{"vehicleTypeId": "t", "theta": value}])


def test_valid_file_has_no_problems() -> None:
    right = of(*RING, {"stationId": "S", "interactionNodeIds": ["A"]})
    assert [*errors(right), *deviations(right), *unsupported_features(right)] == []


@pytest.mark.parametrize("version", ["1.0.0", "1.9", "0.11.0"])
def test_version_that_is_no_published_one_is_reported(version: str) -> None:
    found = file(layout(*RING), version=version)
    assert codes_and_names(deviations(found)) == ([] if version == "1.0.0" else [("NOT_LIF", "")])


def test_ids_are_unique_for_their_own_kind_over_all_layouts() -> None:
    twice = file(layout(node("A"), node("B")), layout(node("A"), layoutId="up"))
    assert codes_and_names(errors(twice)) == [("DUPLICATE_NAME", "A")]
    kinds = of(node("A"), edge("A A", edgeId="A"), {"stationId": "A", "interactionNodeIds": ["A"]})
    assert list(errors(kinds)) == []


def test_each_reference_that_leads_nowhere_is_named() -> None:
    found = list(errors(of(edge("X Y"), {"stationId": "S", "interactionNodeIds": ["Z"]})))
    assert codes_and_names(found) == [("UNKNOWN_REFERENCE", each) for each in ("X-Y", "X-Y", "S")]
    assert [text in each.text for text, each in zip(("'X'", "'Y'", "'Z'"), found, strict=True)] == [True] * 3


@pytest.mark.parametrize(
    ("value", "told_of"), [(pi, False), (-pi, False), (pi + 1e-7, False), (pi + 1e-5, True), (-4.0, True)]
)
def test_headings_lie_between_minus_pi_and_pi(value: float, *, told_of: bool) -> None:
    at_node = of(heading(value))
    on_edge = of(*RING[:3], edge("B A", use(vehicleOrientation=value)))
    assert codes_and_names(deviations(at_node)) == ([("NOT_LIF", "A")] if told_of else [])
    assert codes_and_names(deviations(on_edge)) == ([("NOT_LIF", "B-A")] if told_of else [])


@pytest.mark.parametrize(("off", "nodes"), [(0.009, []), (0.011, ["A"])])
def test_a_trajectory_ends_within_a_centimetre_of_its_nodes(off: float, nodes: list[str]) -> None:
    drawn = {"knotVector": [0, 0, 1, 1], "controlPoints": [{"x": off, "y": 0}, {"x": 3, "y": 4}]}
    found = list(deviations(of(*RING[:2], edge("A B", use(trajectory=drawn)), RING[3])))
    assert [each.text for each in found] == [
        f"the trajectory does not end at node '{each}'; the node's position is used" for each in nodes
    ]


def test_of_a_trajectory_that_cannot_be_followed_its_ends_are_not_looked_at() -> None:
    drawn = {"knotVector": [0, 1], "controlPoints": [{"x": 9, "y": 9}, {"x": 9, "y": 9}]}
    (only,) = deviations(of(*RING[:2], edge("A B", use(trajectory=drawn)), RING[3]))
    assert only.text.endswith("it is ignored")


def test_an_edge_belongs_to_the_layout_of_its_start() -> None:
    down, up = layout(node("A"), edge("A B")), layout(node("B"), edge("B A"), layoutId="up")
    assert list(deviations(file(down, up))) == []
    down["edges"], up["edges"] = up["edges"], down["edges"]
    assert codes_and_names(deviations(file(down, up))) == [("NOT_LIF", "B-A"), ("NOT_LIF", "A-B")]


def test_vehicle_type_of_an_edge_must_be_allowed_at_both_nodes() -> None:
    found = deviations(of(node("A", 0, 0, "t", "u"), node("B"), edge("A B", use("t"), use("u"))))
    assert [each.text for each in found] == ["vehicle type 'u' is not allowed on its node 'B'"]


@pytest.mark.parametrize(("loaded", "told_of"), [(True, False), (False, True)])
def test_load_sets_require_allowed_loads(loaded: bool, told_of: bool) -> None:  # noqa: FBT001 - examples
    load = {"loaded": loaded, "unloaded": True, "loadSetNames": ["pallet"]}
    found = of(*RING[:3], edge("B A", use(loadRestriction=load)))
    assert codes_and_names(deviations(found)) == ([("NOT_LIF", "B-A")] if told_of else [])


def test_unsupported_content_is_counted_by_kind() -> None:
    required = action("beep", requirementType="REQUIRED")
    first = node("A", vehicleTypeNodeProperties=[{"vehicleTypeId": "t", "actions": [required, action("x")]}])
    empty = {"loaded": False, "unloaded": True}
    odd = use(reentryAllowed=False, rotationAtStartNodeAllowed="NONE", minHeight=0.0, loadRestriction=empty)
    sets = use("u", loadRestriction={"loaded": True, "unloaded": True, "loadSetNames": ["pallet"]})
    lying = edge("A B", odd, sets)
    acting = edge("B A", use(actions=[required]), use("u", actions=[action("x")]))
    texts = [
        each.text.removesuffix(": kept, without effect")
        for each in unsupported_features(of(first, node("B"), lying, acting))
    ]
    assert texts == [
        "feasible actions on edges (found 1 times)",
        "loadRestriction (found 1 times)",
        "names of load sets (found 1 times)",
        "reentryAllowed false (found 1 times)",
        "rotationAtStartNodeAllowed (found 1 times)",
    ]


def put(raw: Any) -> list[tuple[str, str]]:
    return [(each.code, each.text) for each in repair(raw, LifFile)]


def test_equal_problems_are_combined_with_count_and_first_place() -> None:
    with pytest.raises(ValidationError) as caught:
        LifFile.model_validate({"layouts": [{"nodes": [{"nodeId": "A"}, {"nodeId": "B"}]}]})
    told = {each.text for each in format_problems(caught.value)}
    place = "nodePosition: is missing (found 2 times, first at layouts.0.nodes.0.nodePosition)"
    assert f"layouts.*.nodes.*.{place}" in told
    assert {each.code for each in format_problems(caught.value)} == {"NOT_LIF"}


def nodes(*raw: dict[str, Any]) -> dict[str, Any]:
    """Return a file of nodes, of which each has one rule."""
    uses = [{"vehicleTypeNodeProperties": [each]} for each in raw]
    return {"metaInformation": {}, "layouts": [{"nodes": uses}]}


def test_required_of_actions_becomes_their_requirement() -> None:
    given: list[dict[str, Any]] = [
        {"required": True, "blockingType": "HARD"},
        {"required": False, "blockingType": "HARD"},
        {"required": True, "blockingType": "HARD", "requirementType": "CONDITIONAL"},
    ]
    assert put(nodes({"actions": given})) == [
        ("NOT_LIF", "'required' of actions is read as their requirementType (found 3 times)")
    ]
    assert [each["requirementType"] for each in given] == ["REQUIRED", "OPTIONAL", "CONDITIONAL"]


def test_unknown_fields_are_named() -> None:
    given = nodes({"colour": 1}, {"colour": 2, "actions": [{"required": "perhaps", "theta": 0.0}]})
    assert put(given) == [
        ("IGNORED", "unknown field 'colour' (found 2 times)"),
        ("IGNORED", "unknown field 'required' (found 1 times)"),
        ("IGNORED", "unknown field 'theta' (found 1 times)"),
    ]


@pytest.mark.parametrize("highest", [90, -90, "90", 6.3])
def test_heading_beyond_a_turn_means_all_are_degrees(highest: Any) -> None:
    given: list[dict[str, Any]] = [{"theta": 3}, {"theta": highest}]
    assert [code for code, _ in put(nodes(*given))] == ["HEADINGS_IN_DEGREES"]
    assert given == [{"theta": radians(3)}, {"theta": radians(float(highest))}]


@pytest.mark.parametrize("wrong", ["north", [1], {"x": 1}, 10**400])
def test_heading_that_is_not_a_number_stays_invalid_among_degrees(wrong: Any) -> None:
    given: list[dict[str, Any]] = [{"theta": 90}, {"theta": wrong}]
    put(nodes(*given))
    assert given[1] == {"theta": wrong}


JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=3) | st.integers(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                ["theta", "vehicleTypeNodeProperties", "actions", "nodes", "Nodes", "x", "layouts"]
            ),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@settings(max_examples=50)
@given(JSON)
def test_repair_never_fails_and_reports_each_kind_once(raw: Any) -> None:
    told = put(raw)
    assert told == sorted(set(told))
    assert not any("is read as" in text for _, text in put(raw)), "it is right already"


def open_point(name: str, types: str) -> Point:
    uses = tuple(VehicleTypeAtPoint(vehicle_type_id=each) for each in types.split())
    return point(name, vehicle_types=uses)


def open_path(ends: str, types: str) -> Path:
    uses = tuple(VehicleTypeOnPath(vehicle_type_id=each, rotation_allowed=False) for each in types.split())
    return path(ends, vehicle_types=uses)


def told_of_reach(*objects: Point | Path) -> list[str]:
    model = PlantModel(
        name="m",
        points=tuple(each for each in objects if isinstance(each, Point)),
        paths=tuple(each for each in objects if isinstance(each, Path)),
    )
    return [each.text for each in reachability_warnings(model)]


A, B = open_point("A", "t u"), open_point("B", "t u")
THERE, BACK = open_path("A B", "t u"), open_path("B A", "t u")


def test_types_that_get_everywhere_and_back_are_not_mentioned() -> None:
    assert told_of_reach(A, B, THERE, BACK) == []


def test_type_that_cannot_return_is_listed_with_its_unreachable_points() -> None:
    (only,) = told_of_reach(A, B, THERE, open_path("B A", "t"))
    assert only.startswith("vehicles of type 'u' cannot reach every point and return: ")
    assert only.count("'") == 4, "one type and one point"


def test_points_closed_to_a_type_need_not_be_reachable() -> None:
    """It may not be at C, so no way there is wanted, and none that leads through it."""
    own = (open_point("C", "t"), open_path("A C", "t u"), open_path("C A", "t u"))
    assert told_of_reach(A, B, THERE, BACK, *own) == []


def test_only_some_of_many_points_are_named() -> None:
    far = [open_point(f"P{number}", "u") for number in range(15)]
    (only,) = told_of_reach(A, B, THERE, BACK, *far)
    assert only.endswith(" ...")
    assert only.count("'") == 2 * (1 + 10)
