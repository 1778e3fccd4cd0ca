from __future__ import annotations

import pytest

from nena_edge_agent.driver.port import GoalReport
from nena_edge_agent.nav2.goals import GoalEntry, GoalIdPrefix, GoalRegistry
from nena_shared.ros import GoalStatus


def test_every_code_of_the_definition_has_a_meaning() -> None:
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
def test_a_code_outside_the_definition_has_no_meaning(number: int) -> None:
    assert GoalStatus.of(number) is GoalStatus.UNKNOWN


def test_three_codes_are_an_end() -> None:
    assert [status for status in GoalStatus if status.terminal] == [
        GoalStatus.SUCCEEDED,
        GoalStatus.CANCELED,
        GoalStatus.ABORTED,
    ]


MARK = GoalIdPrefix("agent")
EXECUTING, SUCCEEDED, ABORTED = GoalStatus.EXECUTING, GoalStatus.SUCCEEDED, GoalStatus.ABORTED


@pytest.fixture
def registry() -> GoalRegistry:
    """Return a registry that knows the one old goal of its server."""
    registry = GoalRegistry(MARK, confirmation_time=3.0, settle_time=2.0)
    registry.set_servers(frozenset({"gid"}), 0.0)
    registry.update([GoalEntry("old", ABORTED)], 0.0)
    return registry


def test_as_many_new_ids_are_ours_as_goals_were_sent(registry: GoalRegistry) -> None:
    registry.record_published(1.0)
    registry.record_published(4.0)
    entries = [GoalEntry(name, EXECUTING) for name in ("old", "A", "B", "C")]
    assert registry.update(entries, 4.1).claimed == ("A", "B")
    assert registry.live == ("A", "B")


def test_a_sent_goal_is_awaited_and_claims_an_id_for_twice_as_long(registry: GoalRegistry) -> None:
    registry.record_published(1.0)
    assert registry.is_awaiting(3.9)
    assert not registry.is_awaiting(4.0)
    assert registry.update([GoalEntry("A", EXECUTING)], 6.9).claimed == ("A",)


def test_claim_ends_at_last(registry: GoalRegistry) -> None:
    registry.record_published(1.0)
    news = registry.update([GoalEntry("A", EXECUTING)], 7.0)
    assert news.claimed == ()
    assert registry.table.external == (GoalReport("A", external=True, status="EXECUTING"),)


def test_goal_of_ours_that_is_listed_no_more_is_lost_unless_it_had_ended(registry: GoalRegistry) -> None:
    for name in ("A", "B"):
        registry.record_published(1.0)
        registry.update([GoalEntry("A", SUCCEEDED), GoalEntry(name, EXECUTING)], 1.0)
    assert registry.update([GoalEntry("X", EXECUTING)], 2.0).lost == {"B"}


def test_earlier_goals_are_known_from_an_array_or_after_a_time() -> None:
    registry = GoalRegistry(MARK, confirmation_time=3.0, settle_time=2.0)
    assert not registry.is_settled(100.0)
    registry.set_servers(frozenset({"gid"}), 100.0)
    assert not registry.is_settled(101.9)
    assert registry.is_settled(102.0)


def test_new_server_has_to_settle_too(registry: GoalRegistry) -> None:
    assert registry.is_settled(0.0)
    assert registry.set_servers(frozenset({"other"}), 10.0)
    assert not registry.is_settled(10.0)
    assert registry.is_settled(12.0)


def test_a_server_that_outlives_its_successor_counts_again(registry: GoalRegistry) -> None:
    assert registry.set_servers(frozenset({"gid", "other"}), 10.0)
    assert not registry.set_servers(frozenset({"gid", "other"}), 11.0)
    assert registry.set_servers(frozenset({"gid"}), 20.0)
    assert not registry.set_servers(frozenset({"gid"}), 21.0)
    assert not registry.is_settled(21.9)
    assert registry.is_settled(22.0)


def test_the_table_shows_the_owner_of_each_goal_and_an_end_is_final(registry: GoalRegistry) -> None:
    registry.update([GoalEntry("X", EXECUTING)], 1.0)
    registry.record_published(1.0)
    for status in (EXECUTING, SUCCEEDED, EXECUTING):
        registry.update([GoalEntry("X", EXECUTING), GoalEntry("A", status)], 1.0)
    assert registry.table.goals == (
        GoalReport("X", external=True, status="EXECUTING"),
        GoalReport("A", external=False, status="SUCCEEDED", ended=True),
    )


def test_the_table_keeps_running_goals_and_the_newest_ended_ones(registry: GoalRegistry) -> None:
    registry.update([GoalEntry("X", EXECUTING), GoalEntry("before", ABORTED)], 1.0)
    ended = [GoalEntry(f"old {number}", ABORTED) for number in range(100)]
    registry.update([GoalEntry("X", EXECUTING), *ended], 1.0)
    assert [goal.goal_id for goal in registry.table.goals] == ["X", *(f"old {n}" for n in range(95, 100))]


def test_table_is_empty_after_a_restart_of_the_server(registry: GoalRegistry) -> None:
    registry.update([GoalEntry("X", EXECUTING)], 1.0)
    registry.set_servers(frozenset({"other"}), 2.0)
    assert registry.table.goals == ()


def test_a_goal_unknown_to_the_server_has_ended(registry: GoalRegistry) -> None:
    registry.record_published(1.0)
    registry.update([GoalEntry("A", EXECUTING)], 1.0)
    registry.record_unknown("A")
    registry.record_unknown("never heard of")
    assert registry.live == ()


def test_the_goal_that_took_over_is_named(registry: GoalRegistry) -> None:
    registry.record_published(1.0)
    registry.update([GoalEntry("old", ABORTED), GoalEntry("A", EXECUTING)], 1.0)
    assert registry.taken_over("A") is None
    registry.update([GoalEntry("A", ABORTED), GoalEntry("X", EXECUTING)], 1.1)
    assert registry.taken_over("A") == "X"
    assert registry.taken_over("unknown") is None


def test_a_late_array_is_ignored(registry: GoalRegistry) -> None:
    registry.record_published(1.0)
    registry.update([GoalEntry("old", ABORTED), GoalEntry("A", EXECUTING)], 1.0)
    for late in ([GoalEntry("old", ABORTED)], []):
        news = registry.update(late, 1.1)
        assert (news.claimed, news.lost) == ((), frozenset())
    assert registry.live == ("A",)


def test_an_agent_recognises_its_ids_after_a_restart() -> None:
    goal_id = GoalIdPrefix("nena_edge_agent").new()
    assert GoalIdPrefix("nena_edge_agent").matches(goal_id)
    assert not GoalIdPrefix("another_agent").matches(goal_id)


def test_ids_are_uuids_and_differ() -> None:
    ids = {GoalIdPrefix("nena_edge_agent").new() for _ in range(100)}
    assert len(ids) == 100
    assert {len(bytes.fromhex(each)) for each in ids} == {16}


OURS, THEIRS = MARK.new(), "ff" * 16


def prefixed_registry() -> GoalRegistry:
    made = GoalRegistry(MARK, confirmation_time=3.5, settle_time=2.0)
    made.set_servers(frozenset({"gid"}), 0.0)
    return made


def entry(goal_id: str, status: int) -> GoalEntry:
    return GoalEntry(goal_id, GoalStatus.of(status))


def test_only_an_id_with_the_prefix_is_ours_even_while_a_response_is_awaited() -> None:
    goals = prefixed_registry()
    goals.record_sent(1.0)
    goals.update([entry(THEIRS, 2)], 1.1)
    goals.update([entry(THEIRS, 6), entry(OURS, 2)], 1.2)
    assert goals.live == (OURS,)
    assert [row.external for row in goals.table.goals] == [True, False]


def test_an_accepted_goal_is_listed_before_its_array_and_kept_despite_a_late_one() -> None:
    goals = prefixed_registry()
    goals.update([entry(THEIRS, 4)], 0.5)
    goals.record_sent(1.0)
    assert goals.is_awaiting(1.1)
    goals.record_accepted(OURS)
    assert not goals.is_awaiting(1.1)
    assert goals.live == (OURS,)
    assert goals.update([entry(THEIRS, 4)], 1.2).lost == frozenset()
    assert goals.live == (OURS,)


def test_a_result_ends_a_goal_and_an_older_array_does_not_revive_it() -> None:
    goals = prefixed_registry()
    goals.record_accepted(OURS)
    goals.record_end(OURS, GoalStatus.SUCCEEDED)
    goals.update([entry(OURS, 2)], 1.0)
    assert goals.status(OURS) is GoalStatus.SUCCEEDED


def test_a_result_of_an_unknown_or_unfinished_goal_is_ignored() -> None:
    goals = prefixed_registry()
    goals.record_end(OURS, GoalStatus.ABORTED)
    assert goals.status(OURS) is None
    goals.record_accepted(OURS)
    goals.record_end(OURS, GoalStatus.UNKNOWN)
    assert goals.status(OURS) is GoalStatus.ACCEPTED


def test_a_goal_not_listed_before_a_restart_is_recognised_by_its_prefix() -> None:
    goals = prefixed_registry()
    goals.reclaim((), "")
    goals.update([entry(OURS, 2), entry(THEIRS, 2)], 1.0)
    assert goals.given_before == OURS
    assert goals.live == (OURS,)


def test_goals_by_topic_are_worked_out_as_ever() -> None:
    goals = prefixed_registry()
    goals.update([], 0.5)
    goals.record_published(1.0)
    assert goals.update([entry(THEIRS, 2)], 1.1).claimed == (THEIRS,)
