"""cancelOrder and its edge cases (section 6.1.3)."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.driver.port import DriveFailed, DriveFailure
from nena_edge_agent.protocol.events import CancelAction, ErrorSwitched, Halt, OperatingModeSwitched
from nena_edge_agent.protocol.memory import Memory
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorType
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.versions import RULES
from support.robot_core import Bench, action, at, order, position


def driving() -> Bench:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", node_actions={"n1": [action("later")]}))
    return bench


@pytest.mark.clause("6.1.3", "6.1.3/actions", "6.2.3/cancelOrder")
def test_a_cancel_between_nodes_stops_the_robot_and_ends_the_order_in_one_state() -> None:
    bench = driving()

    bench.instant(action("c", "NONE", "cancelOrder"))
    assert len(bench.effects_of(Halt)) == 1
    assert (bench.status("c"), bench.status("later")) == ("RUNNING", "FAILED")
    assert bench.nodes == ["n1", "n2"]

    bench.halted()
    state = bench.state
    assert (bench.status("c"), bench.nodes, bench.edges) == ("FINISHED", [], [])
    assert bench.statuses() == {"later": "FAILED"}
    assert (state.order_id, state.last_node_id, state.last_node_sequence_id) == ("o1", "n0", 0)
    assert not state.driving
    assert not state.new_base_request
    assert not state.errors
    assert bench.idle


@pytest.mark.clause("6.1.3/actions")
def test_a_cancel_waits_for_uninterruptible_actions() -> None:
    bench = Bench()
    actions = [action("soft", "SOFT"), action("hard", "SOFT", "press"), action("next", "HARD")]
    bench.send(order("n0", "n1", node_actions={"n0": actions}))
    bench.runs("soft", "hard")

    bench.instant(action("c", "NONE", "cancelOrder"))
    assert [effect.action_id for effect in bench.effects_of(CancelAction)] == ["soft"]
    assert bench.statuses() == {"soft": "RUNNING", "hard": "RUNNING", "next": "FAILED"}

    bench.fails("soft")
    assert (bench.status("c"), bench.nodes) == ("RUNNING", ["n1"])

    bench.finishes("hard")
    assert bench.statuses() == {"soft": "FAILED", "hard": "FINISHED", "next": "FAILED"}
    assert (bench.status("c"), bench.nodes) == ("FINISHED", [])
    assert not bench.errors


@pytest.mark.clause("6.1.3/nothing")
def test_an_ended_order_cannot_be_cancelled() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.arrive()

    bench.instant(action("c", "NONE", "cancelOrder"))

    assert bench.status("c") == "FAILED"


@pytest.mark.clause("6.1.3/nothing")
def test_a_cancelled_order_cannot_be_cancelled_again() -> None:
    bench = driving()
    bench.instant(action("c", "NONE", "cancelOrder"))
    bench.halted()

    bench.instant(action("d", "NONE", "cancelOrder"))

    assert (bench.status("c"), bench.status("d")) == ("FINISHED", "FAILED")


@pytest.mark.clause("6.1.3/again")
def test_a_second_cancel_joins_the_first() -> None:
    bench = driving()
    bench.instant(action("c", "NONE", "cancelOrder"))
    bench.instant(action("d", "NONE", "cancelOrder"))
    assert bench.status("d") == "RUNNING"
    assert len(bench.effects_of(Halt)) == 1

    bench.halted()

    assert (bench.status("c"), bench.status("d")) == ("FINISHED", "FINISHED")


@pytest.mark.clause("6.1.3/again", "6.2.1/again")
def test_a_resent_cancel_has_no_effect_on_the_next_order() -> None:
    bench = driving()
    bench.instant(action("c", "NONE", "cancelOrder"))
    bench.halted()
    bench.send(order("n0", "n1", order_id="o2"))
    assert bench.state.order_id == "o2"

    bench.instant(action("c", "NONE", "cancelOrder"))

    assert bench.nodes == ["n1"]
    assert bench.state.driving


@pytest.mark.clause("6.1.3/named")
@pytest.mark.parametrize("version", ["2.0.0", "2.1.0"])
def test_before_3_0_a_cancel_applies_to_the_active_order(version: str) -> None:
    bench = Bench(rules=RULES[version])
    bench.send(order("n0", "n1"))

    bench.instant(action("c", "NONE", "cancelOrder", orderId="o9"))

    assert bench.status("c") == "RUNNING"


@pytest.mark.clause("6.1.3/named")
def test_a_cancel_of_another_order_has_no_effect() -> None:
    bench = Bench(rules=RULES["3.0.0"])
    bench.send(order("n0", "n1"))

    bench.instant(action("c", "NONE", "cancelOrder", orderId="o9"))
    assert bench.status("c") == "FAILED"
    assert bench.errors == [ErrorType.NO_ORDER_TO_CANCEL]
    assert bench.state.driving

    bench.instant(action("d", "NONE", "cancelOrder", orderId="o1"))
    bench.halted()
    assert bench.status("d") == "FINISHED"


@pytest.mark.clause("6.1.3")
def test_a_robot_that_waits_for_its_horizon_can_be_cancelled() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", released=1))

    bench.instant(action("c", "NONE", "cancelOrder"))

    assert (bench.status("c"), bench.nodes) == ("FINISHED", [])
    assert not bench.effects_of(Halt)


@pytest.mark.clause("6.1.3")
def test_an_order_of_one_node_lasts_as_long_as_its_actions_and_can_be_cancelled() -> None:
    bench = Bench()
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD")]}))
    bench.runs("a")

    bench.instant(action("c", "NONE", "cancelOrder"))
    assert bench.status("c") == "RUNNING"
    bench.fails("a")

    assert bench.status("c") == "FINISHED"


@pytest.mark.clause("6.1.3")
def test_a_cancel_works_during_a_pause() -> None:
    bench = driving()
    bench.instant(action("p", "NONE", "startPause"))
    bench.halted()

    bench.instant(action("c", "NONE", "cancelOrder"))

    assert bench.status("c") == "FINISHED"
    assert bench.state.paused


@pytest.mark.clause("6.1.3", "6.6.5")
def test_a_cancel_clears_the_error_of_a_failed_drive() -> None:
    bench = driving()
    bench.do(DriveFailed(bench.goal.generation, DriveFailure.ABORTED, "no way"))

    bench.instant(action("c", "NONE", "cancelOrder"))
    assert bench.status("c") == "RUNNING"
    bench.halted()

    assert bench.status("c") == "FINISHED"
    assert not bench.errors


@pytest.mark.clause("6.1.4.6", "6.1.3/after")
def test_a_new_order_is_accepted_only_after_a_cancel() -> None:
    bench = Bench()
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD", "press")]}))
    bench.runs("a")
    bench.instant(action("c", "NONE", "cancelOrder"))

    bench.send(order("n0", order_id="o2"))
    assert bench.errors == [ErrorType.OTHER_ORDER_ACTIVE]
    bench.finishes("a")
    bench.send(order("n0", order_id="o2"))

    assert bench.state.order_id == "o2"
    assert not bench.errors


@pytest.mark.clause("6.1.3/after")
def test_after_a_cancel_an_order_can_start_at_a_last_node_with_a_large_deviation() -> None:
    bench = driving()
    bench.do(at(4.0))
    bench.instant(action("c", "NONE", "cancelOrder"))
    bench.halted()

    bench.send(order("n0", "n1", order_id="o2", positions={"n0": position(0.0, radius=5.0)}))

    assert bench.state.order_id == "o2"


VERSIONS = pytest.mark.parametrize("version", list(RULES))
CLEARING = pytest.mark.parametrize("mode", [each for each in OperatingMode if each.clears_order])


def switch(bench: Bench, mode: OperatingMode) -> None:
    bench.do(OperatingModeSwitched(mode))


def driving_in_version(version: str, **more: Any) -> Bench:
    bench = Bench(rules=RULES[version])
    bench.send(order("n0", "n1", "n2", **more))
    return bench


@pytest.mark.clause("6.6.7")
@VERSIONS
@CLEARING
def test_a_person_who_takes_over_ends_the_order(version: str, mode: OperatingMode) -> None:
    bench = driving_in_version(version, node_actions={"n1": [action("a")]})

    switch(bench, mode)

    state = bench.state
    assert (state.operating_mode, state.node_states, state.edge_states) == (mode, (), ())
    assert bench.status("a") == "FAILED"
    assert len(bench.effects_of(Halt)) == 1
    assert (state.order_id, bench.idle) == ("o1", True)


@pytest.mark.clause("6.6.7")
@VERSIONS
def test_the_mode_is_reported_with_the_cleared_order(version: str) -> None:
    bench = driving_in_version(
        version, node_actions={"n0": [action("a", "HARD", "press"), action("b", "HARD")]}
    )
    bench.runs("a")

    switch(bench, OperatingMode.MANUAL)

    assert bench.state.operating_mode is OperatingMode.AUTOMATIC
    assert bench.nodes == ["n1", "n2"]
    assert bench.statuses() == {"a": "RUNNING", "b": "FAILED"}
    bench.finishes("a")
    assert (bench.state.operating_mode, bench.nodes) == (OperatingMode.MANUAL, [])


@pytest.mark.clause("6.6.7")
@VERSIONS
def test_cancellable_actions_are_cancelled(version: str) -> None:
    bench = driving_in_version(version, node_actions={"n0": [action("a", "HARD")]})
    bench.runs("a")

    switch(bench, OperatingMode.SERVICE)
    assert [each.action_id for each in bench.effects_of(CancelAction)] == ["a"]
    bench.fails("a")

    assert bench.state.operating_mode is OperatingMode.SERVICE


@pytest.mark.clause("6.6.7")
@VERSIONS
def test_switching_the_mode_back_does_not_stop_the_clearing(version: str) -> None:
    bench = driving_in_version(version, node_actions={"n0": [action("a", "HARD", "press")]})
    bench.runs("a")

    switch(bench, OperatingMode.MANUAL)
    switch(bench, OperatingMode.AUTOMATIC)
    bench.finishes("a")

    assert (bench.state.operating_mode, bench.nodes) == (OperatingMode.AUTOMATIC, [])
    assert bench.idle


@pytest.mark.clause("6.1.4.9")
@VERSIONS
@CLEARING
def test_orders_are_refused_until_the_mode_accepts_them(version: str, mode: OperatingMode) -> None:
    bench = Bench(rules=RULES[version])
    switch(bench, mode)

    bench.send(order("n0", "n1"))
    assert (bench.errors, bench.state.order_id) == (["MOBILE_ROBOT_NOT_AVAILABLE"], "")
    switch(bench, OperatingMode.SEMIAUTOMATIC)
    assert not bench.errors

    bench.send(order("n0", "n1"))
    assert bench.state.order_id == "o1"


@pytest.mark.clause("6.1.4.9")
@VERSIONS
def test_orders_are_refused_as_soon_as_the_mode_is_switched(version: str) -> None:
    bench = driving_in_version(version, node_actions={"n0": [action("a", "HARD", "press")]})
    bench.runs("a")
    switch(bench, OperatingMode.MANUAL)

    bench.send(order("n0", order_id="o2"))

    assert bench.errors == ["MOBILE_ROBOT_NOT_AVAILABLE"]


@pytest.mark.clause("6.6.5.1", "6.1.4.9")
@VERSIONS
def test_a_robot_with_a_fatal_error_accepts_no_orders(version: str) -> None:
    bench, entry = Bench(rules=RULES[version]), ErrorEntry(error_type="x", error_level=ErrorLevel.FATAL)
    bench.do(ErrorSwitched(entry, active=True))

    bench.send(order("n0", "n1"))
    assert bench.errors == ["x", "MOBILE_ROBOT_NOT_AVAILABLE"]

    bench.do(ErrorSwitched(entry, active=False))
    assert not bench.errors


@pytest.mark.clause("6.6.6", "6.2.3/stateRequest", "6.2.3/factsheetRequest")
@VERSIONS
@CLEARING
def test_instant_actions_other_than_requests_fail(version: str, mode: OperatingMode) -> None:
    bench = Bench(rules=RULES[version])
    switch(bench, mode)

    bench.instant(
        action("s", "NONE", "stateRequest"),
        action("f", "NONE", "factsheetRequest"),
        action("p", "NONE", "startPause"),
        action("w"),
    )

    assert [bench.status(each) for each in "sfpw"] == ["FINISHED", "FINISHED", "FAILED", "FAILED"]
    assert not bench.state.paused


@pytest.mark.clause("6.6.6/INTERVENED")
@VERSIONS
def test_an_operator_who_intervenes_pauses_the_order_and_returns_control(version: str) -> None:
    bench = driving_in_version(version)
    switch(bench, OperatingMode.INTERVENED)
    bench.halted()

    bench.do(at(4.0, 3.0))
    assert (bench.nodes, len(bench.goals)) == (["n1", "n2"], 1)
    assert bench.state.operating_mode is OperatingMode.INTERVENED
    switch(bench, OperatingMode.AUTOMATIC)

    assert len(bench.goals) == 2
    bench.arrive()
    bench.arrive()
    assert bench.idle


@pytest.mark.clause("6.6.6/INTERVENED")
@VERSIONS
def test_while_an_operator_intervenes_an_order_is_accepted_and_run_later(version: str) -> None:
    bench = Bench(rules=RULES[version])
    switch(bench, OperatingMode.INTERVENED)

    bench.send(order("n0", "n1", node_actions={"n0": [action("a")]}))
    assert (bench.state.order_id, bench.status("a"), bench.goals) == ("o1", "WAITING", [])
    switch(bench, OperatingMode.AUTOMATIC)

    assert (bench.status("a"), len(bench.goals)) == ("INITIALIZING", 1)


@pytest.mark.clause("6.6.6/INTERVENED", "6.1.3")
@VERSIONS
def test_while_an_operator_intervenes_only_cancel_order_is_accepted(version: str) -> None:
    bench = driving_in_version(version)
    switch(bench, OperatingMode.INTERVENED)
    bench.halted()

    bench.instant(action("p", "NONE", "startPause"), action("c", "NONE", "cancelOrder"))

    assert (bench.status("p"), bench.status("c")) == ("FAILED", "FINISHED")
    assert bench.idle


@pytest.mark.clause("6.6.7/node")
@pytest.mark.parametrize(
    ("version", "kept"), [("2.0.0", "n1"), ("2.1.0", "n1"), ("3.0.0", "")], ids=["2.0", "2.1", "3.0"]
)
@pytest.mark.parametrize("mode", [OperatingMode.STARTUP, OperatingMode.SERVICE, OperatingMode.TEACH_IN])
def test_the_last_node_is_cleared_if_the_version_requires_it(
    version: str, kept: str, mode: OperatingMode
) -> None:
    bench = driving_in_version(version)
    bench.arrive()

    switch(bench, mode)

    assert bench.state.last_node_id == kept


@pytest.mark.clause("6.6.7/node")
@pytest.mark.parametrize(
    ("version", "kept"), [("2.0.0", "n1"), ("2.1.0", "n1"), ("3.0.0", "")], ids=["2.0", "2.1", "3.0"]
)
def test_in_manual_the_last_node_is_cleared_when_the_robot_is_driven_away(version: str, kept: str) -> None:
    bench = driving_in_version(version)
    bench.arrive()
    switch(bench, OperatingMode.MANUAL)
    assert bench.state.last_node_id == "n1"

    bench.do(at(10.0, 2.0))

    assert bench.state.last_node_id == kept


@pytest.mark.clause("6.1.2/cleared")
@VERSIONS
def test_after_clearing_an_update_is_accepted_only_where_the_base_ended(version: str) -> None:
    bench = driving_in_version(version)
    bench.arrive()
    bench.arrive()
    switch(bench, OperatingMode.MANUAL)
    switch(bench, OperatingMode.AUTOMATIC)

    bench.send(order("n2", "n3", update=1, first=4))

    assert (bench.nodes, bench.errors) == (["n3"], [])


@pytest.mark.clause("6.1.2/cleared")
@VERSIONS
def test_after_clearing_an_update_far_from_the_end_of_the_base_is_refused(version: str) -> None:
    bench = driving_in_version(version)
    switch(bench, OperatingMode.MANUAL)
    switch(bench, OperatingMode.AUTOMATIC)

    bench.send(order("n2", "n3", update=1, first=4))

    assert bench.nodes == []
    assert bench.errors == [RULES[version].wrong_stitching_node]


@pytest.mark.clause("6.6.6")
@VERSIONS
def test_the_mode_survives_a_restart_of_the_agent(version: str) -> None:
    bench = Bench(rules=RULES[version])
    switch(bench, OperatingMode.MANUAL)
    kept = bench.core.memory().model_dump_json(exclude_defaults=True)

    again = Bench(memory=Memory.model_validate_json(kept), rules=RULES[version])

    assert again.state.operating_mode is OperatingMode.MANUAL


@pytest.mark.clause("6.6.7")
@VERSIONS
def test_clearing_survives_a_restart_of_the_agent(version: str) -> None:
    bench = driving_in_version(version, node_actions={"n0": [action("a", "HARD", "press")]})
    bench.runs("a")
    switch(bench, OperatingMode.MANUAL)
    kept = bench.core.memory().model_dump_json(exclude_defaults=True)

    again = Bench(memory=Memory.model_validate_json(kept), rules=RULES[version])

    assert (again.status("a"), again.nodes) == ("FAILED", [])
    assert again.state.operating_mode is OperatingMode.MANUAL
