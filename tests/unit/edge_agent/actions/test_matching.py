from __future__ import annotations

from typing import Any

import pytest
from pydantic import JsonValue

from nena_edge_agent.actions.matching import matches, value_at

MESSAGE = {
    "data": "done",
    "level": 2,
    "ratio": 0.10000000149,
    "pose": {"x": 1.0, "frame": "map"},
    "tags": ["a"],
}


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [
        ({}, True),
        ({"data": "done"}, True),
        ({"data": "don"}, False),
        ({"data": ["failed", "done"]}, True),
        ({"data": []}, False),
        ({"level": 2}, True),
        ({"level": True}, False),
        ({"ratio": 0.1}, True),
        ({"ratio": 0.2}, False),
        ({"pose": {"x": 1}}, True),
        ({"pose": {"x": 1, "frame": ["odom", "map"]}}, True),
        ({"pose": {"y": 1}}, False),
        ({"tags": ["a"]}, True),
        ({"tags": ["b"]}, False),
        ({"tags": "a"}, False),
        ({"absent": 1}, False),
    ],
)
def test_a_message_is_the_one_that_is_wanted(wanted: JsonValue, *, expected: bool) -> None:
    assert matches(MESSAGE, wanted) is expected


@pytest.mark.parametrize(
    ("path", "value"), [("data", "done"), ("pose.frame", "map"), ("pose.z", None), ("data.x", None)]
)
def test_a_field_is_found_by_its_path(path: str, value: Any) -> None:
    assert value_at(MESSAGE, path) == value
