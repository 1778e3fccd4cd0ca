from __future__ import annotations

from collections.abc import Mapping

import pytest

from nena_edge_agent.actions.message_shape import FieldError
from nena_edge_agent.actions.message_types import message_type
from nena_edge_agent.actions.settings import FieldValues, OperationBase
from nena_edge_agent.actions.values import ActionValues, MessageTemplate
from nena_shared.settings import ConfigurationError
from support.robot_core import action

SIDE = {"key": "side", "values": {"left": 1, "right": 2}}
LEVEL = {"key": "level", "type": "INTEGER", "required": False}
UINT8 = message_type("std_msgs/msg/UInt8")
STRING = message_type("std_msgs/msg/String")


def values_of(*parameters: Mapping[str, object], load: str = "") -> ActionValues:
    base = {"action_type": "x", "parameters": parameters, "load": load}
    return ActionValues(OperationBase.model_validate(base))


def test_an_action_gives_its_parameters_what_they_stand_for_and_its_id() -> None:
    values = values_of(SIDE, LEVEL).of(action("a1", "HARD", "x", side="right"))

    assert values == {"actionId": "a1", "side": 2, "level": None}


def test_one_that_takes_a_load_may_be_told_of_it_but_not_twice() -> None:
    own = {"key": "loadId", "required": True}

    assert [each.key for each in values_of(load="take").declared] == ["loadId", "loadType"]
    assert [(each.key, each.required) for each in values_of(own, load="take").declared] == [
        ("loadId", True),
        ("loadType", False),
    ]
    assert values_of(load="give").declared == ()


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"data": "{sid}"}, "p.data: there is no parameter 'sid'"),
        ({"date": 1}, "p.date: std_msgs/msg/UInt8 has no such field"),
        ({"data": 300}, "p.data: 300 is not an integer from 0 to 255"),
    ],
)
def test_fields_that_make_no_message_are_refused_with_their_place(fields: FieldValues, problem: str) -> None:
    with pytest.raises(ConfigurationError) as raised:
        MessageTemplate(fields, UINT8, values_of(SIDE), "p")

    assert raised.value.problems[0].startswith(problem)


def test_each_value_that_a_choice_stands_for_is_looked_at() -> None:
    wrong = {"key": "side", "values": {"left": 1, "right": 256}}

    MessageTemplate({"data": "{side}"}, UINT8, values_of(SIDE), "p")
    with pytest.raises(ConfigurationError, match="256 is not an integer"):
        MessageTemplate({"data": "{side}"}, UINT8, values_of(wrong), "p")


def test_an_array_names_all_values_that_will_do_where_it_is_so_meant() -> None:
    names: FieldValues = {"data": ["done {actionId}", "ok"]}

    template = MessageTemplate(names, STRING, values_of(), "p", any_of=True)
    assert template.filled({"actionId": "a1"}) == {"data": ["done a1", "ok"]}
    with pytest.raises(ConfigurationError, match=r"is not a text"):
        MessageTemplate(names, STRING, values_of(), "p")


def test_a_value_that_does_not_fit_its_field_is_found_when_it_is_known() -> None:
    template = MessageTemplate({"data": "{level}"}, UINT8, values_of(LEVEL), "p")

    assert template.filled({"level": 200}) == {"data": 200}
    assert template.filled({"level": None}) == {}
    with pytest.raises(FieldError, match=r"p\.data: 300 is not"):
        template.filled({"level": 300})
