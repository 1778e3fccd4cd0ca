"""initializePosition (section 6.2.3)."""

from __future__ import annotations

import pytest

from nena_edge_agent.driver.port import Pose, PositionInitialized
from nena_edge_agent.protocol.events import SetPosition, TimePassed
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.error import ErrorType
from support.robot_core import MAP, Bench, action, at, order

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
def test_the_position_is_handed_over_and_finished_when_it_is_taken() -> None:
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
def test_a_silent_localisation_fails_the_action_after_a_time() -> None:
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


def test_one_position_at_a_time() -> None:
    bench = Bench()
    bench.instant(be_at())

    bench.instant(be_at("n6", "j"))

    assert (bench.status("i"), bench.status("j")) == ("RUNNING", "FAILED")
    bench.do(DONE)
    assert bench.state.last_node_id == "n5"


@pytest.mark.clause("6.2.3/initializePosition")
def test_a_driving_robot_is_not_moved_to_another_place() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    bench.instant(be_at())

    assert bench.status("i") == "FAILED"
    assert bench.state.last_node_id == "n0"


@pytest.mark.clause("6.2.3/initializePosition", "6.6.5.4/localisation")
def test_an_order_goes_on_when_its_lost_robot_is_told_where_it_is() -> None:
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


def test_a_number_that_no_float_can_hold_is_refused_and_blocks_nothing() -> None:
    bench = Bench()

    bench.instant(be_at(x=10**400, action_id="huge"))
    bench.instant(be_at())

    assert bench.status("huge") == "FAILED"
    assert bench.status("i") == "RUNNING"


@pytest.mark.clause("6.1.2/B5")
def test_an_ended_order_does_not_go_on_from_a_place_that_the_robot_was_taken_away_from() -> None:
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
