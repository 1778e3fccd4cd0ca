"""Values of an order in the fields of a message: one rule, and nothing that an order could do with it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import JsonValue

from nena_edge_agent.actions.template import filled, problems, whole

VALUES: dict[str, JsonValue] = {"height": 1.5, "name": "box", "on": True, "none": None, "list": [1, 2]}


@pytest.mark.parametrize(
    ("template", "expected"),
    [
        ("{height}", 1.5),
        ("{list}", [1, 2]),
        ("raise {height} of {name}", "raise 1.5 of box"),
        ("on: {on}", "on: true"),
        ("{none}", None),
        ("say {none}.", "say ."),
        ("{{name}}", "{name}"),
        (7, 7),
        ({"a": "{height}", "b": {"c": "{none}"}}, {"a": 1.5, "b": {}}),
        (["{name}", "{none}", "{on}"], ["box", True]),
    ],
)
def test_values_are_put_in(template: JsonValue, expected: JsonValue) -> None:
    assert filled(template, VALUES) == expected


@pytest.mark.parametrize(
    ("template", "problem"),
    [
        ({"data": "{hight}"}, "fields.data: there is no parameter 'hight'; there are height, name"),
        ({"a": ["x", "{"]}, "fields.a.1: a lone '{'"),
        ("{name.__class__}", "a lone '{'"),
        ("{name!r}", "a lone '{'"),
        ("{0}", "a lone '{'"),
    ],
)
def test_what_is_no_template_is_found_with_its_place(template: JsonValue, problem: str) -> None:
    assert next(problems(template, ["height", "name"], "fields")).startswith(
        problem if problem.startswith("fields") else f"fields: {problem}"
    )


@given(st.text("{}ab1. _", max_size=20))
def test_a_value_is_never_read_as_a_template(value: str) -> None:
    assert filled("<{name}>", {"name": value}) == f"<{value}>"
    assert filled("{name}", {"name": value}) == value


def test_a_text_that_is_one_name_is_known() -> None:
    assert whole("{height}") == "height"
    assert whole("{height} m") is None
