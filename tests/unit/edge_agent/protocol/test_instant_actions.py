"""Actions beside the order (section 6.2.1)."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.action_states import DESCRIPTOR_SHOWN
from nena_edge_agent.protocol.capabilities import RULES
from nena_edge_agent.protocol.events import ReportState, SendFactsheet, StartAction
from nena_edge_agent.protocol.instant_actions import MESSAGE_LIMIT, STATES_KEPT
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from support.robot_core import Bench, action, order


@pytest.mark.clause("6.2.3/stateRequest")
def test_a_state_request_is_finished_in_the_state_that_it_asks_for() -> None:
    bench = Bench()

    effects = bench.instant(action("i", "NONE", "stateRequest"))

    assert effects == [ReportState()]
    assert bench.status("i") == "FINISHED"


@pytest.mark.clause("6.2.3/factsheetRequest")
def test_a_factsheet_request_sends_the_factsheet() -> None:
    bench = Bench()

    effects = bench.instant(action("i", "NONE", "factsheetRequest"))

    assert effects == [SendFactsheet(), ReportState()]
    assert bench.status("i") == "FINISHED"


@pytest.mark.clause("6.2.1/refused", "6.6.5")
@pytest.mark.parametrize("wrong", ["dance", "lift"], ids=["unknown", "wrong scope"])
def test_what_cannot_be_done_fails_with_an_error_until_the_next_is_accepted(wrong: str) -> None:
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
def test_each_action_of_a_message_is_judged_for_itself() -> None:
    bench = Bench()

    bench.instant(action("i", "NONE", "dance"), action("j"), action("k", "NONE", "stateRequest"))

    assert [bench.status(each) for each in "ijk"] == ["FAILED", "INITIALIZING", "FINISHED"]
    assert [effect.action.action_id for effect in bench.effects_of(StartAction)] == ["j"]


@pytest.mark.clause("6.2.1/again")
def test_an_action_that_comes_again_does_not_run_twice() -> None:
    bench = Bench()
    bench.instant(action("i"))
    bench.finishes("i")

    effects = bench.instant(action("i"))

    assert effects == [ReportState()]
    assert len(bench.effects_of(StartAction)) == 1
    assert bench.status("i") == "FINISHED"


@pytest.mark.clause("6.2.1", "6.2.1/blocking", "6.6.8")
def test_an_instant_action_does_not_stop_the_drive() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    bench.instant(action("i", "HARD"))
    bench.runs("i")

    assert bench.state.driving
    bench.arrive()
    assert bench.idle
    assert bench.status("i") == "RUNNING"


@pytest.mark.clause("6.2.1")
def test_a_failed_instant_action_is_shown_with_its_reason() -> None:
    bench = Bench()
    bench.instant(action("i"))

    bench.fails("i")

    assert bench.errors == [ErrorType.ACTION_FAILED]
    assert bench.state.instant_action_states[0].action_result == "broken"


@pytest.mark.clause("6.1.1/ids")
def test_the_id_of_an_action_of_the_order_is_refused() -> None:
    bench = Bench()
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD")]}))

    bench.instant(action("a"))

    assert bench.errors == [ErrorType.INVALID_INSTANT_ACTION]
    assert bench.statuses() == {"a": "INITIALIZING"}


@pytest.mark.clause("6.6.9/instant")
def test_ended_states_go_with_the_next_order_and_running_ones_stay() -> None:
    bench = Bench()
    bench.instant(action("i"), action("j", "NONE", "stateRequest"))
    bench.runs("i")

    bench.send(order("n0"))

    assert [state.action_id for state in bench.state.instant_action_states] == ["i"]


@pytest.mark.clause("6.2.1/limits")
def test_the_number_of_states_is_bounded_and_the_oldest_ended_go_first() -> None:
    bench = Bench()
    bench.instant(action("running"))

    for number in range(STATES_KEPT + 5):
        bench.instant(action(f"i{number}", "NONE", "stateRequest"))

    ids = [state.action_id for state in bench.state.instant_action_states]
    assert len(ids) == STATES_KEPT
    assert ids[0] == "running"
    assert ids[-1] == f"i{STATES_KEPT + 4}"


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
def test_no_more_actions_are_begun_than_states_are_shown() -> None:
    bench = Bench()

    for number in range(STATES_KEPT + 10):
        bench.instant(action(f"i{number}"))

    assert len(bench.effects_of(StartAction)) == STATES_KEPT
    assert len(bench.state.instant_action_states) <= STATES_KEPT + 1
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
    assert state.action_descriptor == "x" * DESCRIPTOR_SHOWN


@pytest.mark.clause("6.2.3/clearInstantActions", "6.6.9/instant")
def test_ended_instant_actions_stay_until_they_are_cleared_or_a_new_order_comes() -> None:
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
def test_an_order_may_clear_them_as_well() -> None:
    bench = Bench(rules=RULES["3.0.0"])
    bench.instant(action("s", "NONE", "stateRequest"))

    bench.send(order("n0", node_actions={"n0": [action("c", "NONE", "clearInstantActions")]}))

    assert bench.state.instant_action_states == ()
    assert bench.statuses() == {"c": "FINISHED"}


@pytest.mark.clause("6.6.5.4")
def test_a_failed_instant_action_names_no_order_and_is_shown_until_the_next_one() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.instant(action("i1"))
    bench.fails("i1")

    (entry,) = bench.state.errors
    assert {each.reference_key for each in entry.error_references} == {"actionId"}
    bench.instant(action("i2", "NONE", "stateRequest"))
    assert bench.errors == []
