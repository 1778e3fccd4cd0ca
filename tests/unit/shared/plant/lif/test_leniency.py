"""Faults of the form, and how they are put right."""

from __future__ import annotations

from math import pi, radians
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from nena_shared.plant.lif.document import LifFile
from nena_shared.plant.lif.leniency import faults, put_right

TURN = 2 * pi


def put(raw: Any) -> list[tuple[str, str]]:
    return [(each.code, each.text) for each in put_right(raw)]


def test_equal_faults_are_told_once_with_their_number_and_first_place() -> None:
    with pytest.raises(ValidationError) as caught:
        LifFile.model_validate({"layouts": [{"nodes": [{"nodeId": "A"}, {"nodeId": "B"}]}]})
    told = {each.text for each in faults(caught.value)}
    place = "nodePosition: is missing (found 2 times, first at layouts.0.nodes.0.nodePosition)"
    assert f"layouts.*.nodes.*.{place}" in told
    assert {each.code for each in faults(caught.value)} == {"NOT_LIF"}


def test_missing_stations_are_none_where_there_is_a_layout() -> None:
    raw: dict[str, Any] = {"layouts": [{"nodes": [], "edges": []}, {"nodes": []}]}
    assert put(raw) == []
    assert raw["layouts"] == [{"nodes": [], "edges": [], "stations": []}, {"nodes": []}]


def test_required_of_actions_becomes_their_requirement() -> None:
    raw: dict[str, Any] = {
        "actions": [
            {"required": True},
            {"required": False},
            {"required": True, "requirementType": "CONDITIONAL"},
        ]
    }
    assert put(raw) == [("NOT_LIF", "'required' of actions is read as their requirementType (found 3 times)")]
    assert raw["actions"] == [
        {"requirementType": "REQUIRED"},
        {"requirementType": "OPTIONAL"},
        {"requirementType": "CONDITIONAL"},
    ]


def test_what_is_not_known_is_told_by_its_name_and_left() -> None:
    raw = [{"colour": 1, "nodeId": "A"}, {"colour": 2, "required": "perhaps"}]
    assert put(raw) == [
        ("IGNORED", "field 'colour' is not known (found 2 times)"),
        ("IGNORED", "field 'required' is not known (found 1 times)"),
    ]
    assert raw[1] == {"colour": 2, "required": "perhaps"}


@pytest.mark.parametrize("highest", [TURN, -TURN, 0])
def test_headings_within_a_turn_are_radians(highest: float) -> None:
    raw = [{"theta": highest}, {"vehicleOrientation": 1.5}]
    assert put(raw) == []
    assert raw == [{"theta": highest}, {"vehicleOrientation": 1.5}]


@pytest.mark.parametrize("highest", [90, -90, "90", 6.3])
def test_one_heading_beyond_a_turn_makes_all_of_them_degrees(highest: Any) -> None:
    raw: list[dict[str, Any]] = [{"theta": 3}, {"vehicleOrientation": highest}, {"theta": None}]
    assert [code for code, _ in put(raw)] == ["HEADINGS_IN_DEGREES"]
    assert raw == [{"theta": radians(3)}, {"vehicleOrientation": radians(float(highest))}, {"theta": None}]


@pytest.mark.parametrize("wrong", ["north", [1], {"x": 1}, 10**400])
def test_a_heading_that_is_no_number_stays_wrong_among_degrees(wrong: Any) -> None:
    raw: list[dict[str, Any]] = [{"theta": 90}, {"theta": wrong}]
    put(raw)
    assert raw[1] == {"theta": wrong}


JSON = st.recursive(
    st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=3) | st.integers(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["theta", "vehicleOrientation", "required", "nodes", "edges", "x", "layouts"]),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@settings(max_examples=50)
@given(JSON)
def test_putting_right_never_fails_and_says_once_what_it_does(raw: Any) -> None:
    told = put(raw)
    assert told == sorted(set(told))
    assert not any("requirementType" in text for _, text in put(raw)), "it is right already"
