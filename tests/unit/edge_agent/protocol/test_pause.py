"""startPause and stopPause (section 6.2.3)."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.events import ActionReport, Halt, PauseAction, ResumeAction, StartAction
from nena_shared.vda5050.action import ActionStatus
from support.robot_core import Bench, action, order

START = action("p", "NONE", "startPause")
STOP = action("s", "NONE", "stopPause")


@pytest.mark.clause("6.2.3/startPause", "6.2.3/stopPause")
def test_a_pause_stops_the_drive_and_its_end_gives_the_goal_again() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    bench.instant(START)
    assert (bench.status("p"), bench.state.paused) == ("RUNNING", True)
    assert len(bench.effects_of(Halt)) == 1
    bench.halted()
    assert bench.status("p") == "FINISHED"
    assert not bench.state.driving

    bench.instant(STOP)
    assert (bench.status("s"), bench.state.paused) == ("FINISHED", False)
    assert [goal.generation for goal in bench.goals] == [1, 2]
    bench.arrive()
    assert bench.state.last_node_id == "n1"


@pytest.mark.clause("6.2.3/startPause", "6.2.3/stopPause")
def test_a_standing_robot_is_paused_at_once_and_begins_no_action() -> None:
    bench = Bench()
    bench.instant(START)
    assert bench.status("p") == "FINISHED"

    bench.send(order("n0", "n1", node_actions={"n0": [action("a")]}))
    assert (bench.status("a"), bench.goals) == ("WAITING", [])

    bench.instant(STOP)
    assert bench.status("a") == "INITIALIZING"
    assert len(bench.goals) == 1


@pytest.mark.clause("6.2.3/startPause", "6.2.3/stopPause", "6.6.9")
def test_actions_that_can_be_held_are_held() -> None:
    bench = Bench()
    actions = [action("a", "SOFT"), action("b", "SOFT", "press")]
    bench.send(order("n0", "n1", node_actions={"n0": actions}))
    bench.runs("a", "b")

    bench.instant(START)
    assert [effect.action_id for effect in bench.effects_of(PauseAction)] == ["a"]
    bench.do(ActionReport("a", ActionStatus.PAUSED))
    assert bench.statuses() == {"a": "PAUSED", "b": "RUNNING"}

    bench.instant(STOP)
    assert [effect.action_id for effect in bench.effects_of(ResumeAction)] == ["a"]
    bench.runs("a")
    assert bench.status("a") == "RUNNING"


@pytest.mark.clause("6.2.3/startPause")
def test_a_second_pause_finishes_like_the_first() -> None:
    bench = Bench()
    bench.instant(START)
    bench.instant(action("q", "NONE", "startPause"))

    assert bench.status("q") == "FINISHED"


@pytest.mark.clause("6.2.3/stopPause")
def test_a_pause_that_has_not_come_to_a_stand_is_taken_back() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.instant(START)

    bench.instant(STOP)
    assert (bench.status("p"), bench.status("s")) == ("FAILED", "FINISHED")
    assert len(bench.goals) == 1
    bench.halted()

    assert len(bench.goals) == 2


@pytest.mark.clause("6.2.3/stopPause")
def test_a_held_action_is_resumed_and_not_begun_again() -> None:
    bench = Bench()
    bench.send(order("n0", node_actions={"n0": [action("a")]}))
    bench.runs("a")
    bench.instant(START)
    bench.do(ActionReport("a", ActionStatus.PAUSED))

    bench.instant(STOP)

    assert len(bench.effects_of(StartAction)) == 1
    assert len(bench.effects_of(ResumeAction)) == 1
