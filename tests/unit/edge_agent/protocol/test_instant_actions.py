"""Actions beside the order (section 6.2.1)."""

from __future__ import annotations

import pytest

from nena_edge_agent.driver.port import NavigationReport, Pose, PositionInitialized, VelocityReport
from nena_edge_agent.protocol.action_states import DESCRIPTOR_LIMIT
from nena_edge_agent.protocol.events import (
    ActionReport,
    Effect,
    Halt,
    PauseAction,
    ReportState,
    ResumeAction,
    SendFactsheet,
    SetPosition,
    StartAction,
    TimePassed,
)
from nena_edge_agent.protocol.instant_actions import MESSAGE_LIMIT
from nena_edge_agent.protocol.robot_state import INSTANT_ACTION_LIMIT
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from nena_shared.vda5050.versions import RULES
from support.robot_core import MAP, Bench, action, at, order


@pytest.mark.clause("6.2.3/stateRequest", "6.2.3/factsheetRequest")
@pytest.mark.parametrize(
    ("kind", "effects"),
    [("stateRequest", [ReportState()]), ("factsheetRequest", [SendFactsheet(), ReportState()])],
)
def test_a_request_is_answered_and_finished_in_the_next_state(kind: str, effects: list[Effect]) -> None:
    bench = Bench()

    assert bench.instant(action("i", "NONE", kind)) == effects
    assert bench.status("i") == "FINISHED"


@pytest.mark.clause("6.2.1/refused", "6.6.5")
@pytest.mark.parametrize("wrong", ["dance", "lift"], ids=["unknown", "wrong scope"])
def test_a_refused_action_is_an_error_until_the_next_one_is_accepted(wrong: str) -> None:
    bench = Bench()

    bench.instant(action("i", "NONE", wrong, height=1.0))

    assert bench.status("i") == "FAILED"
    (error,) = bench.state.errors
    assert (error.error_type, error.error_level) == (
        ErrorType.INVALID_INSTANT_ACTION,
        ErrorLevel.WARNING,
    )
    assert "i" in [each.reference_value for each in error.error_references]
    bench.instant(action("j", "NONE", "stateRequest"))
    assert not bench.errors


@pytest.mark.clause("6.2.1")
def test_each_action_of_a_message_is_checked_separately() -> None:
    bench = Bench()

    bench.instant(action("i", "NONE", "dance"), action("j"), action("k", "NONE", "stateRequest"))

    assert [bench.status(each) for each in "ijk"] == ["FAILED", "INITIALIZING", "FINISHED"]
    assert [effect.action.action_id for effect in bench.effects_of(StartAction)] == ["j"]


@pytest.mark.clause("6.2.1/again")
def test_a_repeated_instant_action_does_not_run_twice() -> None:
    bench = Bench()
    bench.instant(action("i"))
    bench.finishes("i")

    effects = bench.instant(action("i"))

    assert effects == [ReportState()]
    assert len(bench.effects_of(StartAction)) == 1
    assert bench.status("i") == "FINISHED"


@pytest.mark.clause("6.2.1", "6.6.8")
def test_an_instant_action_does_not_stop_the_drive() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    bench.instant(action("i"))
    bench.runs("i")

    assert bench.state.driving
    bench.arrive()
    assert bench.idle
    assert bench.status("i") == "RUNNING"


@pytest.mark.clause("6.1.1/ids")
def test_the_action_id_of_an_order_action_is_refused() -> None:
    bench = Bench()
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD")]}))

    bench.instant(action("a"))

    assert bench.errors == [ErrorType.INVALID_INSTANT_ACTION]
    assert bench.statuses() == {"a": "INITIALIZING"}


@pytest.mark.clause("6.6.9/instant")
def test_ended_states_are_removed_with_the_next_order_and_running_ones_stay() -> None:
    bench = Bench()
    bench.instant(action("i"), action("j", "NONE", "stateRequest"))
    bench.runs("i")

    bench.send(order("n0"))

    assert [state.action_id for state in bench.state.instant_action_states] == ["i"]


@pytest.mark.clause("6.2.1/limits")
def test_the_number_of_states_is_bounded_and_the_oldest_ended_are_dropped_first() -> None:
    bench = Bench()
    bench.instant(action("running"))

    for number in range(INSTANT_ACTION_LIMIT + 5):
        bench.instant(action(f"i{number}", "NONE", "stateRequest"))

    ids = [state.action_id for state in bench.state.instant_action_states]
    assert len(ids) == INSTANT_ACTION_LIMIT
    assert ids[0] == "running"
    assert ids[-1] == f"i{INSTANT_ACTION_LIMIT + 4}"


@pytest.mark.clause("6.2.1/limits")
def test_a_message_with_too_many_actions_is_refused_as_a_whole() -> None:
    bench = Bench()

    bench.instant(*(action(f"i{number}") for number in range(MESSAGE_LIMIT + 1)))

    assert bench.errors == [ErrorType.INSUFFICIENT_MEMORY]
    assert bench.state.instant_action_states == ()
    assert not bench.effects_of(StartAction)
    bench.instant(*(action(f"i{number}") for number in range(MESSAGE_LIMIT)))
    assert len(bench.effects_of(StartAction)) == MESSAGE_LIMIT
    assert not bench.errors


@pytest.mark.clause("6.2.1/limits")
def test_no_more_actions_are_started_than_states_are_reported() -> None:
    bench = Bench()

    for number in range(INSTANT_ACTION_LIMIT + 10):
        bench.instant(action(f"i{number}"))

    assert len(bench.effects_of(StartAction)) == INSTANT_ACTION_LIMIT
    assert len(bench.state.instant_action_states) <= INSTANT_ACTION_LIMIT + 1
    (full,) = [each for each in bench.state.errors if each.error_type == "INSTANT_ACTION_STATES_FULL"]
    assert full.error_level is ErrorLevel.URGENT
    bench.instant(action("pause", "NONE", "startPause"))
    assert bench.status("pause") == "FINISHED"
    bench.finishes("i0", "i1")
    assert "INSTANT_ACTION_STATES_FULL" not in bench.errors
    bench.instant(action("more"))
    assert bench.status("more") == "INITIALIZING"


def test_a_state_does_not_repeat_a_long_descriptor() -> None:
    bench = Bench()

    bench.instant(action("i").model_copy(update={"action_descriptor": "x" * 1_000_000}))

    (state,) = bench.state.instant_action_states
    assert state.action_descriptor == "x" * DESCRIPTOR_LIMIT


@pytest.mark.clause("6.2.3/clearInstantActions", "6.6.9/instant")
def test_ended_instant_actions_stay_until_cleared_or_a_new_order() -> None:
    new, old = Bench(rules=RULES["3.0.0"]), Bench(rules=RULES["2.1.0"])
    for bench in (new, old):
        bench.instant(action("s", "NONE", "stateRequest"))
        bench.send(order("n0", "n1"))
    assert [each.action_id for each in new.state.instant_action_states] == ["s"]
    assert [each.action_id for each in old.state.instant_action_states] == []

    new.instant(action("w", "NONE", "work"), action("c", "NONE", "clearInstantActions"))

    shown = {each.action_id: each.action_status.value for each in new.state.instant_action_states}
    assert shown == {"w": "INITIALIZING", "c": "FINISHED"}


@pytest.mark.clause("6.2.3/clearInstantActions")
def test_an_order_can_clear_instant_actions() -> None:
    bench = Bench(rules=RULES["3.0.0"])
    bench.instant(action("s", "NONE", "stateRequest"))

    bench.send(order("n0", node_actions={"n0": [action("c", "NONE", "clearInstantActions")]}))

    assert bench.state.instant_action_states == ()
    assert bench.statuses() == {"c": "FINISHED"}


@pytest.mark.clause("6.6.5.4", "6.2.1")
def test_the_error_of_a_failed_instant_action_names_no_order_and_ends_with_the_next_one() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.instant(action("i1"))
    bench.fails("i1")

    (entry,) = bench.state.errors
    assert entry.error_type == ErrorType.ACTION_FAILED
    assert bench.state.instant_action_states[0].action_result == "broken"
    assert {each.reference_key for each in entry.error_references} == {"actionId"}
    bench.instant(action("i2", "NONE", "stateRequest"))
    assert bench.errors == []


START = action("p", "NONE", "startPause")
STOP = action("s", "NONE", "stopPause")


@pytest.mark.clause("6.2.3/startPause", "6.2.3/stopPause")
def test_a_pause_stops_the_drive_and_its_end_resends_the_goal() -> None:
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
def test_a_robot_at_standstill_is_paused_at_once_and_starts_no_action() -> None:
    bench = Bench()
    bench.instant(START)
    assert bench.status("p") == "FINISHED"

    bench.send(order("n0", "n1", node_actions={"n0": [action("a")]}))
    assert (bench.status("a"), bench.goals) == ("WAITING", [])

    bench.instant(STOP)
    assert bench.status("a") == "INITIALIZING"
    assert len(bench.goals) == 1


@pytest.mark.clause("6.2.3/startPause", "6.2.3/stopPause", "6.6.9")
def test_pausable_actions_are_paused() -> None:
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
    assert len(bench.effects_of(StartAction)) == 2, "it is resumed and not started again"


@pytest.mark.clause("6.2.3/startPause")
def test_a_second_pause_finishes_together_with_the_first() -> None:
    bench = Bench()
    bench.instant(START)
    bench.instant(action("q", "NONE", "startPause"))

    assert bench.status("q") == "FINISHED"


@pytest.mark.clause("6.2.3/stopPause")
def test_a_pause_before_standstill_can_be_revoked() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.instant(START)

    bench.instant(STOP)
    assert (bench.status("p"), bench.status("s")) == ("FAILED", "FINISHED")
    assert len(bench.goals) == 1
    bench.halted()

    assert len(bench.goals) == 2


DONE = PositionInitialized(succeeded=True, description="")


def be_at(
    node: str = "n5", action_id: str = "i", *, map_id: str = MAP, theta: float = 0.5, x: float = 50.0
) -> Action:
    return action(
        action_id,
        "NONE",
        "initializePosition",
        x=x,
        y=0,
        theta=theta,
        mapId=map_id,
        lastNodeId=node,
    )


@pytest.mark.clause("6.2.3/initializePosition")
def test_the_position_is_sent_and_the_action_finishes_when_it_is_accepted() -> None:
    bench = Bench()

    bench.instant(be_at())
    assert bench.effects_of(SetPosition) == [SetPosition(Pose(50.0, 0.0, 0.5, MAP))]
    assert bench.status("i") == "RUNNING"
    bench.do(at(50.0), DONE)

    assert bench.status("i") == "FINISHED"
    assert bench.state.last_node_id == "n5"
    bench.send(order("n5", "n6"))
    assert bench.state.order_id == "o1"


@pytest.mark.clause("6.2.3/initializePosition")
def test_a_position_that_the_localisation_refuses_fails() -> None:
    bench = Bench()
    bench.instant(be_at())

    bench.do(PositionInitialized(succeeded=False, description="no pose came back"))

    assert bench.status("i") == "FAILED"
    assert bench.state.instant_action_states[0].action_result == "no pose came back"
    assert bench.state.last_node_id == ""


@pytest.mark.clause("6.2.3/initializePosition")
def test_an_unanswered_position_fails_after_a_timeout() -> None:
    bench = Bench()
    bench.instant(be_at())
    assert bench.waits()

    bench.now += 31
    bench.do(TimePassed())

    assert bench.status("i") == "FAILED"
    assert not bench.waits()
    bench.do(DONE)
    assert bench.state.last_node_id == ""


@pytest.mark.clause("6.2.3/initializePosition")
@pytest.mark.parametrize(
    "wrong", [be_at(map_id="cellar"), be_at(theta=4.0)], ids=["unknown map", "impossible heading"]
)
def test_an_impossible_position_fails_at_once(wrong: Action) -> None:
    bench = Bench()

    bench.instant(wrong)

    assert bench.status("i") == "FAILED"
    assert not bench.effects_of(SetPosition)


def test_only_one_position_is_set_at_a_time() -> None:
    bench = Bench()
    bench.instant(be_at())

    bench.instant(be_at("n6", "j"))

    assert (bench.status("i"), bench.status("j")) == ("RUNNING", "FAILED")
    bench.do(DONE)
    assert bench.state.last_node_id == "n5"


@pytest.mark.clause("6.2.3/initializePosition")
def test_the_position_of_a_driving_robot_is_not_set() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    bench.instant(be_at())

    assert bench.status("i") == "FAILED"
    assert bench.state.last_node_id == "n0"


@pytest.mark.clause("6.2.3/initializePosition", "6.6.5.4/localisation")
def test_an_order_continues_when_the_position_of_its_lost_robot_is_set() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(at(3.0, localized=False))
    bench.halted()

    bench.instant(be_at("n9"))
    assert bench.status("i") == "FAILED"
    bench.instant(be_at("n0", "j", x=3.0))
    bench.do(at(3.0), DONE)

    assert bench.status("j") == "FINISHED"
    assert len(bench.goals) == 2
    assert bench.nodes == ["n1"]


def test_a_number_beyond_float64_is_refused_and_blocks_nothing() -> None:
    bench = Bench()

    bench.instant(be_at(x=10**400, action_id="huge"))
    bench.instant(be_at())

    assert bench.status("huge") == "FAILED"
    assert bench.status("i") == "RUNNING"


@pytest.mark.clause("6.1.2/B5")
def test_an_ended_order_does_not_continue_after_the_robot_was_moved_away() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.arrive()
    bench.instant(be_at("n1", x=10.0, action_id="same"))
    bench.do(at(10.0), DONE)
    assert (bench.state.last_node_id, bench.state.last_node_sequence_id) == ("n1", 2)

    bench.instant(be_at("n5"))
    bench.do(at(50.0), DONE)
    bench.send(order("n1", "n2", update=1, first=2))

    assert bench.state.order_update_id == 0
    assert len(bench.goals) == 1
    (refusal,) = bench.state.errors
    assert refusal.error_type == ErrorType.OUTDATED_ORDER_UPDATE
    assert refusal.error_hint == "send a new order"


GONE = NavigationReport(available=False, reason="Nav2 does not come up without a pose")


def test_a_position_can_be_set_while_a_goal_waits_for_navigation() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(GONE)

    bench.instant(be_at(x=0.0, node="n0"))

    assert bench.effects_of(SetPosition)
    assert bench.status("i") == "RUNNING"


def test_no_position_is_set_while_the_robot_moves_without_navigation() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(GONE, VelocityReport(0.4, 0.0))

    bench.instant(be_at(x=0.0, node="n0"))

    assert bench.status("i") == "FAILED"
