from __future__ import annotations

import pytest

from nena_edge_agent.driver.port import GoalReport
from nena_edge_agent.nav2.goals import GoalEntry, GoalLedger, GoalMark, GoalStatus, MarkedLedger


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


EXECUTING, SUCCEEDED, ABORTED = GoalStatus.EXECUTING, GoalStatus.SUCCEEDED, GoalStatus.ABORTED


@pytest.fixture
def ledger() -> GoalLedger:
    """A ledger that knows the one old goal of its server."""
    ledger = GoalLedger(confirmation_time=3.0, settle_time=2.0)
    ledger.set_servers(frozenset({"gid"}), 0.0)
    ledger.update([GoalEntry("old", ABORTED)], 0.0)
    return ledger


def test_as_many_new_ids_are_ours_as_goals_were_given(ledger: GoalLedger) -> None:
    ledger.given(1.0)
    ledger.given(4.0)
    entries = [GoalEntry(name, EXECUTING) for name in ("old", "A", "B", "C")]
    assert ledger.update(entries, 4.1).claimed == ("A", "B")
    assert ledger.live == ("A", "B")


def test_given_goal_is_awaited_and_claims_an_id_for_twice_as_long(ledger: GoalLedger) -> None:
    ledger.given(1.0)
    assert ledger.awaiting(3.9)
    assert not ledger.awaiting(4.0)
    assert ledger.update([GoalEntry("A", EXECUTING)], 6.9).claimed == ("A",)


def test_claim_ends_at_last(ledger: GoalLedger) -> None:
    ledger.given(1.0)
    news = ledger.update([GoalEntry("A", EXECUTING)], 7.0)
    assert news.claimed == ()
    assert ledger.table.external == (GoalReport("A", external=True, status="EXECUTING"),)


def test_goal_of_ours_that_is_listed_no_more_is_lost_unless_it_had_ended(ledger: GoalLedger) -> None:
    for name in ("A", "B"):
        ledger.given(1.0)
        ledger.update([GoalEntry("A", SUCCEEDED), GoalEntry(name, EXECUTING)], 1.0)
    assert ledger.update([GoalEntry("X", EXECUTING)], 2.0).lost == {"B"}


def test_goals_of_before_are_known_by_an_array_or_by_time() -> None:
    ledger = GoalLedger(confirmation_time=3.0, settle_time=2.0)
    assert not ledger.settled(100.0)
    ledger.set_servers(frozenset({"gid"}), 100.0)
    assert not ledger.settled(101.9)
    assert ledger.settled(102.0)


def test_new_server_has_to_settle_too(ledger: GoalLedger) -> None:
    assert ledger.settled(0.0)
    assert ledger.set_servers(frozenset({"other"}), 10.0)
    assert not ledger.settled(10.0)
    assert ledger.settled(12.0)


def test_server_that_outlives_the_one_that_came_beside_it_counts_again(ledger: GoalLedger) -> None:
    assert ledger.set_servers(frozenset({"gid", "other"}), 10.0)
    assert not ledger.set_servers(frozenset({"gid", "other"}), 11.0)
    assert ledger.set_servers(frozenset({"gid"}), 20.0)
    assert not ledger.set_servers(frozenset({"gid"}), 21.0)
    assert not ledger.settled(21.9)
    assert ledger.settled(22.0)


def test_table_shows_whose_the_goals_are_and_an_end_stays_an_end(ledger: GoalLedger) -> None:
    ledger.update([GoalEntry("X", EXECUTING)], 1.0)
    ledger.given(1.0)
    for status in (EXECUTING, SUCCEEDED, EXECUTING):
        ledger.update([GoalEntry("X", EXECUTING), GoalEntry("A", status)], 1.0)
    assert ledger.table.goals == (
        GoalReport("X", external=True, status="EXECUTING"),
        GoalReport("A", external=False, status="SUCCEEDED", ended=True),
    )


def test_table_keeps_what_runs_and_the_newest_of_what_has_ended(ledger: GoalLedger) -> None:
    ledger.update([GoalEntry("X", EXECUTING), GoalEntry("before", ABORTED)], 1.0)
    ended = [GoalEntry(f"old {number}", ABORTED) for number in range(100)]
    ledger.update([GoalEntry("X", EXECUTING), *ended], 1.0)
    assert [goal.goal_id for goal in ledger.table.goals] == ["X", *(f"old {n}" for n in range(95, 100))]


def test_table_is_empty_after_a_restart_of_the_server(ledger: GoalLedger) -> None:
    ledger.update([GoalEntry("X", EXECUTING)], 1.0)
    ledger.set_servers(frozenset({"other"}), 2.0)
    assert ledger.table.goals == ()


def test_goal_that_the_server_does_not_know_is_over(ledger: GoalLedger) -> None:
    ledger.given(1.0)
    ledger.update([GoalEntry("A", EXECUTING)], 1.0)
    ledger.forget("A")
    ledger.forget("never heard of")
    assert ledger.live == ()


def test_who_has_taken_over(ledger: GoalLedger) -> None:
    ledger.given(1.0)
    ledger.update([GoalEntry("old", ABORTED), GoalEntry("A", EXECUTING)], 1.0)
    assert ledger.taken_over("A") is None
    ledger.update([GoalEntry("A", ABORTED), GoalEntry("X", EXECUTING)], 1.1)
    assert ledger.taken_over("A") == "X"
    assert ledger.taken_over("unknown") is None


def test_array_that_comes_late_says_nothing(ledger: GoalLedger) -> None:
    ledger.given(1.0)
    ledger.update([GoalEntry("old", ABORTED), GoalEntry("A", EXECUTING)], 1.0)
    for late in ([GoalEntry("old", ABORTED)], []):
        news = ledger.update(late, 1.1)
        assert (news.claimed, news.lost) == ((), frozenset())
    assert ledger.live == ("A",)


def test_an_agent_knows_its_ids_again_after_a_restart() -> None:
    goal_id = GoalMark("nena_edge_agent").new()
    assert GoalMark("nena_edge_agent").bears(goal_id)
    assert not GoalMark("another_agent").bears(goal_id)


def test_ids_are_uuids_and_differ() -> None:
    ids = {GoalMark("nena_edge_agent").new() for _ in range(100)}
    assert len(ids) == 100
    assert {len(bytes.fromhex(each)) for each in ids} == {16}


MARK = GoalMark("agent")
OURS, THEIRS = MARK.new(), "ff" * 16


def ledger_of_marked_ledger() -> MarkedLedger:
    made = MarkedLedger(MARK, confirmation_time=3.5, settle_time=2.0)
    made.set_servers(frozenset({"gid"}), 0.0)
    return made


def entry(goal_id: str, status: int) -> GoalEntry:
    return GoalEntry(goal_id, GoalStatus.of(status))


def test_an_id_with_the_mark_is_ours_and_no_other_one_even_while_an_answer_is_awaited() -> None:
    goals = ledger_of_marked_ledger()
    goals.sent(1.0)
    goals.update([entry(THEIRS, 2)], 1.1)
    goals.update([entry(THEIRS, 6), entry(OURS, 2)], 1.2)
    assert goals.live == (OURS,)
    assert [row.external for row in goals.table.goals] == [True, False]


def test_an_accepted_goal_is_there_before_its_array_and_a_late_array_does_not_lose_it() -> None:
    goals = ledger_of_marked_ledger()
    goals.update([entry(THEIRS, 4)], 0.5)
    goals.sent(1.0)
    assert goals.awaiting(1.1)
    goals.accept(OURS)
    assert not goals.awaiting(1.1)
    assert goals.live == (OURS,)
    assert goals.update([entry(THEIRS, 4)], 1.2).lost == frozenset()
    assert goals.live == (OURS,)


def test_a_result_ends_a_goal_and_an_array_of_before_does_not_revive_it() -> None:
    goals = ledger_of_marked_ledger()
    goals.accept(OURS)
    goals.settle(OURS, GoalStatus.SUCCEEDED)
    goals.update([entry(OURS, 2)], 1.0)
    assert goals.status(OURS) is GoalStatus.SUCCEEDED


def test_a_result_of_an_unknown_goal_or_without_an_end_says_nothing() -> None:
    goals = ledger_of_marked_ledger()
    goals.settle(OURS, GoalStatus.ABORTED)
    assert goals.status(OURS) is None
    goals.accept(OURS)
    goals.settle(OURS, GoalStatus.UNKNOWN)
    assert goals.status(OURS) is GoalStatus.ACCEPTED


def test_a_goal_sent_and_not_seen_before_a_restart_is_known_by_its_mark() -> None:
    goals = ledger_of_marked_ledger()
    goals.reclaim((), "")
    goals.update([entry(OURS, 2), entry(THEIRS, 2)], 1.0)
    assert goals.given_before == OURS
    assert goals.live == (OURS,)


def test_goals_by_topic_are_worked_out_as_ever() -> None:
    goals = ledger_of_marked_ledger()
    goals.update([], 0.5)
    goals.given(1.0)
    assert goals.update([entry(THEIRS, 2)], 1.1).claimed == (THEIRS,)
