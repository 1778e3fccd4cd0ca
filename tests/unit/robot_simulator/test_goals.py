from __future__ import annotations

from uuid import UUID

import pytest

from nena_robot_simulator.goals import (
    ANY_GOAL,
    CancelCode,
    GoalEntry,
    GoalTransitionError,
    Snapshot,
    StatusArray,
    answer_cancel,
    of_several,
)
from nena_shared.ros import GoalStatus


@pytest.mark.parametrize(("code", "expected"), [(208, 308), (204, 304), (105, 105), (0, 0), (309, 309)])
def test_only_the_codes_of_the_planner_have_a_twin_for_several_places(code: int, expected: int) -> None:
    assert of_several(code) == expected


A, B, C = UUID(int=1), UUID(int=2), UUID(int=3)


def statuses(snapshot: Snapshot) -> list[tuple[UUID, int]]:
    return [(entry.goal_id, int(entry.status)) for entry in snapshot]


def test_each_change_makes_an_array_in_the_order_of_acceptance() -> None:
    goals = StatusArray(retention=900)
    goals.accept(B, 10, now=0.0)
    goals.accept(A, 20, now=1.0)
    goals.end(B, GoalStatus.ABORTED, now=2.0)
    assert [statuses(s) for s in goals.take_unpublished()] == [[(B, 2)], [(B, 2), (A, 2)], [(B, 6), (A, 2)]]
    assert goals.take_unpublished() == []


def test_goals_cancelled_together_are_shown_in_one_array() -> None:
    goals = StatusArray(retention=900)
    goals.accept(A, 10, now=0.0)
    goals.accept(B, 20, now=0.0)
    goals.take_unpublished()
    goals.cancel([A, B], now=1.0)
    assert [statuses(s) for s in goals.take_unpublished()] == [[(A, 3), (B, 3)]]


def test_an_ended_goal_is_forgotten_in_silence_after_its_retention() -> None:
    goals = StatusArray(retention=5)
    goals.accept(A, 10, now=0.0)
    goals.accept(B, 10, now=0.0)
    goals.end(A, GoalStatus.SUCCEEDED, now=100.0)
    goals.take_unpublished()
    assert len(goals.entries(104.9)) == 2
    assert statuses(goals.entries(105.0)) == [(B, 2)]
    assert goals.take_unpublished() == []
    goals.accept(C, 30, now=106.0)
    assert [statuses(s) for s in goals.take_unpublished()] == [[(B, 2), (C, 2)]]


def test_a_running_goal_is_never_forgotten() -> None:
    goals = StatusArray(retention=5)
    goals.accept(A, 10, now=0.0)
    assert statuses(goals.entries(10_000.0)) == [(A, 2)]


def test_the_stamp_of_acceptance_never_changes() -> None:
    goals = StatusArray(retention=900)
    goals.accept(A, 1234, now=0.0)
    goals.end(A, GoalStatus.ABORTED, now=1.0)
    assert [entry.accepted_ns for entry in goals.entries(1.0)] == [1234]


@pytest.mark.parametrize("end", [GoalStatus.SUCCEEDED, GoalStatus.CANCELED, GoalStatus.ABORTED])
def test_a_canceling_goal_may_still_end_in_each_way(end: GoalStatus) -> None:
    goals = StatusArray(retention=900)
    goals.accept(A, 10, now=0.0)
    goals.cancel([A], now=0.0)
    goals.end(A, end, now=0.0)
    assert goals[A] is end


def test_a_goal_that_nobody_cancelled_cannot_end_canceled() -> None:
    goals = StatusArray(retention=900)
    goals.accept(A, 10, now=0.0)
    with pytest.raises(GoalTransitionError, match="EXECUTING to CANCELED"):
        goals.end(A, GoalStatus.CANCELED, now=0.0)


def test_a_goal_ends_once_and_a_refused_change_changes_nothing() -> None:
    goals = StatusArray(retention=900)
    goals.accept(A, 10, now=0.0)
    goals.end(A, GoalStatus.SUCCEEDED, now=0.0)
    goals.take_unpublished()
    with pytest.raises(GoalTransitionError) as caught:
        goals.end(A, GoalStatus.ABORTED, now=1.0)
    assert (caught.value.goal_id, caught.value.old, caught.value.new) == (
        A,
        GoalStatus.SUCCEEDED,
        GoalStatus.ABORTED,
    )
    assert goals[A] is GoalStatus.SUCCEEDED
    assert goals.take_unpublished() == []


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
    found = answer_cancel(GOALS, goal_id, stamp)
    assert found.code == CancelCode(code)
    assert [goal.goal_id for goal in found.goals] == canceled


def test_cancelling_all_of_nothing_is_no_error() -> None:
    assert answer_cancel((), ANY_GOAL, 0) == answer_cancel((), ANY_GOAL, 5)
    assert answer_cancel((), ANY_GOAL, 0).code is CancelCode.NONE
