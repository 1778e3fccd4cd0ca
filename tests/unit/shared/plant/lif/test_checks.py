"""What a file says against its own rules, each by itself."""

from __future__ import annotations

from collections.abc import Iterable
from math import pi
from typing import Any

import pytest

from nena_shared.plant.errors import Problem
from nena_shared.plant.lif.checks import departures, errors, remarks
from nena_shared.plant.lif.document import LifFile
from support.lif_files import action, edge, layout, lif, node, use

RING = (node("A"), node("B", 3, 4), edge("A B"), edge("B A"))


def file(*layouts: dict[str, Any], version: str = "1.0.0") -> LifFile:
    return LifFile.model_validate_json(lif(*layouts, version=version))


def of(*parts: dict[str, Any]) -> LifFile:
    return file(layout(*parts))


def told(problems: Iterable[Problem]) -> list[tuple[str, str]]:
    return [(each.code, each.name) for each in problems]


def heading(value: float) -> dict[str, Any]:
    return node("A", vehicleTypeNodeProperties=[{"vehicleTypeId": "t", "theta": value}])


def test_a_right_file_has_nothing_to_be_told() -> None:
    right = of(*RING, {"stationId": "S", "interactionNodeIds": ["A"]})
    assert [*errors(right), *departures(right), *remarks(right)] == []


@pytest.mark.parametrize(
    ("version", "fault"),
    [("1.0.0", False), ("1.9", False), ("0.11.0", False), ("2.0.0", True), ("10.0", True), ("", True)],
)
def test_only_the_first_version_and_its_draft_are_read(version: str, *, fault: bool) -> None:
    found = file(layout(*RING), version=version)
    assert told(errors(found)) == ([("UNSUPPORTED_VERSION", "")] if fault else [])
    if not fault:
        assert told(departures(found)) == ([("NOT_LIF", "")] if version == "0.11.0" else [])


def test_ids_are_unique_for_their_own_kind_over_all_layouts() -> None:
    twice = file(layout(node("A"), node("B")), layout(node("A"), layoutId="up"))
    assert told(errors(twice)) == [("DUPLICATE_NAME", "A")]
    kinds = of(node("A"), edge("A A", edgeId="A"), {"stationId": "A", "interactionNodeIds": ["A"]})
    assert list(errors(kinds)) == []


def test_each_reference_that_leads_nowhere_is_named() -> None:
    found = list(errors(of(edge("X Y"), {"stationId": "S", "interactionNodeIds": ["Z"]})))
    assert told(found) == [("UNKNOWN_REFERENCE", each) for each in ("X-Y", "X-Y", "S")]
    assert [text in each.text for text, each in zip(("'X'", "'Y'", "'Z'"), found, strict=True)] == [True] * 3


@pytest.mark.parametrize(
    ("value", "told_of"), [(pi, False), (-pi, False), (pi + 1e-7, False), (pi + 1e-5, True), (-4.0, True)]
)
def test_headings_lie_between_minus_pi_and_pi(value: float, *, told_of: bool) -> None:
    at_node = of(heading(value))
    on_edge = of(*RING[:3], edge("B A", use(vehicleOrientation=value)))
    assert told(departures(at_node)) == ([("NOT_LIF", "A")] if told_of else [])
    assert told(departures(on_edge)) == ([("NOT_LIF", "B-A")] if told_of else [])


@pytest.mark.parametrize(("off", "nodes"), [(0.009, []), (0.011, ["A"])])
def test_a_trajectory_ends_within_a_centimetre_of_its_nodes(off: float, nodes: list[str]) -> None:
    drawn = {"knotVector": [0, 0, 1, 1], "controlPoints": [{"x": off, "y": 0}, {"x": 3, "y": 4}]}
    found = list(departures(of(*RING[:2], edge("A B", use(trajectory=drawn)), RING[3])))
    assert [each.text for each in found] == [
        f"its trajectory does not end at node '{each}'; the node's position counts" for each in nodes
    ]


def test_of_a_trajectory_that_cannot_be_followed_its_ends_are_not_looked_at() -> None:
    drawn = {"knotVector": [0, 1], "controlPoints": [{"x": 9, "y": 9}, {"x": 9, "y": 9}]}
    (only,) = departures(of(*RING[:2], edge("A B", use(trajectory=drawn)), RING[3]))
    assert only.text.endswith("it is left out")


def test_an_edge_belongs_to_the_layout_of_its_start() -> None:
    down, up = layout(node("A"), edge("A B")), layout(node("B"), edge("B A"), layoutId="up")
    assert list(departures(file(down, up))) == []
    down["edges"], up["edges"] = up["edges"], down["edges"]
    assert told(departures(file(down, up))) == [("NOT_LIF", "B-A"), ("NOT_LIF", "A-B")]


def test_who_may_drive_an_edge_may_be_at_both_its_ends() -> None:
    found = departures(of(node("A", 0, 0, "t", "u"), node("B"), edge("A B", use("t"), use("u"))))
    assert [each.text for each in found] == ["vehicle type 'u' may not be at its node 'B'"]


@pytest.mark.parametrize(("loaded", "told_of"), [(True, False), (False, True)])
def test_load_sets_are_for_those_who_may_be_loaded(loaded: bool, told_of: bool) -> None:  # noqa: FBT001 - examples
    load = {"loaded": loaded, "unloaded": True, "loadSetNames": ["pallet"]}
    found = of(*RING[:3], edge("B A", use(loadRestriction=load)))
    assert told(departures(found)) == ([("NOT_LIF", "B-A")] if told_of else [])


def test_what_is_kept_and_not_acted_on_is_counted_by_its_kind() -> None:
    required = action("beep", requirementType="REQUIRED")
    both = node("A", vehicleTypeNodeProperties=[{"vehicleTypeId": "t", "actions": [required, required]}])
    one = node("B", vehicleTypeNodeProperties=[{"vehicleTypeId": "t", "actions": [required, action("x")]}])
    lying = edge("A B", use(reentryAllowed=False, rotationAtStartNodeAllowed="NONE", minHeight=0.0))
    texts = [each.text.removesuffix(": kept, and not acted on") for each in remarks(of(both, one, lying))]
    assert texts == [
        "REQUIRED actions at nodes (found 2 times)",
        "minHeight (found 1 times)",
        "reentryAllowed false (found 1 times)",
        "rotationAtStartNodeAllowed (found 1 times)",
        "several REQUIRED actions at one node (found 1 times)",
    ]
