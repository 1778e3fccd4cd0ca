"""What an agent does with its memory (recollection of a robot that was interrupted)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from nena_edge_agent.driver.port import Arrived, GoalReport, GoalTable, Halted, NavigationReport, OwnGoals
from nena_edge_agent.protocol.capabilities import DriveStrategy
from nena_edge_agent.protocol.events import (
    ActionReport,
    CancelAction,
    Halt,
    JournalReport,
    ResumeAction,
    SetPosition,
    StartAction,
    Started,
)
from nena_edge_agent.protocol.robot_state import INSTANT_ACTION_LIMIT
from nena_edge_agent.protocol.state import with_recorded_fields
from nena_shared.vda5050.action import ActionStatus
from support.robot_core import MAP, Bench, action, at, order, restarted


@pytest.mark.clause("6.6/restart")
def test_an_active_order_continues() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", "n3", released=3))
    bench.arrive()

    again = restarted(bench)

    assert again.nodes == ["n2", "n3"]
    assert again.goal.pose.x == 20.0
    again.arrive()
    again.send(order("n2", "n3", update=1, first=4))
    again.arrive()
    assert again.idle


@pytest.mark.clause("6.6/restart")
def test_no_goal_is_sent_before_the_robot_is_localised() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    kept = bench.core.memory()

    again = Bench(memory=kept, ready=False)
    again.do(Started(), NavigationReport(available=True, reason=""))
    assert not again.goals
    assert again.errors == ["LOCALIZATION_ERROR"]

    again.do(at(3.0))
    assert len(again.goals) == 1
    assert not again.errors


@pytest.mark.clause("6.6/restart")
def test_restartable_actions_restart_and_others_fail() -> None:
    bench = Bench()
    actions = [action("work", "SOFT"), action("press", "SOFT", "press"), action("later", "HARD")]
    bench.send(order("n0", node_actions={"n0": actions}))
    bench.runs("work", "press")

    again = restarted(bench)

    assert again.statuses() == {"work": "INITIALIZING", "press": "FAILED", "later": "WAITING"}
    assert not again.effects_of(StartAction), "it is not known yet whether the robot stands"
    again.halted()
    assert [effect.action.action_id for effect in again.effects_of(StartAction)] == ["work"]
    again.finishes("work")
    assert again.status("later") == "INITIALIZING"


@pytest.mark.clause("6.6/restart", "6.6.4")
@pytest.mark.parametrize("action_type", ["press", "work"])
def test_a_robot_that_an_action_was_driving_is_stopped_first(action_type: str) -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n1": [action("a", "HARD", action_type)]}))
    bench.do(listed(("g1", "EXECUTING")))
    bench.arrive()
    bench.runs("a")
    bench.do(listed(("g1", "SUCCEEDED"), ("dock", "EXECUTING")))

    again = restarted(bench)

    assert len(again.effects_of(Halt)) == 1
    assert again.state.driving
    again.halted()
    assert not again.state.driving


def test_a_goal_that_the_order_still_needs_is_not_stopped() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(listed(("g1", "EXECUTING")))

    assert not restarted(bench).effects_of(Halt)


@pytest.mark.clause("6.6/restart", "6.6.9")
def test_an_action_that_ended_stays_ended() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n0": [action("a", "HARD")]}))
    bench.finishes("a")

    again = restarted(bench)

    assert again.status("a") == "FINISHED"
    assert not again.effects_of(StartAction)
    assert len(again.goals) == 1


@pytest.mark.clause("6.1.3", "6.1.3.1")
def test_a_cancel_is_completed() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.instant(action("c", "NONE", "cancelOrder"))

    again = restarted(bench)

    assert len(again.effects_of(Halt)) == 1
    assert again.status("c") == "RUNNING"
    again.do(Halted())
    assert (again.status("c"), again.nodes) == ("FINISHED", [])
    again.send(order("n0", "n1", update=1))
    assert again.errors == ["ORDER_UPDATE_FOLLOWING_CANCEL"]


@pytest.mark.clause("6.2.3/startPause")
def test_a_pause_continues() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.instant(action("p", "NONE", "startPause"))

    again = restarted(bench)
    assert (again.state.paused, again.goals) == (True, [])
    again.halted()
    assert again.status("p") == "FINISHED"
    again.instant(action("s", "NONE", "stopPause"))
    assert len(again.goals) == 1


@pytest.mark.clause("6.2.1/again")
def test_a_repeated_instant_action_is_still_recognised() -> None:
    bench = Bench()
    bench.instant(action("i"))
    bench.finishes("i")

    again = restarted(bench)
    again.instant(action("i"))

    assert not again.effects_of(StartAction)


@pytest.mark.clause("6.2.3/startPause")
@pytest.mark.parametrize("held", [True, False])
def test_an_interrupted_action_restarts_after_the_pause(*, held: bool) -> None:
    bench = Bench()
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD")]}))
    bench.runs("a")
    bench.instant(action("p", "NONE", "startPause"))
    if held:
        bench.do(ActionReport("a", ActionStatus.PAUSED))

    again = restarted(bench)
    assert (again.status("a"), again.effects_of(StartAction)) == ("PAUSED", [])

    again.halted()
    again.instant(action("s", "NONE", "stopPause"))
    assert again.status("a") == "INITIALIZING"
    assert [each.action.action_id for each in again.effects_of(StartAction)] == ["a"]
    assert not again.effects_of(ResumeAction)
    again.finishes("a")
    assert again.idle


@pytest.mark.clause("6.2.3/startPause", "6.1.3")
def test_an_interrupted_action_can_be_cancelled_after_the_restart() -> None:
    bench = Bench()
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD")]}))
    bench.runs("a")
    bench.instant(action("p", "NONE", "startPause"))
    again = restarted(bench)
    again.halted()

    again.instant(action("c", "NONE", "cancelOrder"))
    assert [each.action_id for each in again.effects_of(CancelAction)] == ["a"]
    again.fails("a")  # as nothing runs it

    assert (again.status("c"), again.status("a")) == ("FINISHED", "FAILED")


def test_ended_actions_are_stored_without_parameters() -> None:
    bench = Bench()
    for number in range(2 * INSTANT_ACTION_LIMIT):
        bench.instant(action(f"i{number}", text="x" * 10_000))
        bench.finishes(f"i{number}")
    bench.instant(action("running", text="y" * 10_000))

    memory = bench.core.memory()

    assert len(memory.model_dump_json(exclude_defaults=True)) < 100 * INSTANT_ACTION_LIMIT + 200_000
    assert "yyy" in memory.model_dump_json()
    assert restarted(bench).status(f"i{2 * INSTANT_ACTION_LIMIT - 1}") == "FINISHED"


def test_an_interrupted_initialize_position_fails() -> None:
    bench = Bench()
    place: dict[str, Any] = {"x": 1.0, "y": 0.0, "theta": 0.0, "mapId": MAP, "lastNodeId": "n1"}
    bench.instant(action("i", "NONE", "initializePosition", **place))

    again = restarted(bench)

    assert again.status("i") == "FAILED"
    assert not again.effects_of(SetPosition)


def listed(*rows: tuple[str, str]) -> GoalTable:
    """Return navigation's goals by ID and status, none of other programs."""
    return GoalTable(
        tuple(
            GoalReport(name, external=False, status=status, ended=status != "EXECUTING")
            for name, status in rows
        )
    )


def kept_goals(bench: Bench) -> OwnGoals | None:
    """Return what another run would know of navigation's goals."""
    return Bench(memory=bench.core.memory(), ready=False).core.own_goals


def test_a_goal_is_recorded_before_it_is_sent_and_until_its_result() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2"))
    pose = bench.goal.pose
    assert kept_goals(bench) == OwnGoals((), pose, given=pose)

    bench.do(listed(("g1", "EXECUTING")))
    assert kept_goals(bench) == OwnGoals(("g1",), pose)

    bench.do(listed(("g1", "SUCCEEDED")))
    assert kept_goals(bench) == OwnGoals(("g1",), pose)

    bench.do(Arrived(bench.goal.generation))
    assert kept_goals(bench) == OwnGoals((), bench.goal.pose, given=bench.goal.pose, behind="g1")


def test_the_previous_goal_stays_recorded_while_the_next_one_replaces_it() -> None:
    bench = Bench(strategy=DriveStrategy.PASS_THROUGH)
    bench.send(order("n0", "n1", "n2"))
    first = bench.goal.pose
    bench.do(listed(("g1", "EXECUTING")), at(9.9))

    second = bench.goal.pose
    assert second != first
    assert bench.core.own_goals == OwnGoals(("g1",), first, given=second, behind="g1")

    bench.do(listed(("g1", "ABORTED"), ("g2", "EXECUTING")))
    assert bench.core.own_goals == OwnGoals(("g2",), second)


def test_an_agent_interrupted_twice_still_recognises_its_goal() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    before = bench.core.own_goals

    again = Bench(memory=bench.core.memory(), ready=False)
    again.do(Started(), listed(("g1", "SUCCEEDED")), at(0.0), NavigationReport(available=True, reason=""))

    assert again.core.own_goals == before


def test_a_stopped_goal_is_no_longer_an_own_goal() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.instant(action("c", "NONE", "cancelOrder"))
    assert bench.core.own_goals is not None

    bench.halted()

    assert bench.core.own_goals is None


@pytest.mark.clause("6.6.5.4")
def test_while_the_disk_fails_new_orders_are_refused_and_a_waiting_one_is_kept() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(JournalReport("No space left on device"))

    bench.send(order("n0", "n1"))
    assert bench.errors == ["JOURNAL_NOT_WRITTEN"]
    bench.send(order("n0", "n1", order_id="o2"))
    assert set(bench.errors) == {"JOURNAL_NOT_WRITTEN", "MOBILE_ROBOT_NOT_AVAILABLE"}

    bench.do(JournalReport(""))
    assert not bench.errors
    assert bench.state.order_id == "o1"


def test_a_state_has_durable_fields_from_disk_and_current_values_otherwise() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", node_actions={"n1": [action("a", "HARD")]}))
    before = bench.state
    bench.arrive()
    bench.do(JournalReport("No space left on device"))

    shown = with_recorded_fields(bench.state, before)

    assert (shown.last_node_id, shown.node_states) == ("n0", before.node_states)
    assert shown.action_states == before.action_states
    assert shown.mobile_robot_position == bench.state.mobile_robot_position != before.mobile_robot_position
    assert [each.error_type for each in shown.errors] == ["JOURNAL_NOT_WRITTEN"]


@pytest.mark.parametrize(("vx", "driving"), [(0.0, False), (0.5, True), (None, True)])
def test_a_robot_whose_goal_waits_for_the_disk_drives_if_it_moves(*, vx: float | None, driving: bool) -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(replace(at(1.0), vx=vx, omega=None if vx is None else 0.0))

    assert with_recorded_fields(bench.state, bench.state).driving is driving
