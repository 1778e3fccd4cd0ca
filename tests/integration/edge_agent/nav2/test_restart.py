"""An agent that is killed in mid-drive, as ``kill -9`` does, and started again beside the same Nav2."""

from __future__ import annotations

import pytest
from action_msgs.msg import GoalStatusArray

from support.edge_agent import ended, error_types
from support.nav2_agent import Bench, ready
from support.robot_core import order
from support.ros import LATCHED
from support.simulator import trace
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]


@pytest.mark.parametrize("arrives_meanwhile", [pytest.param(False, marks=pytest.mark.long), True])
async def test_active_goal_is_adopted_and_not_resent(bench: Bench, *, arrives_meanwhile: bool) -> None:
    arrays = bench.ros.subscribe(GoalStatusArray, "navigate_to_pose/_action/status", LATCHED)
    with bench.simulator(), bench.agent_process("--drive.external_goals", "fail") as agent:
        await bench.fleet.state(ready)
        bench.fleet.send(order("n0", "n3"))
        await bench.moves()
        agent.kill()
        if arrives_meanwhile:
            await until(lambda: trace(arrays.messages)[-1:] == ["A:4"], what="the end of the drive")
        agent.restart()

        done = await bench.fleet.state(ended("o1"))

        assert (done["lastNodeId"], error_types(done)) == ("n3", [])
        assert set(trace(arrays.messages)) <= {"A:2", "A:4"}


async def test_cancellation_is_completed_after_a_restart(bench: Bench) -> None:
    arrays = bench.ros.subscribe(GoalStatusArray, "navigate_to_pose/_action/status", LATCHED)
    with bench.simulator(time_factor=1.0), bench.agent_process() as agent:
        await bench.fleet.state(ready)
        bench.fleet.send(order("n0", "n3"))
        await bench.moves()
        await bench.killed_while_pausing(agent)
        await until(lambda: trace(arrays.messages)[-1:] == ["A:5"], what="the end of the goal")
