"""Nodes without a reason to stop are passed at speed, by each way to drive; a base may grow on the way."""

from __future__ import annotations

from typing import Any

import pytest
from action_msgs.msg import GoalStatusArray
from nav_msgs.msg import Odometry

from nena_edge_agent.nav2.settings import Navigation
from support.action_types import needs_action_types
from support.edge_agent import ended, error_types
from support.nav2_agent import Bench, ready
from support.robot_core import order, position
from support.ros import BEST_EFFORT, LATCHED
from support.simulator import trace
from support.smooth_drive import LIKE_NAV2, NODES, REGULATED, WAYS, drive, settings

pytestmark = [pytest.mark.ros, pytest.mark.broker, pytest.mark.usefixtures("unstopped")]


@pytest.mark.parametrize(
    "navigation",
    [
        pytest.param(Navigation.TOPICS, marks=pytest.mark.long),
        pytest.param(Navigation.ACTION, marks=(needs_action_types, pytest.mark.long)),
        pytest.param(Navigation.THROUGH_POSES, marks=needs_action_types),
    ],
)
async def test_passed_nodes_cost_less_than_a_fifth_of_the_speed(bench: Bench, navigation: Navigation) -> None:
    odometry = bench.ros.subscribe(Odometry, "odom", BEST_EFFORT)
    with bench.simulator(*LIKE_NAV2, time_factor=1.0, drive=REGULATED):
        async with bench.agent(**settings(navigation)) as fleet:
            await fleet.state(ready)
            slowest = await drive(fleet, odometry, WAYS[navigation])
            last = fleet.states[-1]
    assert slowest >= 0.8
    assert (last["lastNodeId"], error_types(last)) == (NODES[-1], [])


@needs_action_types
async def test_a_base_that_is_extended_on_request_is_passed_at_speed(bench: Bench) -> None:
    """Through poses Nav2 plans again each 3 s only, and slows down for the end that it knows."""
    places = {f"n{index}": position(2.5 * index, radius=0.5) for index in range(5)}
    with bench.simulator(*LIKE_NAV2, time_factor=1.0, drive={**REGULATED, "speed": 1.0}):
        async with bench.agent(**settings(Navigation.THROUGH_POSES)) as fleet:
            await fleet.state(ready)
            fleet.send(order(*places, released=3, positions=places))
            await fleet.state(lambda state: state["newBaseRequest"])
            fleet.send(order("n2", "n3", "n4", update=1, first=4, positions=places))
            done = await fleet.state(ended("o1"))
    assert (done["lastNodeId"], error_types(done)) == ("n4", [])
    assert min(bench.speeds(2.0, 8.5)) >= 0.8


@needs_action_types
async def test_route_over_several_nodes_is_one_goal(bench: Bench) -> None:
    arrays = bench.ros.subscribe(GoalStatusArray, "navigate_through_poses/_action/status", LATCHED)
    with bench.simulator(time_factor=2.0):  # slow enough to be seen at each node
        async with bench.agent(**settings(Navigation.THROUGH_POSES)) as fleet:
            await fleet.state(ready)
            fleet.send(order("n0", "n1", "n2", "n3"))
            done = await fleet.state(ended("o1"))
    assert (done["lastNodeId"], error_types(done)) == ("n3", [])
    assert trace(arrays.messages) == ["A:2", "A:4"]
    nodes = [state["lastNodeId"] for state in bench.fleet.states]
    assert [name for name in ("n1", "n2", "n3") if name in nodes] == ["n1", "n2", "n3"]


@needs_action_types
async def test_sharp_bend_ends_a_goal_and_no_node_is_skipped(bench: Bench) -> None:
    arrays = bench.ros.subscribe(GoalStatusArray, "navigate_through_poses/_action/status", LATCHED)
    corner: dict[str, Any] = {"n2": position(10.0, 5.0, radius=0.3), "n3": position(3.0, 5.0, radius=0.3)}
    with bench.simulator():
        async with bench.agent(**settings(Navigation.THROUGH_POSES)) as fleet:
            await fleet.state(ready)
            fleet.send(order("n0", "n1", "n2", "n3", positions=corner))
            done = await fleet.state(ended("o1"))
    assert (done["lastNodeId"], error_types(done)) == ("n3", [])
    nodes = [state["lastNodeId"] for state in bench.fleet.states]
    assert [name for name in ("n1", "n2", "n3") if name in nodes] == ["n1", "n2", "n3"]
    assert len(trace(arrays.messages)[-1].split()) >= 3
