"""cancelOrder and its edge cases (section 6.1.3)."""

from __future__ import annotations

import pytest

from nena_edge_agent.driver.port import DriveFailed, DriveFailure
from nena_edge_agent.protocol.capabilities import RULES
from nena_edge_agent.protocol.events import CancelAction, Halt
from nena_shared.vda5050.error import ErrorType
from support.robot_core import Bench, action, at, order, position


def driving() -> Bench:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", node_actions={"n1": [action("later")]}))
    return bench


@pytest.mark.clause("6.1.3", "6.1.3/actions")
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
def test_a_cancel_waits_for_what_cannot_be_interrupted() -> None:
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
def test_without_an_order_there_is_nothing_to_cancel() -> None:
    bench = Bench()

    bench.instant(action("c", "NONE", "cancelOrder"))

    assert bench.status("c") == "FAILED"
    (error,) = bench.state.errors
    assert error.error_type == ErrorType.NO_ORDER_TO_CANCEL
    assert error.error_references[0].reference_value == "c"
    bench.send(order("n0"))
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
def test_a_cancel_that_is_delivered_again_has_no_effect_even_on_the_next_order() -> None:
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
def test_before_3_0_a_cancel_is_for_the_order_that_the_robot_has(version: str) -> None:
    bench = Bench(rules=RULES[version])
    bench.send(order("n0", "n1"))

    bench.instant(action("c", "NONE", "cancelOrder", orderId="o9"))

    assert bench.status("c") == "RUNNING"


@pytest.mark.clause("6.1.3/named")
def test_the_wrong_order_id_leaves_the_order_alone() -> None:
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
def test_an_order_of_one_node_lives_by_its_actions_and_can_be_cancelled() -> None:
    bench = Bench()
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD")]}))
    bench.runs("a")

    bench.instant(action("c", "NONE", "cancelOrder"))
    assert bench.status("c") == "RUNNING"
    bench.fails("a")

    assert bench.status("c") == "FINISHED"


@pytest.mark.clause("6.1.3")
def test_a_cancel_works_in_a_pause_which_stays() -> None:
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

    assert bench.status("c") == "FINISHED"
    assert not bench.errors


@pytest.mark.clause("6.1.4.6", "6.1.3/after")
def test_no_new_order_is_taken_during_a_cancel_and_one_is_after_it() -> None:
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
def test_after_a_cancel_the_last_node_with_a_large_deviation_is_a_start() -> None:
    bench = driving()
    bench.do(at(4.0))
    bench.instant(action("c", "NONE", "cancelOrder"))
    bench.halted()

    bench.send(order("n0", "n1", order_id="o2", positions={"n0": position(0.0, radius=5.0)}))

    assert bench.state.order_id == "o2"
