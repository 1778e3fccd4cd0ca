"""Which nodes are driven over with one goal, and when a driver is told of others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.capabilities import DriveStrategy, LinkLossPolicy
from nena_edge_agent.protocol.events import LinkReport, TimePassed
from nena_edge_agent.protocol.way_ahead import MOST
from support.robot_core import MAP, Bench, action, at, order, position

AHEAD: dict[str, Any] = {"strategy": DriveStrategy.PASS_THROUGH, "drives_ahead": True}


def ahead(bench: Bench) -> list[tuple[float, float]]:
    return [(pose.x, pose.y) for pose in bench.goal.ahead]


def test_the_nodes_of_the_base_come_with_the_first_goal() -> None:
    bench = Bench(**AHEAD)
    bench.send(order("n0", "n1", "n2", "n3", "n4", released=4))
    assert bench.goal.pose == Pose(10.0, 0.0, 0.0, MAP)
    assert bench.goal.ahead == (Pose(20.0, 0.0, 0.0, MAP), Pose(30.0, 0.0, 0.0, MAP))


@pytest.mark.parametrize("fields", [{"drives_ahead": False}, {"strategy": DriveStrategy.STOP_AT_NODES}])
def test_a_driver_that_cannot_or_must_stop_is_told_of_one_node(fields: dict[str, Any]) -> None:
    bench = Bench(**(AHEAD | fields))
    bench.send(order("n0", "n1", "n2"))
    assert ahead(bench) == []


@pytest.mark.parametrize(
    "fields",
    [
        {"node_actions": {"n2": [action("a", "HARD")]}},
        {"edge_actions": {"n2-n3": [action("a", "HARD")]}},
        {"positions": {"n2": position(20.0, theta=0.0)}},
        {"positions": {"n3": position(20.0, 10.0)}},
        {"released": 3},
    ],
)
def test_a_way_ends_at_the_first_stop(fields: dict[str, Any]) -> None:
    bench = Bench(**AHEAD)
    bench.send(order("n0", "n1", "n2", "n3", **fields))
    assert ahead(bench) == [(20.0, 0.0)]


def test_a_gentle_bend_or_a_node_with_room_is_passed() -> None:
    bench = Bench(**AHEAD)
    places = {"n1": position(10.0), "n2": position(20.0, 3.0, radius=0.8), "n3": position(20.0, 10.0)}
    bench.send(order("n0", "n1", "n2", "n3", positions=places))
    assert ahead(bench) == [(20.0, 3.0), (20.0, 10.0)]


def test_a_long_way_is_told_in_parts() -> None:
    bench = Bench(**AHEAD)
    bench.send(order(*(f"n{number}" for number in range(MOST + 10))))
    assert len(ahead(bench)) == MOST


def test_a_passed_node_leaves_the_rest_of_the_way() -> None:
    bench = Bench(**AHEAD)
    bench.send(order("n0", "n1", "n2", "n3"))
    bench.do(at(9.8))
    assert bench.state.last_node_id == "n1"
    assert (bench.goal.pose.x, ahead(bench)) == (20.0, [(30.0, 0.0)])


def test_a_node_is_passed_anywhere_in_its_deviation() -> None:
    bench = Bench(**AHEAD, pass_radius=0.1)
    bench.send(order("n0", "n1", "n2", positions={"n1": position(10.0, radius=0.8)}))
    bench.do(at(9.3))
    assert bench.state.last_node_id == "n1"


def test_a_base_that_grows_is_told_at_once() -> None:
    bench = Bench(**AHEAD)
    bench.send(order("n0", "n1", "n2", released=2))
    first = bench.goal
    assert first.ahead == ()
    bench.do(at(5.0))
    bench.send(order("n1", "n2", update=1, first=2))
    assert (bench.goal.pose, ahead(bench)) == (first.pose, [(20.0, 0.0)])
    assert bench.goal.generation > first.generation
    goals = len(bench.goals)
    bench.do(at(6.0), TimePassed())
    assert len(bench.goals) == goals


def test_a_robot_that_is_to_stop_at_the_next_node_is_told_so() -> None:
    policy: dict[str, Any] = {"link_loss": LinkLossPolicy.PREVENTIVE_NEXT_NODE, "link_loss_patience": 5.0}
    bench = Bench(**AHEAD, **policy)
    bench.do(LinkReport(connected=True))
    bench.send(order("n0", "n1", "n2"))
    assert ahead(bench) == [(20.0, 0.0)]
    bench.do(LinkReport(connected=False))
    bench.now += 6.0
    bench.do(TimePassed())
    assert ahead(bench) == []


def test_the_goal_is_the_same_but_for_what_is_ahead() -> None:
    one, other = Bench(), Bench(**AHEAD)
    for bench in (one, other):
        bench.send(order("n0", "n1", "n2"))
    assert replace(other.goal, ahead=()) == one.goal
