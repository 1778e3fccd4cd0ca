"""What a goal that somebody else gave to navigation does to an order."""

from __future__ import annotations

from nena_edge_agent.driver.port import DriveFailed, DriveFailure, GoalReport, GoalTable
from nena_edge_agent.protocol.capabilities import ExternalGoals
from nena_edge_agent.protocol.conditions import EXTERNAL_GOAL
from nena_shared.vda5050.error import ErrorType
from support.robot_core import Bench, action, order

THEIRS = GoalTable((GoalReport("X", external=True, status="EXECUTING"),))
THEIRS_ENDED = GoalTable((GoalReport("X", external=True, status="SUCCEEDED", ended=True),))
OURS = GoalTable((GoalReport("A", external=False, status="EXECUTING"),))


def taken_over(policy: ExternalGoals) -> Bench:
    """Give a robot whose navigation has left its order for somebody else's goal."""
    bench = Bench(external_goals=policy)
    bench.send(order("n0", "n1"))
    bench.do(OURS, THEIRS, DriveFailed(bench.goal.generation, DriveFailure.TAKEN_OVER, "X has replaced it"))
    return bench


def test_pause_waits_for_the_end_of_the_other_drive_and_gives_the_goal_again() -> None:
    bench = taken_over(ExternalGoals.PAUSE)
    assert bench.errors == [EXTERNAL_GOAL]
    assert bench.state.driving
    assert len(bench.goals) == 1

    bench.do(THEIRS_ENDED)

    assert [goal.pose for goal in bench.goals] == [bench.goal.pose] * 2
    assert bench.errors == []
    bench.arrive()
    assert bench.nodes == []


def test_pause_goes_on_at_once_where_the_other_drive_has_ended_already() -> None:
    bench = Bench(external_goals=ExternalGoals.PAUSE)
    bench.send(order("n0", "n1"))
    failed = DriveFailed(bench.goal.generation, DriveFailure.TAKEN_OVER, "X has replaced it")
    bench.do(THEIRS, THEIRS_ENDED)
    assert len(bench.goals) == 1
    bench.do(failed)
    assert (len(bench.goals), bench.errors) == (2, [])


def test_fail_is_an_error_that_names_it_and_an_update_tries_again() -> None:
    bench = taken_over(ExternalGoals.FAIL)
    (error,) = bench.state.errors
    assert error.error_type == ErrorType.NODE_UNREACHABLE
    assert "TAKEN_OVER" in str(error.error_description)

    bench.do(THEIRS_ENDED)
    assert len(bench.goals) == 1

    bench.send(order("n1", "n2", update=1, first=2))
    assert len(bench.goals) == 2


def test_pause_keeps_an_order_from_beginning() -> None:
    bench = Bench(external_goals=ExternalGoals.PAUSE)
    bench.do(THEIRS)
    bench.send(order("n0", "n1"))
    assert (bench.goals, bench.errors) == ([], [EXTERNAL_GOAL])
    bench.do(GoalTable())
    assert len(bench.goals) == 1


def test_fail_fails_an_order_that_begins() -> None:
    bench = Bench(external_goals=ExternalGoals.FAIL)
    bench.do(THEIRS)
    bench.send(order("n0", "n1"))
    assert (bench.goals, bench.errors) == ([], [ErrorType.NODE_UNREACHABLE])
    assert "X" in str(bench.state.errors[0].error_description)


def test_without_an_order_an_external_goal_is_no_error() -> None:
    bench = Bench()
    bench.do(THEIRS)
    assert bench.errors == []


def test_an_order_that_waits_can_be_cancelled() -> None:
    bench = taken_over(ExternalGoals.PAUSE)
    bench.instant(action("c", "NONE", "cancelOrder"))
    assert bench.status("c") == "FINISHED"
    assert (bench.nodes, bench.errors) == ([], [])


def test_the_state_shows_each_goal_and_whose_it_is() -> None:
    bench = Bench()
    bench.do(GoalTable((*OURS.goals, *THEIRS.goals)))
    shown = bench.state.information or ()
    assert [
        (each.info_type, {r.reference_key: r.reference_value for r in each.info_references}) for each in shown
    ] == [
        ("goal", {"goalId": "A", "status": "EXECUTING"}),
        ("externalGoal", {"goalId": "X", "status": "EXECUTING"}),
    ]


def test_what_navigation_has_taken_of_us_is_kept_for_a_restart() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    before = bench.core.durable_version
    bench.do(OURS)
    assert bench.core.durable_version != before

    memory = bench.core.memory()
    own = Bench(memory=memory, ready=False).core.own_goals

    assert own is not None
    assert (own.goal_ids, own.pose) == (("A",), bench.goal.pose)
    bench.do(GoalTable())
    assert bench.core.memory().own_goals == memory.own_goals, "what it has come to is not told yet"
    bench.arrive()
    assert bench.core.memory().own_goals is None


def test_a_goal_that_is_not_listed_yet_does_not_lend_its_place_to_the_one_before() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2"))
    bench.do(OURS)
    first = bench.goal.pose
    bench.arrive()
    bench.do(GoalTable(OURS.goals))
    own = bench.core.own_goals
    assert own is not None
    assert own.pose == first
    assert bench.goal.pose != first
