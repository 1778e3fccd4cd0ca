from __future__ import annotations

from nena_edge_agent.ros.goal_mark import GoalMark
from nena_edge_agent.ros.goal_status import GoalEntry, GoalStatus
from nena_edge_agent.ros.marked_ledger import MarkedLedger

MARK = GoalMark("agent")
OURS, THEIRS = MARK.new(), "ff" * 16


def ledger() -> MarkedLedger:
    made = MarkedLedger(MARK, confirmation_time=3.5, settle_time=2.0)
    made.set_servers(frozenset({"gid"}), 0.0)
    return made


def entry(goal_id: str, status: int) -> GoalEntry:
    return GoalEntry(goal_id, GoalStatus.of(status))


def test_an_id_with_the_mark_is_ours_and_no_other_one_even_while_an_answer_is_awaited() -> None:
    goals = ledger()
    goals.sent(1.0)
    goals.update([entry(THEIRS, 2)], 1.1)
    goals.update([entry(THEIRS, 6), entry(OURS, 2)], 1.2)
    assert goals.live == (OURS,)
    assert [row.external for row in goals.table.goals] == [True, False]


def test_an_accepted_goal_is_there_before_its_array_and_a_late_array_does_not_lose_it() -> None:
    goals = ledger()
    goals.update([entry(THEIRS, 4)], 0.5)
    goals.sent(1.0)
    assert goals.awaiting(1.1)
    goals.accept(OURS)
    assert not goals.awaiting(1.1)
    assert goals.live == (OURS,)
    assert goals.update([entry(THEIRS, 4)], 1.2).lost == frozenset()
    assert goals.live == (OURS,)


def test_a_result_ends_a_goal_and_an_array_of_before_does_not_revive_it() -> None:
    goals = ledger()
    goals.accept(OURS)
    goals.settle(OURS, GoalStatus.SUCCEEDED)
    goals.update([entry(OURS, 2)], 1.0)
    assert goals.status(OURS) is GoalStatus.SUCCEEDED


def test_a_result_of_an_unknown_goal_or_without_an_end_says_nothing() -> None:
    goals = ledger()
    goals.settle(OURS, GoalStatus.ABORTED)
    assert goals.status(OURS) is None
    goals.accept(OURS)
    goals.settle(OURS, GoalStatus.UNKNOWN)
    assert goals.status(OURS) is GoalStatus.ACCEPTED


def test_a_goal_sent_and_not_seen_before_a_restart_is_known_by_its_mark() -> None:
    goals = ledger()
    goals.reclaim((), "")
    goals.update([entry(OURS, 2), entry(THEIRS, 2)], 1.0)
    assert goals.given_before == OURS
    assert goals.live == (OURS,)


def test_goals_by_topic_are_worked_out_as_ever() -> None:
    goals = ledger()
    goals.update([], 0.5)
    goals.given(1.0)
    assert goals.update([entry(THEIRS, 2)], 1.1).claimed == (THEIRS,)
