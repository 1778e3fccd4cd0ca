from __future__ import annotations

import pytest

from nena_edge_agent.ros.goal_status import GoalStatus


def test_every_code_of_the_definition_is_known() -> None:
    assert [GoalStatus.of(number).name for number in range(7)] == [
        "UNKNOWN",
        "ACCEPTED",
        "EXECUTING",
        "CANCELING",
        "SUCCEEDED",
        "CANCELED",
        "ABORTED",
    ]


@pytest.mark.parametrize("number", [-1, 7, 127])
def test_code_that_the_definition_does_not_have_says_nothing(number: int) -> None:
    assert GoalStatus.of(number) is GoalStatus.UNKNOWN


def test_three_codes_are_an_end() -> None:
    assert [status for status in GoalStatus if status.terminal] == [
        GoalStatus.SUCCEEDED,
        GoalStatus.CANCELED,
        GoalStatus.ABORTED,
    ]
