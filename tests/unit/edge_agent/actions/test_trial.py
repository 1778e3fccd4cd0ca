from __future__ import annotations

import pytest
from pydantic import JsonValue

from nena_edge_agent.actions.trial import BrokenError, Subject, called, sample
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from support.bad_plugins import NODE, made


@pytest.mark.parametrize("data_type", list(ValueDataType))
def test_a_sample_is_one_that_the_parameter_takes(data_type: ValueDataType) -> None:
    parameter = Parameter("key", data_type)

    assert parameter.problem(sample(parameter)) is None


@pytest.mark.parametrize(
    ("parameter", "expected"),
    [
        (Parameter("key", ValueDataType.NUMBER, minimum=2.5), 2.5),
        (Parameter("key", ValueDataType.INTEGER, minimum=2.5), 3),
        (Parameter("key", ValueDataType.NUMBER, maximum=0.5), 0.5),
        (Parameter("key", ValueDataType.NUMBER, maximum=-1), -1.0),
        (Parameter("key", ValueDataType.NUMBER, maximum=0), 0.0),
        (Parameter("key", ValueDataType.STRING, choices=("b", "a")), "b"),
    ],
)
def test_a_sample_keeps_to_what_is_allowed(parameter: Parameter, expected: JsonValue) -> None:
    assert sample(parameter) == expected
    assert parameter.problem(expected) is None


def test_an_action_has_what_it_needs_and_what_was_given() -> None:
    needed, optional = Parameter("a", ValueDataType.BOOL), Parameter("b", ValueDataType.BOOL, required=False)
    subject = Subject(made(declaration=ActionDeclaration("x", NODE, (needed, optional))), {"c": 1})

    first, second = subject.action(), subject.action()
    assert {each.key: each.value for each in first.action_parameters} == {"a": True, "c": 1}
    assert first.action_id != second.action_id
    assert first.blocking_type is BlockingType.HARD
    instant = Subject(made(declaration=ActionDeclaration("x", (ActionScope.INSTANT,))))
    assert instant.action().blocking_type is BlockingType.NONE


def test_what_is_raised_is_named_with_the_call() -> None:
    with pytest.raises(BrokenError, match="pause raised ZeroDivisionError"):
        called("pause", lambda: 1 // 0)
