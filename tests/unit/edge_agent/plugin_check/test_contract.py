"""The contract suite: every ready-made plug-in keeps it, and every deliberately bad one is found."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from pydantic import JsonValue

from nena_edge_agent.actions.plugin import ActionPlugin, ActionTimeouts
from nena_edge_agent.plugin_check.command import findings_of
from nena_edge_agent.plugin_check.contract import (
    CHECKS,
    BrokenError,
    Check,
    Finding,
    Subject,
    Verdict,
    called,
    ends,
    sample,
)
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from support.bad_plugins import BAD, NODE, Good, Hangs, NeverEnds, made

SHORT = ActionTimeouts(begin=0.3, obey=0.3)
LONG = ActionTimeouts(begin=30.0, obey=30.0)
SEEN_AT_THE_END = ("No leaks", "Does not block")


def findings(
    plugin: ActionPlugin,
    *,
    seconds: float = 30.0,
    checks: Sequence[Check] = CHECKS,
    timeouts: ActionTimeouts = SHORT,
) -> dict[str, Finding]:
    subject = Subject(plugin, timeouts=timeouts, seconds=seconds)
    return {each.check: each for each in findings_of(subject, checks)}


def named(name: str) -> Check:
    return next(each for each in CHECKS if str(each.__doc__).startswith(f"{name}:"))


def test_a_correct_plug_in_meets_the_contract() -> None:
    found = findings(Good(), timeouts=LONG)

    assert {each.verdict for each in found.values()} == {Verdict.OK}, found


@pytest.mark.parametrize("name", list(BAD))
def test_violations_of_the_contract_are_found(name: str) -> None:
    plugin, check = BAD[name]
    seconds = 1.0 if name == "never ends" else 30.0

    checks = [ends if check in SEEN_AT_THE_END else named(check)]
    found = findings(plugin, seconds=seconds, checks=checks)[check]

    assert found.verdict is Verdict.BROKEN, found
    assert found.text
    assert found.remedy


def test_a_hanging_action_is_reported_with_its_location() -> None:
    found = findings(made(Hangs), checks=[ends])

    assert found["Does not block"].verdict is Verdict.BROKEN
    assert "forever" in found["Does not block"].text
    assert "in __init__" in found["Does not block"].text


def test_checks_that_could_not_run_do_not_pass() -> None:
    found = findings(made(NeverEnds, ActionDeclaration("good", NODE, timeout=60.0)), seconds=1.0)

    assert found["Start to end"].verdict is Verdict.NOT_SEEN
    assert "fails after 60 s" in found["Start to end"].text
    assert found["Pause and resume"].verdict is Verdict.NOT_SEEN


@pytest.mark.parametrize("data_type", list(ValueDataType))
def test_a_sample_is_a_valid_value_of_the_parameter(data_type: ValueDataType) -> None:
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
def test_a_sample_is_within_the_allowed_values(parameter: Parameter, expected: JsonValue) -> None:
    assert sample(parameter) == expected
    assert parameter.problem(expected) is None


def test_an_action_has_its_required_and_its_given_parameters() -> None:
    needed, optional = Parameter("a", ValueDataType.BOOL), Parameter("b", ValueDataType.BOOL, required=False)
    subject = Subject(made(declaration=ActionDeclaration("x", NODE, (needed, optional))), {"c": 1})

    first, second = subject.action(), subject.action()
    assert {each.key: each.value for each in first.action_parameters} == {"a": True, "c": 1}
    assert first.action_id != second.action_id
    assert first.blocking_type is BlockingType.HARD
    instant = Subject(made(declaration=ActionDeclaration("x", (ActionScope.INSTANT,))))
    assert instant.action().blocking_type is BlockingType.NONE


def test_an_exception_is_reported_with_its_call() -> None:
    with pytest.raises(BrokenError, match="pause raised ZeroDivisionError"):
        called("pause", lambda: 1 // 0)
