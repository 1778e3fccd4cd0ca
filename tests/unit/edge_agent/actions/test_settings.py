"""Settings of ready-made actions: invalid combinations are refused with their position."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from nena_edge_agent.actions.settings import (
    OperationSettings,
    ParameterSettings,
)
from support.edge_agent import SETTINGS

COMMAND = {"topic": "lift", "type": "std_msgs/msg/String"}


def operations(*tables: dict[str, Any]) -> tuple[Any, ...]:
    return SETTINGS.model_validate({"operations": tables}).operations


def test_a_table_without_a_kind_has_a_fixed_duration() -> None:
    (timed,) = operations({"action_type": "pick", "seconds": 2})

    assert isinstance(timed, OperationSettings)
    assert timed.seconds == 2.0


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        ({"kind": "topik", "action_type": "x"}, "topik"),
        ({"kind": "topic", "action_type": "x"}, "command"),
        ({"kind": "signal", "action_type": "x"}, "answer"),
        ({"kind": "topic", "action_type": "x", "command": {**COMMAND, "on_pause": {}}}, "together"),
        ({"kind": "topic", "action_type": "x", "command": {**COMMAND, "topic": "a b"}}, "ROS name"),
        ({"kind": "turn_signal", "values": {"left": 1}}, "must contain 'off'"),
        ({"action_type": "x", "scopes": []}, "scopes"),
        ({"action_type": "x", "secnds": 1}, "secnds"),
        ({"action_type": "x", "parameters": [{"key": "a b"}]}, "parameters"),
    ],
)
def test_conflicting_settings_are_refused(table: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        operations(table)


def test_a_parameter_with_values_accepts_their_names() -> None:
    declared = ParameterSettings(key="side", values={"left": 1, "right": 2}).declared

    assert declared.choices == ("left", "right")
    assert declared.problem("middle") == "parameter 'side' must be one of left, right"
    assert declared.problem("left") is None
    assert declared.words == "one of left, right"
