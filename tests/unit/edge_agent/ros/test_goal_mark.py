from __future__ import annotations

from nena_edge_agent.ros.goal_mark import GoalMark


def test_an_agent_knows_its_ids_again_after_a_restart() -> None:
    goal_id = GoalMark("nena_edge_agent").new()
    assert GoalMark("nena_edge_agent").bears(goal_id)
    assert not GoalMark("another_agent").bears(goal_id)


def test_ids_are_uuids_and_differ() -> None:
    ids = {GoalMark("nena_edge_agent").new() for _ in range(100)}
    assert len(ids) == 100
    assert {len(bytes.fromhex(each)) for each in ids} == {16}
