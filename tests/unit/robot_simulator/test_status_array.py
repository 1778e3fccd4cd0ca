from __future__ import annotations

from uuid import UUID

import pytest

from nena_robot_simulator.status_array import GoalStatus, GoalTransitionError, Snapshot, StatusArray

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
