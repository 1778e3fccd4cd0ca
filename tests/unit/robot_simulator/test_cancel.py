from __future__ import annotations

from uuid import UUID

import pytest

from nena_robot_simulator.cancel import ANY_GOAL, CancelCode, answer
from nena_robot_simulator.status_array import GoalEntry, GoalStatus

OLD, YOUNG, CANCELING, ENDED, UNKNOWN = (UUID(int=n) for n in range(1, 6))
GOALS = (
    GoalEntry(OLD, 100, GoalStatus.EXECUTING),
    GoalEntry(CANCELING, 150, GoalStatus.CANCELING),
    GoalEntry(ENDED, 160, GoalStatus.SUCCEEDED),
    GoalEntry(YOUNG, 200, GoalStatus.EXECUTING),
)


@pytest.mark.parametrize(
    ("goal_id", "stamp", "code", "canceled"),
    [
        pytest.param(ANY_GOAL, 0, 0, [OLD, YOUNG], id="all"),
        pytest.param(ANY_GOAL, 100, 0, [OLD], id="all up to a stamp, which counts"),
        pytest.param(ANY_GOAL, 99, 0, [], id="none that old is no error"),
        pytest.param(YOUNG, 0, 0, [YOUNG], id="one goal"),
        pytest.param(UNKNOWN, 0, 2, [], id="an unknown goal"),
        pytest.param(ENDED, 0, 3, [], id="an ended goal"),
        pytest.param(CANCELING, 0, 3, [], id="a goal that is canceling already"),
        pytest.param(YOUNG, 120, 0, [OLD, YOUNG], id="one goal and all up to a stamp"),
        pytest.param(ENDED, 120, 0, [OLD], id="an ended goal and all up to a stamp"),
        pytest.param(UNKNOWN, 120, 0, [OLD], id="an unknown goal and all up to a stamp"),
    ],
)
def test_the_four_kinds_of_request(goal_id: UUID, stamp: int, code: int, canceled: list[UUID]) -> None:
    found = answer(GOALS, goal_id, stamp)
    assert found.code == CancelCode(code)
    assert [goal.goal_id for goal in found.goals] == canceled


def test_cancelling_all_of_nothing_is_no_error() -> None:
    assert answer((), ANY_GOAL, 0) == answer((), ANY_GOAL, 5)
    assert answer((), ANY_GOAL, 0).code is CancelCode.NONE
