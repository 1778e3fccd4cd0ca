"""Goals carry the file of the behaviour tree that an edge names."""

from __future__ import annotations

import pytest

from nena_shared.vda5050.own_actions import USE_BEHAVIOR_TREE
from support.action_types import needs_nav2_types
from support.edge_agent import ended, error_types, status_of
from support.nav2_agent import Bench, ready
from support.robot_core import action, order, position

pytestmark = [pytest.mark.ros, pytest.mark.broker, needs_nav2_types]


async def test_edge_is_driven_with_its_behavior_tree(bench: Bench) -> None:
    trees = {"behavior_trees": {"careful": "/opt/trees/careful.xml"}}
    slow = action("t", "NONE", USE_BEHAVIOR_TREE, retriable=None, behaviorTree="careful")
    places = {f"n{number}": position(2.0 * number, radius=0.5) for number in range(3)}
    drive = {"strategy": "pass_through", "pass_radius": 0.5}
    with bench.simulator() as simulator:
        async with bench.agent(ros=trees, drive=drive) as fleet:
            await fleet.state(ready)
            fleet.send(order("n0", "n1", "n2", positions=places, edge_actions={"n1-n2": [slow]}))
            done = await fleet.state(ended("o1"))
        goals = [line for line in simulator.lines if " goal " in line and "tree=" in line]
    assert (done["lastNodeId"], error_types(done)) == ("n2", [])
    assert status_of(done, "t") == "FINISHED"
    assert ["/opt/trees/careful.xml" in line for line in goals] == [False, True]
